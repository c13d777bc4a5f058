"""Time stepping in machine code against the same in Python, and what it is made of against numpy."""

import ctypes
import warnings

import numpy as np
import pytest

import gauss
from gauss.codegen import Writer, machine
from gauss.codegen.kernels import Due
from gauss.codegen.kernels.small_linear_systems import space, write_equations
from gauss.dynamics.laws.switching import switching
from gauss.dynamics.laws.traced_laws import Laws
from gauss.errors import PainleveWarning, SimulationError
from gauss.simulation.grid import contact_grid
from gauss.simulation.moreau.moreau_jean import MoreauRun

SAME = 1e-7  # of the largest coordinate or rate: forces are found to 1e-10 times 1 + the largest rate, step by step
SIZES = ctypes.c_int64, *[ctypes.c_void_p] * 3


def _pulled_box(corners):
    scene = gauss.load(f"box_on_plane_{corners}")
    scene.loads.clear()
    scene.force("pull", "box", force=(10.0, 0, 0), at=(0, 0, 0.2))
    return scene


def _bouncing_ball():
    scene = gauss.load("rolling_ball")
    scene.contacts.clear()
    scene.contact("C", "round", "table", restitution=0.6, friction=0.3)
    scene.start("ball moves", position=(0, 0, 0.05, 1, 0, 0, 0), rate=(1.0, 0.2, -1.0, 0, 3.0, 0))
    return scene


def _stopped_four_bar():
    scene = gauss.load("four_bar")
    joint = next(iter(scene.joints))
    scene.stop(joint, highest=float(gauss.compile_scene(scene).initial_state().q[0]) + 0.3, restitution=0.5)
    scene.joint_friction(joint, 0.2)
    return scene


def _tripod():
    scene = gauss.Scene("tripod", gravity=(1.0, 0.5, -9.81))
    scene.body("top", 1.3, (0.02, 0.03, 0.04), com=(0.02, -0.01, 0.1))
    scene.free("F", "ground", "top")
    scene.points("feet", "top", [(0.2, 0, 0), (-0.1, 0.15, 0), (-0.1, -0.17, 0)])
    scene.half_space("floor")
    scene.contact("C", "feet", "floor", friction=0.4)
    scene.start("F", rate=(0.3, -0.2, 0.0, 0.0, 0.0, 1.5))
    return scene


CASES = {
    "block": (lambda: gauss.load("block_on_incline"), 5e-3, 0.8),
    "box": (lambda: _pulled_box(8), 5e-3, 0.3),
    "ball": (_bouncing_ball, 4e-3, 0.5),
    "tripod": (_tripod, 2e-3, 0.3),
    "stops": (lambda: gauss.load("double_pendulum_stops"), 2e-3, 0.5),
    "oscillator": (lambda: gauss.load("friction_oscillator"), 5e-3, 1.0),
    "four-bar": (_stopped_four_bar, 2e-3, 0.3),
    "cradle": (lambda: gauss.load("newtons_cradle"), 2e-3, 0.7),
}


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_machine_code_and_python_take_the_same_steps(case):
    make, h, end = CASES[case]
    system = gauss.compile_scene(make())
    times = np.array([0.5 * end + 0.3 * h, end])  # one beside the grid
    fast = gauss.simulate(system, end, integrator="time_stepping", step=h, times=times, progress=False)
    slow = MoreauRun(system, "auto", h, end).collect(system.initial_state(), times, False)
    assert fast.stats.plan.dynamics == ("pair kernels" if case == "cradle" else "compiled")
    assert fast.t == pytest.approx(slow.t, abs=0)
    assert fast.stats.steps == slow.stats.steps
    for name in ("q", "v", "work"):
        one, other = getattr(fast, name), getattr(slow, name)
        assert one == pytest.approx(other, abs=SAME * (1.0 + np.abs(other).max()))


