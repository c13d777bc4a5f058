"""Large scenes with loops: called link by link and loop by loop, they move as if they were written out as a whole."""

from dataclasses import replace

import numpy as np
import pytest

import gauss
from gauss.analysis.crosscheck.pinocchio_ import twin
from gauss.analysis.crosscheck.pinocchio_dynamics import instant
from gauss.analysis.crosscheck.pinocchio_loops import constrained_accelerations
from gauss.codegen import Kernel
from gauss.dynamics.assemble import position_residual
from gauss.dynamics.conditions import has_large_loops, obstacles
from gauss.dynamics.engines.call_graph import CallGraphKernels, call_graph_code, refined_call_graph
from gauss.dynamics.kinematics import kinematics
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.loads import Applied
from gauss.dynamics.plan import motion_plan
from gauss.dynamics.traced_system import Program
from gauss.errors import GaussError
from gauss.system import retract
from tests.support import mechanisms
from tests.support.welded import Welded

pytestmark = pytest.mark.slow

AGREED = 1e-11  # relative: both are regularised alike, and rounded otherwise
PROXIMAL = 1e-9  # relative: of Pinocchio's iteration
MET_RESIDUAL = 1e-12  # gap of settled states [rad, m]


def _ring(kind: str, n: int = 4) -> gauss.Scene:
    """Ring of n links on joints of a kind, hung at one of them."""
    scene, angles = gauss.Scene(f"ring of {kind}"), np.arange(n) * 2.0 * np.pi / n
    points = np.column_stack([np.cos(angles), np.sin(angles), 0.1 * np.cos(2 * angles)])
    rng = np.random.default_rng(0)
    for i in range(n):
        com = rng.normal(size=3) / 9
        scene.body(f"link{i}", rng.uniform(0.5, 2.0), mechanisms.inertia(rng), position=points[i], com=com)
    axis = lambda: {} if kind == "ball" else {"axis": rng.normal(size=3)}  # noqa: E731
    scene.joint("hanger", "universal", "ground", "link0", at=points[0], axis=(1, 0, 0))
    for i in range(n):
        scene.joint(f"joint{i}", kind, f"link{i}", f"link{(i + 1) % n}", at=points[(i + 1) % n], **axis())
    return scene


def _two_islands() -> gauss.Scene:
    """Two four-bars beside each other, and a pendulum."""
    scene = gauss.Scene("islands", gravity=(0, -9.81, 0))
    rod = {"mass": 1.0, "inertia": (0.0, 1 / 12, 1 / 12), "com": (0.5, 0, 0)}
    for k, x in enumerate((0.0, 5.0)):
        up = (0, 0, np.pi / 2)
        scene.body(f"a{k}", **rod, position=(x, 0, 0), rotation=up)
        scene.body(f"b{k}", **rod, position=(x, 1, 0))
        scene.body(f"c{k}", **rod, position=(x + 1, 0, 0), rotation=up)
        for name, one, two, at in (("A", "ground", "a", (0, 0)), ("B", "a", "b", (0, 1)), ("C", "b", "c", (1, 1))):
            first = one if one == "ground" else f"{one}{k}"
            scene.revolute(f"{name}{k}", first, f"{two}{k}", at=(x + at[0], at[1], 0))
        scene.revolute(f"D{k}", f"c{k}", "ground", at=(x + 1, 0, 0))
    scene.body("bob", **rod)
    scene.revolute("pivot", "ground", "bob")
    scene.joint_spring("rub", "A0", stiffness=0.5, damping=0.3)
    return scene


def _coupled_chain(n: int = 16, gravity=(0, 0, -9.81)) -> gauss.Scene:
    """Chain of hinges; every second one is coupled to that before it."""
    scene, rng = gauss.Scene("coupled chain", gravity=gravity), np.random.default_rng(0)
    for i in range(n):
        scene.body(f"link{i}", rng.uniform(0.5, 2.0), mechanisms.inertia(rng), position=(i + 0.5, 0, 0))
        scene.revolute(f"J{i}", f"link{i - 1}" if i else "ground", f"link{i}", at=(i, 0, 0), axis=rng.normal(size=3))
    for i in range(0, n - 1, 2):
        scene.couple(f"C{i}", f"J{i + 1}", f"J{i}", ratio=-1.2 - 0.1 * i)
    return scene


