"""Held inputs: motions under a control law against motions from sample to sample with drives of constant effort."""

import pickle

import numpy as np
import pytest

import gauss
from gauss.errors import SimulationError
from gauss.scene import Input
from gauss.scene.toml import from_tables, tables, write_toml

ROUNDING = 1e-11  # of states over a few tenths of a second; adaptive steps restart at other lengths
FORMULA = 1e-3  # of central differences over steps of 1 ms
LIMITS = (-4.0, 3.0)
RATE, DURATION = 20.0, 0.3
MOTIONS = [
    ("cart_pole", "rail", {}),
    ("cart_pole", "rail", {"integrator": "rk4", "step": 2e-3}),
    ("cart_pole", "rail", {"integrator": "radau5", "rtol": 1e-10}),
    ("four_bar", "A", {}),
    ("four_bar", "A", {"integrator": "rk4", "step": 1e-3}),
    ("friction_oscillator", "rail", {"integrator": "time_stepping", "step": 2e-3}),
]


def law(t, q, v):
    return 5.0 * np.sin(9.0 * t) - 0.5 * q[0]


def with_input(model: str, joint: str) -> gauss.Scene:
    scene = gauss.load(model)
    scene.input("u", joint, limits=LIMITS)
    return scene


def from_sample_to_sample(model: str, joint: str, duration: float = DURATION, **options) -> np.ndarray:
    """End (q, v) of a motion with a drive whose constant effort changes at the samples."""
    scene, now = gauss.load(model), [0.0]
    scene.drive(joint, torque=lambda t: now[0])
    system = gauss.compile_scene(scene)
    state = system.initial_state()
    for k in range(1, round(duration * RATE) + 1):
        now[0] = float(np.clip(law(state.t, state.q, state.v), *LIMITS))
        state = gauss.simulate(system, k / RATE - state.t, state=state, progress=False, **options).state(-1)
    return np.concatenate([state.q, state.v])


@pytest.mark.slow
@pytest.mark.parametrize("model, joint, options", MOTIONS)
def test_a_held_input_is_a_constant_drive_from_sample_to_sample(model, joint, options):
    scene = with_input(model, joint)
    motion = gauss.simulate(scene, DURATION, control=law, rate=RATE, **options)
    expected = from_sample_to_sample(model, joint, **{k: v for k, v in options.items() if options.get("rtol") is None})
    assert np.abs(np.concatenate([motion.q[-1], motion.v[-1]]) - expected).max() <= max(
        ROUNDING, 100 * options.get("rtol", 0)
    )
    table = [law(motion.t[np.searchsorted(motion.t, k / RATE)], *at(motion, k / RATE)) for k in range(6)]
    again = gauss.simulate(scene, DURATION, control=table, rate=RATE, **options)
    assert np.abs(again.q[-1] - motion.q[-1]).max() <= ROUNDING


@pytest.mark.slow
def test_between_events_each_sample_begins_a_motion_of_its_own():
    motion = gauss.simulate(with_input("friction_oscillator", "rail"), 0.1, control=law, rate=RATE)
    expected = from_sample_to_sample("friction_oscillator", "rail", 0.1)
    assert motion.stats.plan.driver == "samples"
    assert np.abs(np.concatenate([motion.q[-1], motion.v[-1]]) - expected).max() <= ROUNDING


def at(motion, t: float):
    k = int(np.argmin(np.abs(motion.t - t)))
    return motion.q[k], motion.v[k]


def test_the_work_of_an_input_is_that_of_its_effort():
    scene = with_input("cart_pole", "rail")
    motion = gauss.simulate(scene, DURATION, control=lambda t, q, v: 100.0, rate=RATE)
    assert motion.work[-1, 0] == pytest.approx(LIMITS[1] * (motion.q[-1, 0] - motion.q[0, 0]), rel=ROUNDING)


def test_the_trajectory_knows_its_inputs():
    motion = gauss.simulate(with_input("cart_pole", "rail"), DURATION, control=law, rate=RATE, times=[0.0, 0.12, 0.3])
    copy = pickle.loads(pickle.dumps(motion))
    for one in (motion, copy):
        effort = one.system.scene.loads["u"].effort
        assert effort(0.12) == pytest.approx(np.clip(effort.law(0.1), *LIMITS), rel=ROUNDING)
    balance = gauss.energy(motion)
    assert np.abs(np.diff(balance.balance)).max() <= ROUNDING * 100


