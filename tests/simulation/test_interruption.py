"""Ctrl-C: no error of gauss, so that nobody swallows it by accident; what was simulated until then is not lost."""

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

import gauss
from gauss import rotors, servo
from gauss.interruption import Interruptible

WORKING = 0.5  # seconds after which it is interrupted
SOON = 5.0  # seconds within which it must be over, on a machine with much else to do
LONG = 1e4  # seconds of motion that take far longer than that


class Pressed:
    """Presses Ctrl-C once, some time after it is entered."""

    def __enter__(self):
        self.timer = threading.Timer(WORKING, os.kill, (os.getpid(), signal.SIGINT))
        self.timer.start()
        self.began = time.perf_counter()

    def __exit__(self, *_):
        self.timer.cancel()


def _interrupted(make):
    """What an interrupted call raised."""
    with pytest.raises(KeyboardInterrupt) as caught, Pressed():
        try:
            make()
        except gauss.GaussError:
            pytest.fail("it was taken for an error of gauss")
    return caught.value


def _scene(name: str, **options):
    return gauss.compile_scene(gauss.load(name, **options))


def _called_law():
    """Pendulum under a law of the state that cannot be traced: machine code calls it."""
    scene = gauss.load("pendulum")
    scene.drive(next(iter(scene.joints)), torque=lambda t, at: -0.01 * float(at.state.v[0]))
    return gauss.compile_scene(scene)