def test_steps_that_have_to_be_looked_at_are_taken_by_python():
    """Painlevé's rod: the first step has no accelerations, and warns; all others are machine code again."""
    system = gauss.compile_scene(gauss.load("painleve_rod"))
    with pytest.warns(PainleveWarning, match="'C'"):
        fast = gauss.simulate(system, 0.05, integrator="time_stepping", step=5e-3, progress=False)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PainleveWarning)
        slow = MoreauRun(system, "auto", 5e-3, 0.05).collect(system.initial_state(), None, False)
    assert fast.t == pytest.approx(slow.t, abs=0)
    assert fast.q == pytest.approx(slow.q, abs=SAME)
    assert fast.v == pytest.approx(slow.v, abs=SAME)


@pytest.mark.slow
def test_laws_that_are_python_functions_are_called():
    """A force that cannot be traced: machine code calls it, with the same motion as with one that can."""
    ends = []
    for law in (lambda t: [3.0 * t, 0.0, 0.0], lambda t: [3.0 * float(t), 0.0, 0.0]):
        scene = _bouncing_ball()
        scene.force("wind", "ball", force=law)
        found = gauss.simulate(scene, 0.1, integrator="time_stepping", step=4e-3, progress=False)
        ends.append((found.q[-1], found.stats.plan.dynamics))
    assert [dynamics for _, dynamics in ends] == ["compiled", "callbacks"]
    assert ends[0][0] == pytest.approx(ends[1][0], abs=SAME)


def test_a_step_that_has_no_answer_keeps_the_motion_so_far(monkeypatch):
    """Whatever Python cannot do either is an error that says when, with all samples before."""
    from gauss.dynamics.contact.moreau_step import MoreauStepper

    def fails(*arguments, **named):
        raise SimulationError("no forces of contacts were found.")

    monkeypatch.setattr(MoreauStepper, "step", fails)
    with pytest.raises(SimulationError, match="no forces") as caught:
        gauss.simulate(gauss.load("painleve_rod"), 0.05, integrator="time_stepping", step=5e-3, progress=False)
    assert caught.value.trajectory.t == pytest.approx([0.0])


@pytest.mark.parametrize("rank", [1, 4, 7])
def test_small_equations_are_solved_as_numpy_does(rank):
    """Of full rank by elimination, else the shortest of the nearest answers."""
    writer, n, rng = Writer(), 7, np.random.default_rng(rank)
    inner = write_equations(writer.module)
    inner.linkage = ""
    code = machine.load(str(writer.module))
    solve = ctypes.CFUNCTYPE(None, *SIZES)(code.address("equations"))
    for _ in range(20):
        A = rng.standard_normal((n, rank)) @ rng.standard_normal((rank, n))
        b = rng.standard_normal(n)
        matrix, x, room = A.T.copy(), b.copy(), np.empty(space(n))
        solve(n, matrix.ctypes.data, x.ctypes.data, room.ctypes.data)
        expected = np.linalg.lstsq(A, b, rcond=None)[0]
        assert x == pytest.approx(expected, abs=1e-9 * np.linalg.cond(A[:rank, :rank]) * np.abs(expected).max())


@pytest.mark.slow
def test_steps_without_impacts_are_of_second_order():
    """A double pendulum swings freely, its stop is far away: half the step, a quarter of the error."""
    scene, errors = gauss.load("double_pendulum"), []
    exact = gauss.simulate(scene, 0.5, rtol=1e-10, times=[0.5], progress=False)
    scene.stop(next(iter(scene.joints)), highest=50.0)
    system = gauss.compile_scene(scene)
    for h in (4e-3, 2e-3):
        found = gauss.simulate(system, 0.5, integrator="time_stepping", step=h, times=[0.5], progress=False)
        errors.append(np.abs(found.q - exact.q).max())
    assert errors[1] < 0.3 * errors[0]
    assert errors[0] < 1e-4


@pytest.mark.slow
def test_a_box_that_is_pulled_moves_as_in_its_closed_form():
    """Constant forces, closed gaps: every step is exact but for rounding."""
    found = gauss.simulate(_pulled_box(4), 0.5, integrator="time_stepping", step=1e-2, times=[0.5], progress=False)
    assert found.q[-1, 0] == pytest.approx(2.5 * 0.25, abs=1e-12)  # 10 N, 2 kg
    assert np.abs(found.q[-1, 1:3] - found.system.start().q[1:3]).max() < 1e-12


