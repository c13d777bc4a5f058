"""The articulated-body recursion in joint coordinates, as numbers and as machine code, against the compulsion's own."""

import numpy as np
import pytest

import gauss
from gauss import math
from gauss.codegen import trace
from gauss.dynamics.conditions import obstacles
from gauss.dynamics.engines.compiled import CompiledEngine
from gauss.dynamics.engines.engine import DistrustError
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.mechanism import Mechanism, forward_dynamics
from gauss.dynamics.plan import motion_plan
from gauss.dynamics.traced_system import Program
from gauss.integrators import Point, Rates
from gauss.scene import PAIRS
from gauss.system import random_state
from tests.support import mechanisms

ROUNDING = 1e-12  # relative to the largest acceleration, as against Pinocchio
# Behind a free or ball joint, inertias about a joint point metres away from a compact body cancel; plain pin.aba loses
# as much (6e-11 was seen). The recursion, whose unknowns are those of the centres of mass, does not.
FAR = 1e-10
FAR_SCENES = {"two free", "two ball", "reversed free", "reversed ball"}


def forward_kernel(system):
    return Program(system, Laws(system)).forward()


def _reversed(kind):
    """Two joints of one kind whose parents are reached from their children."""
    scene = gauss.Scene("reversed")
    straight = mechanisms.two_bodies(kind, 3)
    for body in straight.bodies.values():
        scene.add(body)
    scene.free("base", "ground", "b", at=(0.1, 0.2, 0.3))
    scene.add(straight.joints["B"])  # the tree comes from b and reaches a, the parent
    return scene


SCENES = {f"two {kind}": lambda kind=kind: mechanisms.two_bodies(kind, 2) for kind in PAIRS}
SCENES |= {f"reversed {kind}": lambda kind=kind: _reversed(kind) for kind in PAIRS}
SCENES |= {f"tree {n}": lambda n=n: gauss.load("random_tree", n=n, seed=n) for n in (3, 8, 15)}
SCENES["gear pair"] = lambda: gauss.load("gear_pair")
SCENES["panda"] = lambda: gauss.load("robot:panda", mimic=False)
SCENES["talos, free"] = lambda: gauss.load("robot:talos", root="free")


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_numbers_and_machine_code_agree_with_the_recursion(name):
    system = gauss.compile_scene(SCENES[name]())
    kernel = forward_kernel(system)
    rng = np.random.default_rng(0)
    tolerance = FAR if name in FAR_SCENES else ROUNDING
    for _ in range(5):
        state, effort = random_state(system, rng), rng.standard_normal(system.n_v)
        compulsion = gauss.assemble(system, state, effort)
        expected = gauss.solve(compulsion, "recursion").qdd
        for found in (
            forward_dynamics(system, state.q, state.v, compulsion.P),
            kernel(np.concatenate([[0.0], state.q, state.v, effort]))[: system.n_v],
        ):
            assert np.abs(found - expected).max(initial=0.0) <= tolerance * np.abs(expected).max(initial=0.0)


@pytest.mark.parametrize("kind", sorted(PAIRS))
def test_single_efforts_reach_joints_beyond_them(kind):
    """A force on one joint moves those further out, of any number of freedoms, on which nothing acts: M⁻¹, by columns."""
    system = gauss.compile_scene(mechanisms.two_bodies(kind, 2))
    state = random_state(system, np.random.default_rng(2))
    mechanism, none = Mechanism(system, state.q, state.v), np.zeros(0)
    found = np.array([mechanism.response(unit, none)[0] for unit in np.eye(system.n_v)])
    assert np.abs(found @ system.mass_matrix(state.q) - np.eye(system.n_v)).max(initial=0.0) <= FAR


LOOPS = {
    "four-bar": mechanisms.four_bar,
    "four-bar, cut elsewhere": lambda: mechanisms.four_bar("CDAB"),
    "four-bar, one joint twice": lambda: mechanisms.four_bar(twice=True),
    "slider-crank": lambda: gauss.load("slider_crank"),
    "Cardan shaft": lambda: gauss.load("cardan"),
    "ladder": lambda: gauss.load("n_four_bar", n=2),
    "panda with mimic finger": lambda: gauss.load("robot:panda"),
}