def _coupled_five_bar() -> gauss.Scene:
    """Five-bar with a hanging rod, which carries a wheel for each joint of the loop, coupled to it."""
    scene, points = gauss.Scene("coupled five-bar", gravity=(0, -9.81, 0)), [(0, 0), (0, 1), (1, 1.5), (2, 1), (2, 0)]
    rod, bodies = {"mass": 1.0, "inertia": (0.1, 0.1, 0.12)}, ["ground", "a", "b", "c", "d", "ground"]
    for name, one, two in zip("abcd", points, points[1:], strict=False):
        scene.body(name, **rod, position=(*(np.add(one, two) / 2), 0))
    for name, one, two, at in zip("ABCDE", bodies, bodies[1:], points, strict=False):
        scene.revolute(name, one, two, at=(*at, 0))
    scene.body("rod", **rod, position=(1, 1, 0))
    scene.revolute("R", "b", "rod", at=(1, 1.5, 0))
    for k, name in enumerate("ABCDE"):
        scene.body(f"wheel{name}", **rod, position=(1, k / 5, 0))
        scene.revolute(f"W{name}", "rod", f"wheel{name}", at=(1, k / 5, 0))
        scene.couple(f"C{name}", f"W{name}", name, ratio=0.4 * k - 0.7)
    return scene


SCENES = {
    "four-bar": mechanisms.four_bar,
    "four-bar with a joint twice": lambda: mechanisms.four_bar(twice=True),
    "ladder 2": lambda: gauss.load("n_four_bar", n=2),
    "ladder 10": lambda: gauss.load("n_four_bar", n=10),
    "bricard": lambda: gauss.load("bricard"),
    "stewart": lambda: gauss.load("stewart_platform"),
    "hung chain": lambda: gauss.load("hung_chain", n=20),
    "ring of balls": lambda: _ring("ball"),
    "ring of universals": lambda: _ring("universal"),
    "islands": _two_islands,
    "coupled chain": _coupled_chain,
    "coupled five-bar": _coupled_five_bar,
}


def consistent_state(system, seed: int = 1):
    """State near the start that meets the constraints, with some rates."""
    rng, start = np.random.default_rng(seed), system.initial_state()
    try:
        moved = retract(system, start.q, 0.05 * rng.normal(size=system.n_v))
        return system.initial_state(moved, start.v + rng.normal(size=system.n_v))
    except GaussError:
        return start


def _refined(system, state, load) -> np.ndarray:
    """Accelerations under the loads of the scene and others, their error, residual of the state, sum of the inputs."""
    kernel = Kernel(refined_call_graph(system, system.loads), batch=False)
    return kernel(np.concatenate([state.q, state.v, load, [state.t]]))


WRITTEN = (
    "four-bar with a joint twice",
    "ladder 10",
    "bricard",
    "hung chain",
    "islands",
    "coupled chain",
    "coupled five-bar",
)  # soon compiled as a whole


@pytest.fixture(scope="module", params=SCENES)
def case(request):
    system = gauss.compile_scene(SCENES[request.param]())
    return system, consistent_state(system), CallGraphKernels(system)


def test_accelerations_are_those_of_the_certified_recursion(case):
    system, state, _ = case
    load = np.random.default_rng(2).normal(size=system.n_v)
    found = _refined(system, state, load)
    solution = gauss.solve(gauss.assemble(system, state, load))
    assert str(solution.status) == "solved"
    scale = np.abs(solution.qdd).max()
    assert np.abs(found[: system.n_v] - solution.qdd).max() <= AGREED * scale
    error, gap, _ = found[system.n_v :]
    assert error <= AGREED and gap <= 1e-10


def test_batches_of_states_are_evaluated_one_by_one():
    system = gauss.compile_scene(gauss.load("n_four_bar", n=43))
    states = [consistent_state(system, seed) for seed in range(3)]
    q, v = (np.array([getattr(state, name) for state in states]) for name in ("q", "v"))
    load = np.random.default_rng(0).normal(size=v.shape)
    found = system.forward_dynamics(q, v, load)
    for k, state in enumerate(states):
        assert np.array_equal(found[k], system.accelerations(state, load[k]))


@pytest.mark.parametrize("name", WRITTEN)
def test_they_are_those_of_the_code_that_is_written_out(name):
    system = gauss.compile_scene(SCENES[name]())
    state, load = consistent_state(system), np.random.default_rng(3).normal(size=system.n_v)
    whole = Program(system, Laws(system)).forward()(np.concatenate([[0.0], state.q, state.v, load]))[: system.n_v]
    effort = load + gauss.assemble(system, state).P
    found = CallGraphKernels(system).forward(np.concatenate([[0.0], state.q, state.v, effort]))[: system.n_v]
    assert np.abs(found - whole).max() <= AGREED * np.abs(whole).max()