@pytest.mark.slow
@pytest.mark.parametrize(("restitution", "h"), [(0.0, 5e-3), (0.5, 1e-3), (0.8, 5e-3)])
def test_a_box_that_is_dropped_on_its_edge_comes_to_rest(restitution, h):
    """It bounces and rocks from corner to corner, ever less; steps add no energy of their own."""
    scene = gauss.Scene("dropped", gravity=(0, 0, -9.81))
    scene.body("box", 2.0, (0.03, 0.03, 0.05))
    scene.free("F", "ground", "box")
    scene.box("sides", "box", (0.4, 0.4, 0.2))
    scene.half_space("floor")
    scene.contact("C", "sides", "floor", friction=0.5, restitution=restitution)
    turned = np.cos(0.2), 0.8 * np.sin(0.2), 0.6 * np.sin(0.2), 0.0
    scene.start("F", position=(0, 0, 0.5, *turned), rate=(1.0, 0.3, 0, 0.5, -1.0, 2.0))
    found = gauss.simulate(scene, 3.0, integrator="time_stepping", step=h, times=[3.0], progress=False)
    assert np.abs(found.v[-1]).max() < 1e-6
    assert found.q[-1, 2] == pytest.approx(0.1, abs=1e-6)


BREAKS = {  # of a motion of 1 s: at and beside the ends of steps, beside each other, when the block stands
    "long step": (0.25, [0.31291024308838983]),
    "close": (0.02, [0.301, 0.302, 0.3022, 0.31291024308838983]),
    "beside ends of steps": (0.02, [0.1, 0.2 + 1e-13, 0.3 - 1e-13]),
    "beside each other": (0.02, [0.31, 0.31 + 1e-9, 0.31 + 2e-15]),
}


@pytest.mark.slow
@pytest.mark.parametrize("times", [None, [0.3, 1.0]], ids=["steps", "samples"])
@pytest.mark.parametrize("name", BREAKS)
def test_steps_that_end_at_breaks_leave_a_block_on_its_plane(name, times):
    """However short what is left of a step: rounding of a gap over it is no velocity."""
    step, breaks = BREAKS[name]
    scene = gauss.load("block_on_incline")
    found = gauss.simulate(scene, 1.0, integrator="time_stepping", step=step, breaks=breaks, times=times, progress=False)
    assert np.abs(found.q[:, 1:3]).max() <= 1e-9  # it slides along the line of fall [m]
    assert np.abs(found.v[-1, 1:]).max() <= 1e-9
    assert (np.diff(found.t) > 0).all()


@pytest.mark.parametrize("begin", [0.4003, 0.4004, 0.4006, 0.4009])
@pytest.mark.parametrize("samples", [None, np.array([0.1, 0.40071, 0.5])], ids=["steps", "samples"])
def test_steps_beside_switching_times_are_no_longer_than_asked(begin, samples):
    """A ramp of 1.4 ms is one step of 2 ms, and two of 1 ms: half the steps have another mesh there, and see the error."""
    scene = gauss.load("slider_crank")
    scene.drive(next(iter(scene.joints)), torque=lambda t: 0.1 * gauss.math.clip((t - begin) / 1.4e-3, 0.0, 1.0))
    system = gauss.compile_scene(scene)
    times = switching(system, Laws(system), system.initial_state(), 0.5)
    for step in (2e-3, 1e-3):
        pairs = contact_grid(0.0, 0.5, step, samples, times)
        t = pairs[pairs[:, 1] != Due.OFF_GRID_SAMPLE, 0]
        assert np.diff(t, prepend=0.0).max() <= step * (1.0 + 1e-9) and (np.diff(pairs[:, 0]) > 0.0).all()
        assert all(np.abs(t - end).min() < 1e-9 for end in (begin, begin + 1.4e-3))