def _closed_by(kind):
    """Two bodies that each hang on the ground by a joint of six freedoms, and on each other by the given one."""
    scene, rng = gauss.Scene("closed", gravity=(0.3, -9.0, 1.0)), np.random.default_rng(0)
    straight = mechanisms.two_bodies(kind, 3)
    for body in straight.bodies.values():
        scene.add(body)
    for body in straight.bodies:
        scene.free(f"free {body}", "ground", body, at=rng.normal(size=3))
    scene.add(straight.joints["B"])
    scene.drive("B", torque=[0.3] * PAIRS[kind].n_v) if kind not in ("fixed", "prismatic", "screw") else None
    return scene


LOOPS |= {f"closed by {kind}": lambda kind=kind: _closed_by(kind) for kind in PAIRS}


@pytest.mark.slow
@pytest.mark.parametrize("name", LOOPS)
def test_loops_agree_with_the_recursion(name):
    """Redundant rows included: the accelerations are unique, whatever the reactions."""
    system = gauss.compile_scene(LOOPS[name]())
    assert not obstacles(system)
    kernel = forward_kernel(system)
    rng = np.random.default_rng(1)
    for _ in range(5):
        guess = random_state(system, rng, spread=0.2, slide=0.02)
        state = system.initial_state(guess.q, guess.v)
        effort = rng.standard_normal(system.n_v)
        compulsion = gauss.assemble(system, state, effort)
        expected = gauss.solve(compulsion, "recursion").qdd
        for found in (
            forward_dynamics(system, state.q, state.v, compulsion.P),
            kernel(np.concatenate([[0.0], state.q, state.v, effort]))[: system.n_v],
        ):
            assert np.abs(found - expected).max() <= ROUNDING * np.abs(expected).max()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["four-bar", "Cardan shaft", "slider-crank"])
def test_compiled_loops_move_like_certified_ones(name):
    fast, slow = (gauss.simulate(LOOPS[name](), 0.3, rtol=1e-11, atol=1e-13, backend=b) for b in ("auto", "recursion"))
    assert fast.stats.plan.dynamics in ("compiled", "embedded loops") and fast.stats.handed_over is None
    assert np.abs(fast.q[-1] - slow.q[-1]).max() <= 1e-9


def test_a_planar_loop_modelled_in_space_costs_what_the_plane_costs():
    """The rows out of the plane fold away: not one of the 3 redundant rows of a four-bar is computed."""
    assert sum(forward_kernel(gauss.compile_scene(mechanisms.four_bar())).operations.values()) < 600


def test_an_arm_in_the_plane_costs_what_the_plane_costs():
    """Axes parallel to z, no offsets along it: what leaves the plane folds away."""
    planar = forward_kernel(gauss.compile_scene(mechanisms.rods(7)))
    spatial = forward_kernel(gauss.compile_scene(mechanisms.chain([1.0] * 7)))
    assert sum(planar.operations.values()) < 0.5 * sum(spatial.operations.values())


@pytest.mark.slow
@pytest.mark.parametrize("integrator, options", [("dop853", {}), ("rk4", {"step": 0.01})])
def test_compiled_and_certified_motions_are_the_same(integrator, options):
    scene = gauss.load("spatial_tree")
    scene.drive("b1", torque=lambda t: np.sin(t), name="swing")
    scene.joint_spring("spring", "b3", stiffness=2.0, damping=0.1)
    assert not obstacles(gauss.compile_scene(scene))
    fast, slow = (
        gauss.simulate(scene, 0.3, integrator=integrator, backend=backend, rtol=1e-11, atol=1e-13, **options)
        for backend in ("auto", "recursion")
    )
    assert np.abs(fast.q[-1] - slow.q[-1]).max() <= 1e-10
    assert np.abs(fast.work[-1] - slow.work[-1]).max() <= 1e-10
    assert fast.stats.worst_error <= 1e-9