def test_wrong_accelerations_are_noticed(case):
    system, state, kernels = case
    effort = gauss.assemble(system, state).P
    found = kernels.forward(np.concatenate([[0.0], state.q, state.v, effort]))[: system.n_v]

    def error(accelerations):
        unused = np.zeros(3)
        return kernels.check(np.concatenate([[0.0], state.q, state.v, unused, accelerations, unused, effort]))[0]

    assert error(found) <= AGREED
    part = system.subsystems[0]
    for edge in part.tree[:3]:
        wrong = found.copy()
        wrong[part.v[part.joints[edge.constraint].v]] += 1e-6 * np.abs(found).max()
        assert error(wrong) >= 1e-8


def test_states_are_brought_back_to_the_constraints(case):
    """The gap closes, the motion that a state had already stays, and a state that meets them does not move."""
    system, state, kernels = case
    rng, n_q = np.random.default_rng(4), system.n_q
    same = kernels.project(np.concatenate([[0.0], state.q, state.v]))
    assert np.abs(same[:-1] - np.concatenate([state.q, state.v])).max() <= 1e-9 * (1.0 + np.abs(state.v).max())
    off = retract(system, state.q, 1e-6 * rng.normal(size=system.n_v))
    found = kernels.project(np.concatenate([[0.0], off, state.v + 1e-6 * rng.normal(size=system.n_v)]))
    settled = replace(state, q=found[:n_q], v=found[n_q:-1])
    gap = np.abs(position_residual(kinematics(system, settled))).max()
    assert found[-1] <= MET_RESIDUAL and gap <= 10 * MET_RESIDUAL
    slips = gauss.assemble(system, settled)
    quasi = kinematics(system, settled).quasi_velocities()
    slip = slips.about_rest().residuals(quasi, settled.v, np.zeros(slips.D.size))[1]
    assert np.abs(slip).max() <= 10 * MET_RESIDUAL * (1.0 + np.abs(settled.v).max())


def test_states_off_the_constraints_are_told():
    system = gauss.compile_scene(gauss.load("n_four_bar", n=2))
    state, load = consistent_state(system), np.zeros(system.n_v)
    for name, q, v in (("position", 1e-6, 0.0), ("rate", 0.0, 1e-6)):
        off_q, off_v = state.q.copy(), state.v.copy()
        off_q[0] += q
        off_v[0] += v
        gap = _refined(system, replace(state, q=off_q, v=off_v), load)[-2]
        assert 1e-8 <= gap <= 1e-4, name


@pytest.mark.peer
@pytest.mark.parametrize("n", [2, 40])
def test_a_ladder_accelerates_as_in_pinocchio(n):
    """As its constraintDynamics says, whose own proximal iteration ends there, and more exactly as null spaces say."""
    scene = gauss.load("n_four_bar", n=n)
    system = gauss.compile_scene(scene)
    signs = np.array([-1.0 if name.startswith("B") else 1.0 for name in system.coordinates])
    state, load = system.state(-0.7 * signs, -2.0 * signs), np.zeros(system.n_v)  # leaning, and falling
    found = _refined(system, state, load)[: system.n_v]
    scale = np.abs(found).max()
    assert np.abs(found - Welded(scene).dynamics(state)[1]).max() <= PROXIMAL * scale
    motion = kinematics(system, state)
    exact = constrained_accelerations(instant(twin(system), motion, Applied(motion), load), state)
    assert np.abs(found - exact).max() <= AGREED * scale


def test_what_is_compiled_does_not_grow_and_what_is_done_grows_in_proportion():
    """Tables of twice as many loops are twice as long, to one per cent; the functions are the same ones."""
    for family, sizes in (("n_four_bar", (10, 20, 40)), ("hung_chain", (20, 40, 80))):
        kernels = [call_graph_code(gauss.compile_scene(gauss.load(family, n=n))).sections.calls for n in sizes]
        codes = {memory.calls.count for memory in kernels[1:]}
        sizes = np.array([sum(len(table) for table in memory.tables.values()) for memory in kernels])
        assert len(codes) == 1
        assert sizes[2] - sizes[1] == pytest.approx(2 * (sizes[1] - sizes[0]), rel=0.01)
        assert kernels[2].values.size <= 4.1 * kernels[0].values.size


def test_explain_says_which_way_is_taken():
    assert "gauss.mobility" in mechanisms.ladder().explain()
    plans = [motion_plan(mechanisms.ladder(n)) for n in (50, 5)]
    assert [plan.dynamics for plan in plans] == ["call graph", "embedded loops"]
    assert has_large_loops(gauss.compile_scene(gauss.load("hung_chain", n=200)))