SIMULATED = {
    "compiled": (lambda: _scene("double_pendulum"), {}),
    "compiled, loops": (lambda: _scene("four_bar"), {}),
    "compiled, samples": (lambda: _scene("double_pendulum"), {"times": np.arange(0.0, LONG, 0.1)}),
    "fixed step": (lambda: _scene("four_bar"), {"integrator": "gauss6", "step": 1e-2}),
    "taylor": (lambda: _scene("double_pendulum"), {"integrator": "taylor", "step": 1e-4}),
    "implicit": (lambda: _scene("pendulum"), {"integrator": "radau5", "rtol": 1e-8}),
    "callbacks": (_called_law, {}),
    "callbacks, fixed step": (_called_law, {"integrator": "rk4", "step": 1e-1}),
    "Python": (_called_law, {"integrator": "radau5", "rtol": 1e-8}),
    "certified": (lambda: _scene("double_pendulum"), {"backend": "recursion"}),
    "SciPy": (lambda: _scene("double_pendulum"), {"integrator": "scipy_dop853", "rtol": 1e-8}),
    "CVODE": (lambda: _scene("double_pendulum"), {"integrator": "cvode_adams", "rtol": 1e-8}),
    "IDA": (lambda: _scene("double_pendulum"), {"integrator": "ida", "rtol": 1e-8}),
    "time stepping": (lambda: _scene("box_on_plane_4"), {"integrator": "time_stepping", "step": 1e-2}),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", SIMULATED)
def test_a_motion_is_kept_as_far_as_it_came(name):
    make, options = SIMULATED[name]
    system = make()
    short = {key: value for key, value in options.items() if key != "times"}
    gauss.simulate(system, 0.002, progress=False, **short)  # machine code is there
    began = time.perf_counter()
    error = _interrupted(lambda: gauss.simulate(system, LONG, progress=False, **options))
    assert time.perf_counter() - began < SOON + WORKING
    found = error.trajectory
    assert 1 < len(found) and found.t[-1] < LONG
    assert (np.diff(found.t) > 0).all() and found.settings["duration"] == LONG
    times = found.t[: min(len(found), 5)] - found.t[0]
    again = gauss.simulate(system, max(times[-1], 1e-9), times=times, progress=False, **short)
    np.testing.assert_allclose(again.q, found.q[: len(times)], atol=1e-6)  # it is the beginning of that motion


@pytest.mark.slow
@pytest.mark.parametrize("samples", [None, 11])
@pytest.mark.parametrize("integrator", ["scipy_dop853", "cvode_adams", "dop853"])
def test_an_interrupted_law_keeps_the_steps_before(integrator, samples):
    scene, interrupted = gauss.load("pendulum"), True
    joint = next(iter(scene.joints))

    def law(t, motion):
        if interrupted and float(t) > 0.1 and float(motion.rate(joint)) != 0.0:  # not where it is sampled, at the start
            raise KeyboardInterrupt
        return 0.1 * float(np.sin(float(t)))

    scene.drive(joint, torque=law)
    times = None if samples is None else np.linspace(0.0, 0.2, samples)
    with pytest.raises(KeyboardInterrupt) as caught:
        gauss.simulate(scene, 0.2, integrator=integrator, rtol=1e-4, step=0.02, times=times, progress=False)
    found, interrupted = caught.value.trajectory, False
    assert 0.0 < found.t[-1] < 0.2 and np.isfinite(found.q).all()
    again = gauss.simulate(scene, 0.2, integrator=integrator, rtol=1e-4, step=0.02, times=found.t, progress=False)
    np.testing.assert_allclose(again.q, found.q, atol=1e-2)  # a hundred times the tolerance


@pytest.mark.slow
@pytest.mark.parametrize("integrator", ["scipy_dop853", "cvode_bdf", "dop853"])
def test_an_interruption_before_the_first_sample_leaves_none(integrator):
    scene = gauss.load("pendulum")
    joint = next(iter(scene.joints))

    def law(t, motion):
        if float(t) > 0.05 and float(motion.rate(joint)) != 0.0:  # not where it is sampled, at the start
            raise KeyboardInterrupt
        return 0.1

    scene.drive(joint, torque=law)
    with pytest.raises(KeyboardInterrupt) as caught:
        gauss.simulate(scene, 0.2, integrator=integrator, times=[0.1, 0.2], progress=False)
    assert caught.value.trajectory.q.shape == (0, 1)


ROLLED_OUT = {
    "fixed steps": (lambda: _scene("double_pendulum"), {"steps": 10**7, "step": 1e-3, "every": 1000}),
    "threads": (lambda: _scene("double_pendulum"), {"steps": 10**7, "step": 1e-3, "every": 1000, "threads": 2}),
    "adaptive": (lambda: _scene("double_pendulum"), {"integrator": "dop853", "times": np.arange(0.0, LONG, 1.0)}),
    "time stepping": (
        lambda: _scene("box_on_plane_4"),
        {"integrator": "time_stepping", "steps": 10**6, "step": 1e-3, "every": 10},
    ),
    "one by one": (_called_law, {"steps": 10**6, "step": 1e-2}),
}
MOTIONS = 6


@pytest.mark.slow
@pytest.mark.parametrize("name", ROLLED_OUT)
def test_a_rollout_is_kept_as_far_as_it_came(name):
    make, options = ROLLED_OUT[name]
    system = make()
    start = system.initial_state()
    given = system, np.tile(start.q, (MOTIONS, 1)), np.tile(start.v, (MOTIONS, 1))
    few = {"times": options["times"][:4]} if "times" in options else {"steps": 3 * options.get("every", 1)}
    short = gauss.rollout(*given, **options | few)
    found = _interrupted(lambda: gauss.rollout(*given, **options)).rollout
    np.testing.assert_array_equal(found.q[0, :3], short.q[0, :3])  # it is the beginning of that motion
    assert set(found.diverged) == set(found.reasons) and found.diverged
    rows = np.isfinite(found.q).all(axis=2)
    assert (rows[:, :-1] >= rows[:, 1:]).all() and rows[0].sum() > 4 and not rows[-1].all()  # nothing behind a gap
    assert len(found.trajectory(0)) == rows[0].sum()


EACH = 100  # steps of a call
STEPPED = {
    "compiled": lambda: _scene("double_pendulum"),
    "time stepping": lambda: _scene("box_on_plane_4"),
    "called": _called_law,
}


@pytest.mark.slow
@pytest.mark.parametrize("make", [gauss.Simulator, lambda scene, step: gauss.SimulatorBatch(scene, step, MOTIONS)])
@pytest.mark.parametrize("name", STEPPED)
def test_a_simulator_goes_on_after_an_interruption(name, make):
    many, other = make(STEPPED[name](), 1e-3), make(STEPPED[name](), 1e-3)
    _interrupted(lambda: [many.step(n=EACH) for _ in iter(int, 1)])
    done = round(many.t / 1e-3)
    assert done % EACH == 0  # calls are made as a whole, or not at all
    many.step(n=EACH)
    for _ in range(done // EACH + 1):
        other.step(n=EACH)
    reached = [one.state.q if isinstance(one, gauss.Simulator) else one.q for one in (many, other)]
    np.testing.assert_array_equal(*reached)


@pytest.mark.slow
def test_phases_between_events_are_kept():
    scene = gauss.Scene("ball")
    ball = scene.body("ball", mass=1.0, inertia=(0.1, 0.1, 0.1))
    scene.prismatic("z", "ground", ball, axis=(0, 0, 1))
    scene.start("z", position=1.0)
    scene.one_sided("floor", lambda at: at.position("ball")[2], restitution=1.0)
    system = gauss.compile_scene(scene)
    gauss.simulate(system, 1.0, progress=False)
    found = _interrupted(lambda: gauss.simulate(system, LONG, progress=False)).trajectory
    assert len(found) > 1 and found.t[-1] < LONG and (np.diff(found.t) >= 0).all()


@pytest.mark.slow
def test_a_servo_motion_is_kept():
    held = gauss.load("servo/crane")
    servo.simulate(held, 0.01, integrator="rk4", step=1e-2, progress=False)  # or the interrupt may come before a step
    error = _interrupted(lambda: servo.simulate(held, LONG, integrator="rk4", step=1e-2, progress=False))
    assert isinstance(error.trajectory, servo.Tracking) and 0.0 < error.trajectory.t[-1] < LONG


@pytest.mark.slow
def test_a_motion_of_rotors_is_kept():
    network = gauss.load_rotors("friction_chain")
    rotors.simulate(network, 0.001)
    found = _interrupted(lambda: rotors.simulate(network, LONG, times=np.linspace(0.0, LONG, 20_001))).trajectory
    assert isinstance(found, rotors.RotorMotion) and 0.0 < found.t[-1] < LONG


def _pressed(*_):
    raise KeyboardInterrupt


def _rotors():
    network = rotors.Network("fan")
    network.torque(network.shaft("fan", 1.0), rotors.TorqueFunction(_pressed))
    return network


def _driven():
    scene = gauss.load("pendulum")
    scene.drive(next(iter(scene.joints)), torque=_pressed)
    return scene


PREPARED = {
    "simulate": ("trajectory", lambda: gauss.simulate(_driven(), 1.0)),
    "rollout": ("rollout", lambda: gauss.rollout(gauss.compile_scene(_driven()), [[0.0]], [[0.0]], steps=2, step=0.1)),
    "sweep": ("dataset", lambda: gauss.sweep(lambda k: _driven(), {"k": [1.0, 2.0]}, 1.0)),
    "sweep of a maker": ("dataset", lambda: gauss.sweep(lambda k: _pressed(), {"k": [1.0, 2.0]}, 1.0)),
    "rotors": ("trajectory", lambda: rotors.simulate(_rotors(), 1.0)),
}


@pytest.mark.slow  # xarray is imported
@pytest.mark.parametrize("name", PREPARED)
def test_an_interruption_of_the_preparation_says_that_there_is_nothing(name):
    attribute, make = PREPARED[name]
    with pytest.raises(KeyboardInterrupt) as caught:
        make()
    found = getattr(caught.value, attribute)
    assert found is None or not len(getattr(found, "t", ()))  # a sweep has its empty dataset


def test_a_library_that_swallows_an_interruption_does_not_hide_it():
    def solver():
        try:
            signal.raise_signal(signal.SIGINT)
        except KeyboardInterrupt:
            return "failed"

    with pytest.raises(KeyboardInterrupt), Interruptible():
        assert solver() == "failed"
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    with Interruptible():
        pass


def test_before_the_first_step_there_is_nothing(monkeypatch):
    def pressed(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(sys.modules["gauss.simulation.simulate"], "_motion", pressed)
    with pytest.raises(KeyboardInterrupt) as caught:
        gauss.simulate(gauss.load("pendulum"), 1.0, progress=False)
    assert caught.value.trajectory is None


def test_what_was_done_before_the_check_of_its_error_is_kept(monkeypatch):
    def pressed(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(sys.modules["gauss.simulation.simulate"], "verified", pressed)
    with pytest.raises(KeyboardInterrupt) as caught:
        gauss.simulate(gauss.load("pendulum"), 1.0, verify=True, progress=False)
    assert caught.value.trajectory.t[-1] == 1.0


def _command(arguments, after: float, folder) -> subprocess.CompletedProcess:
    """A command that a terminal interrupts: all processes of its group hear it."""
    place = os.environ | {"PYTHONPATH": str(Path(gauss.__file__).parents[1])}
    command = [sys.executable, "-m", "gauss", *arguments]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    with subprocess.Popen(command, cwd=folder, env=place, start_new_session=True, **pipes) as ran:
        time.sleep(after)
        os.killpg(ran.pid, signal.SIGINT)
        out, said = ran.communicate(timeout=60)
    return subprocess.CompletedProcess(command, ran.returncode, out, said)


@pytest.mark.slow
def test_the_command_line_keeps_what_was_simulated(tmp_path):
    arguments = ["run", "double_pendulum", "--duration", "1000000", "--samples", "100001", "--output", "m.npz"]
    ran = _command(arguments, 8.0, tmp_path)
    assert ran.returncode == 130, ran.stderr
    assert "interrupted at t = " in ran.stderr and "Traceback" not in ran.stderr
    kept = np.load(tmp_path / "m.npz")
    assert 1 < len(kept["t"]) < 100001


@pytest.mark.slow
def test_workers_of_a_sweep_say_nothing(tmp_path):
    varied = f"{next(iter(gauss.load('double_pendulum').bodies))}.mass=1:2:4"
    arguments = ["sweep", "double_pendulum", "--vary", varied, "--duration", "1000000", "--workers", "2"]
    ran = _command(arguments, 12.0, tmp_path)
    assert ran.returncode == 130, ran.stderr
    assert "interrupted" in ran.stderr and "Traceback" not in ran.stderr