@pytest.mark.slow
def test_a_law_is_called_once_for_each_sample_and_may_keep_a_state():
    seen = []

    def counting(t, q, v):
        seen.append(t)
        return float(len(seen))

    gauss.simulate(with_input("cart_pole", "rail"), DURATION, control=counting, rate=RATE, verify=True)
    np.testing.assert_allclose(seen, np.arange(6) / RATE, rtol=0.0, atol=ROUNDING)


def test_without_a_law_inputs_are_zero():
    free = gauss.simulate(gauss.load("cart_pole"), DURATION)
    assert np.array_equal(gauss.simulate(with_input("cart_pole", "rail"), DURATION).q, free.q)


@pytest.mark.parametrize(
    "arguments, message",
    [
        ({"control": lambda t, q, v: np.nan, "rate": 20}, "input 'u' is nan"),
        ({"control": lambda t, q, v: (1.0, 2.0), "rate": 20}, "expected 1 number"),
        ({"control": lambda t: 1.0, "rate": 20}, "law"),
        ({"control": np.zeros((2, 1)), "rate": 20}, "6 samples"),
        ({"control": law}, "rate"),
        ({"control": law, "rate": -1.0}, "rate"),
        ({"rate": 20}, "control"),
        ({"control": lambda t, q, v: 1 / 0, "rate": 20}, "t = 0 s the law raised ZeroDivisionError"),
        ({"control": law, "rate": 1e12}, "rate: 1e.12 Hz are .* samples"),
    ],
)
def test_invalid_inputs_are_refused(arguments, message):
    with pytest.raises(SimulationError, match=message):
        gauss.simulate(with_input("cart_pole", "rail"), DURATION, **arguments)


def test_a_value_that_is_not_finite_names_input_and_time_and_keeps_the_motion():
    with pytest.raises(SimulationError, match="t = 0.1 s: input 'u' is nan") as caught:
        gauss.simulate(with_input("cart_pole", "rail"), 0.3, control=lambda t, q, v: np.nan if t > 0.09 else 0.0, rate=20)
    assert caught.value.trajectory.t[-1] == pytest.approx(0.1)


def test_inputs_and_outputs_are_kept_in_a_file(tmp_path):
    scene = with_input("cart_pole", "rail")
    scene.output("angle", "coordinate", "pin")
    scene.output("tip", "accelerometer", "pole", at=(0.0, 0.0, 1.0))
    again = from_tables(tables(write_toml(scene, tmp_path / "scene.toml")))
    assert (again.inputs, again.outputs) == (scene.inputs, scene.outputs)


@pytest.mark.slow
def test_outputs_are_derivatives_of_each_other():
    scene = gauss.load("double_pendulum")
    scene.input("u", "B")
    point = (0.3, 0.1, 0.2)
    for kind in ("position", "velocity", "acceleration", "accelerometer"):
        scene.output(kind, kind, "lower", at=point)
    scene.output("axes", "rotation", "lower")
    motion = gauss.simulate(scene, 0.1, control=lambda t, q, v: 1.0, rate=1, times=np.linspace(0.0, 0.1, 101))
    x, v, a = (motion.output(kind) for kind in ("position", "velocity", "acceleration"))
    for one, rate in ((x, v), (v, a)):
        slope = (one[2:] - one[:-2]) / (motion.t[2:] - motion.t[:-2])[:, None]
        assert np.abs(slope - rate[1:-1]).max() <= FORMULA * np.abs(rate).max()
    felt = np.einsum("kji,kj->ki", motion.output("axes"), a - np.array(scene.gravity))
    np.testing.assert_allclose(motion.output("accelerometer"), felt, rtol=0.0, atol=ROUNDING)


@pytest.mark.slow  # two motions are compiled
@pytest.mark.parametrize("integrator", ["dop853", "rk4"])
def test_the_effort_of_an_input_may_change_from_one_motion_to_the_next(integrator):
    """A motion of a system compiled before is that of the scene compiled anew."""
    gain = np.array([1.0])
    scene = gauss.load("pendulum")
    scene.add(Input("motor", next(iter(scene.joints)), effort=lambda u, t, motion: u * gain[0]))
    options = {"integrator": integrator, "control": lambda t, q, v: [1.0], "rate": 100.0, "progress": False}
    options |= {"step": 1e-3} if integrator == "rk4" else {}
    system, ends = gauss.compile_scene(scene), []
    for gain[0] in (1.0, 20.0):
        ends.append(gauss.simulate(system, 0.1, **options).q[-1])
    assert np.array_equal(ends[1], gauss.simulate(scene, 0.1, **options).q[-1])
    assert not np.array_equal(*ends)