def test_platforms_in_a_stack_are_called_loop_by_loop():
    """Each loop is coupled with all others, through the platforms below: too much for straight-line code."""
    system = gauss.compile_scene(mechanisms.platforms(8))
    assert motion_plan(system).dynamics == "call graph" and obstacles(system)
    state = consistent_state(system)
    found, solution = system.accelerations(state), gauss.solve(gauss.assemble(system, state))
    assert str(solution.status) == "solved"
    assert np.abs(found - solution.qdd).max() <= AGREED * np.abs(solution.qdd).max()


def test_a_long_ladder_moves_on_its_constraints():
    """Fifty windows fall; energy is kept, constraints hold, and the cranks stay parallel."""
    system = mechanisms.ladder()
    motion = gauss.simulate(system, 0.4, times=np.linspace(0.1, 0.4, 4), progress=False)
    assert motion.stats.plan.dynamics == "call graph" and motion.stats.handed_over is None
    for t, q, v in zip(motion.t, motion.q, motion.v, strict=True):
        assert np.abs(position_residual(kinematics(system, gauss.State(t, q, v)))).max() <= MET_RESIDUAL
    cranks = motion.q[:, [system.column(f"A{i}") for i in range(51)]]
    assert np.ptp(cranks, axis=1).max() <= 1e-9
    energy = gauss.energy(motion)
    assert np.abs(energy.balance).max() <= 1e-9 * energy.scale


def test_a_long_chain_with_couplings_moves_on_them():
    system = gauss.compile_scene(_coupled_chain(30))
    motion = gauss.simulate(system, 0.1, times=[0.05, 0.1], progress=False)
    assert motion.stats.plan.dynamics == "call graph" and motion.stats.handed_over is None
    for t, q, v in zip(motion.t, motion.q, motion.v, strict=True):
        assert np.abs(position_residual(kinematics(system, gauss.State(t, q, v)))).max() <= MET_RESIDUAL
    energy = gauss.energy(motion)
    assert np.abs(energy.balance).max() <= 1e-9 * energy.scale


def test_it_goes_through_the_flat_posture():
    """There all closing rows fade at once; machine code goes on, on the constraints, and the cranks stay parallel."""
    system = mechanisms.ladder()
    motion = gauss.simulate(system, 1.0, times=[0.6, 0.8, 1.0], progress=False)
    assert motion.stats.plan.dynamics == "call graph" and motion.stats.handed_over is None
    angle = -motion.q[:, system.column("A0")]
    assert angle[0] < np.pi / 2 < angle[-1]
    for t, q, v in zip(motion.t, motion.q, motion.v, strict=True):
        assert np.abs(position_residual(kinematics(system, gauss.State(t, q, v)))).max() <= MET_RESIDUAL
    assert np.ptp(motion.q[:, [system.column(f"A{i}") for i in range(51)]], axis=1).max() <= 1e-6


def test_it_falls_as_one_window_does_that_weighs_as_much():
    """Cranks stay parallel: the ladder has the freedom of one rod, with the inertia and weight of all of them."""
    n, times = 50, np.array([0.2, 0.4])
    system = mechanisms.ladder(n)
    motion = gauss.simulate(system, 0.4, times=times, progress=False)
    rods, couplers = n + 1, n
    pendulum = gauss.Scene("one rod", gravity=(0, -9.81, 0))
    mass = rods + couplers
    centre = (rods / 2 + couplers) / mass
    inertia = rods / 3 + couplers - mass * centre**2
    pendulum.body("rod", mass, (0.0, inertia, inertia), com=(centre, 0, 0), rotation=(0, 0, np.pi / 2))
    pendulum.revolute("A", "ground", "rod")
    pendulum.start("A", rate=-1.0)
    expected = gauss.simulate(pendulum, 0.4, times=times, progress=False)
    assert np.abs(motion.q[:, system.column("A0")] - expected.q[:, 0]).max() <= 1e-9


def test_baumgarte_draws_it_back():
    system = mechanisms.ladder()
    motion = gauss.simulate(system, 0.2, stabilisation="baumgarte", progress=False)
    state = gauss.State(motion.t[-1], motion.q[-1], motion.v[-1])
    assert np.abs(position_residual(kinematics(system, state))).max() <= 1e-9
    assert motion.stats.plan.dynamics == "call graph" and motion.stats.handed_over is None


def test_loads_on_joints_act_and_are_called():
    scene = gauss.load("n_four_bar", n=50)
    calls = []
    scene.drive("A0", torque=lambda t, motion: calls.append(t) or 3.0)
    system, free = gauss.compile_scene(scene), mechanisms.ladder()
    state = free.initial_state()
    load = np.zeros(system.n_v)
    load[system.column("A0")] = 3.0
    assert has_large_loops(system)
    found, expected = system.accelerations(state), free.accelerations(state, load)
    assert np.abs(found - expected).max() <= AGREED * np.abs(expected).max() and calls