@pytest.mark.slow
def test_loads_on_bodies_are_compiled():
    """Springs between bodies and constant forces, in world and body axes, with their work and loss."""
    scene = gauss.load("random_tree", n=4, seed=4)
    scene.spring("rope", "body1", "body3", at=(0.1, 0, 0), other_at=(0, 0.2, 0), stiffness=30.0, damping=1.0, length=0.3)
    scene.spring("tether", "body2", "ground", other_at=(1, 1, 1), stiffness=5.0)
    scene.force("push", "body3", force=(1, 2, 3), at=(0.1, 0.2, 0.3))
    scene.force("torch", "body0", force=(0, 1, 0), moment=(0.1, 0, 0), axes="body")
    assert not obstacles(gauss.compile_scene(scene))
    fast, slow = (gauss.simulate(scene, 0.2, rtol=1e-11, atol=1e-13, backend=b) for b in ("auto", "recursion"))
    assert fast.stats.plan.dynamics == "compiled" and fast.stats.handed_over is None
    assert np.abs(fast.q[-1] - slow.q[-1]).max() <= 1e-9
    assert np.abs(fast.work[-1] - slow.work[-1]).max() <= 1e-9
    energy = gauss.energy(fast)
    assert np.abs(energy.balance).max() <= 1e-8 * energy.scale
    assert abs(energy.loads[-1]) > 1e-3 and energy.dissipated[-1] > 1e-3


LAWS = {
    "of time": lambda t: np.sin(t),
    "of rates": lambda t, motion: -motion.rate("J1") * math.where(t < 0.1, 1.0, 2.0),
    "of places": lambda t, motion: -3.0 * motion.position("rod2", (1, 0, 0))[1] + motion.velocity("rod2")[0],
}


@pytest.mark.slow
@pytest.mark.parametrize("name", LAWS)
def test_laws_that_can_be_written_down_are_compiled(name):
    scene = mechanisms.rods(2)
    scene.drive("J1", torque=LAWS[name])
    scene.force("push", "rod2", force=lambda t: (0, 0.1 * t, 0))
    fast, slow = (gauss.simulate(scene, 0.3, rtol=1e-11, atol=1e-13, backend=b) for b in ("auto", "recursion"))
    assert fast.stats.plan.driver == "compiled loop"
    assert np.abs(fast.q[-1] - slow.q[-1]).max() <= 1e-10
    assert np.abs(fast.work[-1] - slow.work[-1]).max() <= 1e-10


@pytest.mark.slow
def test_laws_that_cannot_are_called_and_explained():
    scene = mechanisms.rods(2)
    scene.drive("J1", torque=lambda t: 1.0 if float(t) < 0.1 else 2.0)
    system = gauss.compile_scene(scene)
    assert list(system.dynamics.called(system)) == ["drive of J1"]
    fast, slow = (gauss.simulate(system, 0.3, integrator="rk4", step=0.01, backend=b) for b in ("auto", "recursion"))
    assert (fast.stats.plan.driver, fast.stats.plan.dynamics) == ("compiled loop", "callbacks")
    assert [rejected.driver for rejected in fast.stats.plan.rejected] == ["compiled loop"]
    assert np.abs(fast.q[-1] - slow.q[-1]).max() <= 1e-10


@pytest.mark.slow
def test_a_law_that_was_changed_is_traced_again():
    scene, gain = mechanisms.rods(1), [1.0]
    scene.drive("J1", torque=lambda t: gain[0] * t)
    system = gauss.compile_scene(scene)
    before = gauss.simulate(system, 0.2).q[-1]
    gain[0] = -5.0
    after = gauss.simulate(system, 0.2).q[-1]
    assert np.abs(after - gauss.simulate(system, 0.2, backend="recursion").q[-1]).max() <= 1e-8
    assert np.abs(after - before).max() > 1e-3


def test_a_force_on_a_body_leaves_a_large_tree_its_recursion():
    long = gauss.load("n_pendulum", n=45)
    long.force("push", "rod9", force=(1, 0, 0))
    assert motion_plan(gauss.compile_scene(long)).dynamics == "tree recursion"
    assert motion_plan(gauss.compile_scene(mechanisms.rods(2))).driver == "compiled loop"


