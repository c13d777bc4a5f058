"""The simulator: its steps are those of simulate, bit for bit; snapshots, outputs, refusals."""

import ctypes
import warnings
from functools import partial

import numpy as np
import pytest

import gauss
from gauss.errors import SimulationError, SwitchingWarning

STEP = 1e-3
ROUNDING = 1e-9  # of accelerations by two routes
VALUES = np.sin(np.arange(5.0))
MOTIONS = [
    ("cart_pole", "rail", None),
    ("cart_pole", "rail", "generalised_alpha"),
    ("four_bar", "A", None),
    ("friction_oscillator", "rail", None),
]


def simulator(model: str, joint: str, integrator: str | None) -> gauss.Simulator:
    scene = gauss.load(model)
    scene.input("u", joint, limits=0.7)
    scene.output("felt", "accelerometer", list(scene.bodies)[-1])
    scene.output("rate", "rate", joint)
    return gauss.Simulator(scene, STEP, integrator)


@pytest.mark.slow
@pytest.mark.parametrize("model, joint, integrator", MOTIONS)
def test_steps_are_those_of_simulate(model, joint, integrator):
    sim = simulator(model, joint, integrator)
    for u in VALUES:
        sim.step([u], n=10)
    integrator = integrator or ("time_stepping" if sim.system.scene.nonsmooth else "rk4")
    motion = gauss.simulate(sim.system, 0.05, control=VALUES, rate=100.0, integrator=integrator, step=STEP)
    assert sim.t == motion.t[-1]
    for one, other in ((sim.state.q, motion.q[-1]), (sim.state.v, motion.v[-1]), (sim.work, motion.work[-1])):
        np.testing.assert_array_equal(one, other)


@pytest.mark.slow
@pytest.mark.parametrize("model, joint, integrator", MOTIONS)
def test_a_restored_simulator_continues_bit_for_bit(model, joint, integrator):
    sim = simulator(model, joint, integrator)
    sim.reset(seed=5)
    sim.step([0.3], n=7)
    kept = sim.snapshot()
    ends = []
    for _ in range(2):
        for u in VALUES:
            sim.step([u])
        ends.append((sim.t, *sim.state.q, *sim.state.v, *sim.output_vector()))
        sim.restore(kept)
    assert ends[0] == ends[1]


def test_snapshots_of_other_steps_or_methods_are_refused():
    scene = gauss.load("cart_pole")
    kept = gauss.Simulator(scene, STEP).snapshot()
    for other in (gauss.Simulator(scene, 2 * STEP), gauss.Simulator(scene, STEP, "semi_implicit_euler")):
        other.step(n=3)
        before = other.snapshot()
        with pytest.raises(SimulationError, match="of another system, step or method"):
            other.restore(kept)
        assert other.snapshot() == before


@pytest.mark.parametrize("n", [1, 40])
@pytest.mark.parametrize("size", [1e6, 1e12])
def test_motions_that_diverge_end_with_an_error_in_the_state_before_the_call(n, size):
    scene = gauss.load("double_pendulum")
    scene.input("u", "A"), scene.input("w", "B")
    sim = gauss.Simulator(scene, 10 * STEP)
    with np.errstate(all="ignore"), pytest.raises(SimulationError, match="not finite|not confirm"):
        for k in range(40):
            before = sim.state
            sim.step([(-1) ** k * size, size], n)
    assert sim.t == before.t and np.array_equal(sim.state.q, before.q) and np.isfinite(sim.state.v).all()
    sim.reset()
    sim.step([0.0, 0.0], n)
    assert np.isfinite(sim.state.q).all() and sim.t == pytest.approx(n * 10 * STEP)


@pytest.mark.slow
def test_many_steps_in_one_call_are_single_steps():
    one, many = (simulator("cart_pole", "rail", None) for _ in range(2))
    one.step([0.5])
    for _ in range(19):
        one.step()
    many.step([0.5], n=20)
    np.testing.assert_array_equal(one.state.q, many.state.q)


def test_outputs_are_those_of_the_accelerations():
    sim = simulator("cart_pole", "rail", None)
    sim.step([0.5], n=20)
    felt, state = sim.outputs["felt"], sim.state
    motion = gauss.simulate(sim.system, STEP, state=state, control=lambda t, q, v: 0.5, rate=1.0)
    np.testing.assert_allclose(felt, motion.output("felt")[0], rtol=0.0, atol=ROUNDING)
    assert sim.outputs["rate"] == state.v[0]


def test_the_seed_decides_the_start():
    sim = simulator("four_bar", "A", None)
    starts = [sim.reset(seed=seed).q for seed in (1, 2, 1)]
    assert np.array_equal(starts[0], starts[2]) and not np.array_equal(starts[0], starts[1])
    phi, *_ = sim.system.loop_constraints(starts[0], np.zeros(sim.system.n_v))
    assert np.abs(phi).max() <= ROUNDING


@pytest.mark.slow
@pytest.mark.parametrize(
    "u", [[np.nan], [np.inf], [1.0, 2.0], [], "x", None, [[1.0], [2.0]], np.ma.masked_array([1.0], [True])]
)
def test_refused_inputs_change_nothing(u):
    sim, other = simulator("cart_pole", "rail", None), simulator("cart_pole", "rail", None)
    sim.step([1.0]), other.step([1.0])
    with pytest.raises(SimulationError):
        sim.step([u] if u is None else u)
    sim.step(), other.step()
    assert np.array_equal(sim.state.q, other.state.q)