def test_explain_names_the_laws_that_cost_time_and_they_are_called_once_in_an_evaluation():
    scene, calls = mechanisms.rods(2), []

    def torque(t):
        calls.append(t)
        return 1.0 if float(t) < 0.1 else 0.0

    scene.drive("J1", torque=torque)
    scene.drive("J2", torque=lambda t: math.sin(t))
    system = gauss.compile_scene(scene)
    text = system.explain()
    assert "'drive of J1'" in text and "drive of J2" not in text
    calls.clear()
    stats = gauss.simulate(system, 0.2, integrator="rk4", step=0.01, progress=False).stats
    confirmed, certified = stats.steps, 2  # checks of each step, and of the last accelerations
    # calls that trace and sample the law leave what it keeps as it was: this list, too
    assert stats.evaluations <= len(calls) <= stats.evaluations + confirmed + certified


def test_compiled_accelerations_are_confirmed():
    """A kernel that is wrong is found out, and not used any more."""
    system = gauss.compile_scene(mechanisms.rods(2))
    traced = CompiledEngine(system, Program(system, Laws(system)).kernels())
    state = system.state([0.1, 0.2], [1.0, -1.0])
    rates = traced.rates(system, state)
    traced.check(Point(state, np.zeros(3), rates))
    with pytest.raises(DistrustError, match="off by"):
        traced.check(Point(state, np.zeros(3), rates._replace(acceleration=rates.acceleration * 1.001)))
    assert traced.handed_over == 0.0


CHECKED = {
    "tree": lambda: mechanisms.chain([1.0, 2.0, 0.5]),
    "loop": mechanisms.four_bar,
    "coupled": lambda: gauss.load("gear_pair"),
}


@pytest.mark.slow
@pytest.mark.parametrize("size", [1e-3, 1e-9])
@pytest.mark.parametrize("name", CHECKED)
def test_the_check_in_machine_code_finds_how_far_accelerations_are_off(name, size):
    system = gauss.compile_scene(CHECKED[name]())
    program = Program(system, Laws(system))
    check = trace(program.check, program.layout.size)
    start = system.initial_state()
    state = system.initial_state(start.q, start.v + 0.3)
    rates = system.accelerations(state)
    found = lambda rates: check(program.layout.pack(Point(state, np.zeros(3), Rates(rates, np.zeros(3)))))[0]  # noqa: E731
    assert found(rates) <= 1e-12
    wrong = rates.copy()
    wrong[0] += size * np.abs(rates).max()
    assert found(wrong) == pytest.approx(size, rel=0.9)  # in a loop the change is spread over the others


@pytest.mark.slow
def test_pauses_between_steps_change_nothing(monkeypatch):
    scene, times = mechanisms.rods(2), np.linspace(0, 0.5, 7)
    for options in ({}, {"integrator": "rk4", "step": 0.003}):
        whole = gauss.simulate(scene, 0.5, times=times, **options)
        with monkeypatch.context() as patch:
            patch.setattr("gauss.simulation.compiled_run.BUDGET", 5)
            pieces = gauss.simulate(scene, 0.5, times=times, **options)
        assert np.array_equal(whole.q, pieces.q) and whole.stats.steps == pieces.stats.steps


@pytest.mark.slow
@pytest.mark.parametrize("integrator, options", [("dop853", {}), ("rk4", {"step": 1e-3})])
def test_a_kernel_that_loses_digits_is_replaced_in_flight(integrator, options):
    """At a mass ratio of 1e10 the compiled recursion is off; the motion goes on with the certified one, and says so."""
    scene, rng = mechanisms.chain([1.0] * 9 + [1e10]), np.random.default_rng(2)
    for joint in scene.joints:
        scene.start(joint, rng.uniform(-1, 1), rng.uniform(-1, 1))
    fast = gauss.simulate(scene, 0.01, integrator=integrator, **options)
    slow = gauss.simulate(scene, 0.01, integrator=integrator, backend="recursion", **options)
    assert fast.stats.handed_over is not None
    assert np.abs(fast.q[-1] - slow.q[-1]).max() <= 1e-9