UNALIGNED = np.frombuffer(b"\0" + np.array([1.0]).tobytes(), dtype=float, offset=1)
FROM_CTYPES = np.ctypeslib.as_array((ctypes.c_double * 1)(1.0))


@pytest.mark.parametrize("u", [1.0, (1,), [True], UNALIGNED, FROM_CTYPES, np.array([1.0], dtype=">f8"), np.ones(3)[::-3]])
def test_inputs_are_numbers_of_any_kind(u):
    sim, other = simulator("cart_pole", "rail", None), simulator("cart_pole", "rail", None)
    sim.step(u), other.step([1.0])
    assert np.array_equal(sim.state.v, other.state.v)


def test_inputs_that_a_scene_does_not_declare_are_refused():
    sim = gauss.Simulator(gauss.load("pendulum"), STEP)
    with pytest.raises(SimulationError, match="declares none"):
        sim.step([1.0])


@pytest.mark.parametrize("step, n", [(0.0, 1), (np.nan, 1), ("1", 1), (STEP, 0), (STEP, 1.5)])
def test_steps_are_positive(step, n):
    with pytest.raises(SimulationError, match="positive"):
        gauss.Simulator(gauss.load("pendulum"), step).step(n=n)


def test_a_refused_number_of_steps_leaves_the_inputs():
    scene = gauss.load("pendulum")
    scene.input("push", "A")
    sim = gauss.Simulator(scene, STEP)
    before = sim.snapshot()
    with pytest.raises(SimulationError, match="positive"):
        sim.step([1.0], n=0)
    assert sim.snapshot() == before


def test_scenes_without_a_compiled_step_are_refused():
    with pytest.raises(SimulationError, match="does not locate the events"):
        gauss.Simulator(gauss.load("friction_oscillator"), STEP, "rk4")
    with pytest.raises(SimulationError, match="fixed ones"):
        gauss.Simulator(gauss.load("cart_pole"), STEP, "dop853")


def _pushed(law):
    scene = gauss.Scene("cart", gravity=(0, 0, 0))
    scene.body("b", 1.0)
    scene.prismatic("x", "ground", "b", axis=(1, 0, 0))
    scene.drive("x", force=law)
    return scene


SHORT = {
    "pulse": lambda t: 10.0 if 5 <= t < 5.01 else 0.0,
    "bell": lambda t: gauss.math.exp(-(((t - 5) / 1e-3) ** 2)),
}
LASTING = {
    "sine": lambda t: gauss.math.sin(20.0 * t),
    "move": gauss.scene.profiles.Move(0.0, 1.0, 1.0, 2.0),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", SHORT)
def test_features_of_laws_that_are_shorter_than_the_steps_are_warned_of(name):
    for make in (gauss.Simulator, partial(gauss.SimulatorBatch, batch=2)):
        for _ in range(2):
            with pytest.warns(SwitchingWarning, match="'cart': steps of 0.03 s pass over a feature of a law of time"):
                make(_pushed(SHORT[name]), step=0.03)


JUMPING = {  # prescribed motions that jump at 100 s [m/s], [m]
    "speed": lambda t: gauss.math.where(t < 100.0, 0.5, 0.0),
    "displacement": lambda t: gauss.math.where(t < 100.0, 0.0, 1.0),
    "a kink": lambda t: abs(t - 100.0),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", JUMPING)
def test_prescribed_motions_that_jump_are_refused(name):
    scene = _pushed(0.0)
    scene.drive("x", **{"speed" if name == "speed" else "displacement": JUMPING[name]})
    for make in (gauss.Simulator, partial(gauss.SimulatorBatch, batch=2)):
        with pytest.raises(SimulationError, match="jump.* at t = 100 s"):
            make(scene, step=0.03)


@pytest.mark.parametrize("name", LASTING)
def test_laws_that_the_steps_resolve_are_not_warned_of(name):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        gauss.Simulator(_pushed(LASTING[name]), step=0.03)


NARROW = {  # a force from x = 1 m to a place [m], start [m] and speed [m/s], and whether steps of 0.03 s may pass over it
    "narrow": (1.001, 0.5, 3.0, True),
    "wide": (2.0, 0.95, 0.2, False),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", NARROW)
def test_a_place_that_a_step_passes_over_is_warned_of_once_for_each_motion(name):
    far, begin, speed, told = NARROW[name]
    inside = lambda x: gauss.math.where((x > 1.0) & (x < far), 1.0, 0.0)  # noqa: E731
    scene = _pushed(lambda t, motion: inside(motion.coordinate("x")))
    scene.start("x", begin, speed)
    for sim in (gauss.Simulator(scene, step=0.03), gauss.SimulatorBatch(scene, step=0.03, batch=3)):
        for _ in range(2):
            with warnings.catch_warnings(record=True) as caught:
                warnings.simplefilter("always")
                for _ in range(20):
                    sim.step()
            assert [one.category for one in caught] == [SwitchingWarning] * told
            sim.reset()


def test_a_scene_in_which_nothing_moves_has_no_steps():
    scene = gauss.Scene("still")
    scene.body("b", 1.0, (1, 1, 1))
    scene.joint("weld", "fixed", "ground", "b")
    with pytest.raises(SimulationError, match="nothing in it can move"):
        gauss.Simulator(scene, step=0.1)
