"""Equilibria and linear models of scenes with laws of time: the time is named, or a warning names the laws."""

import warnings

import numpy as np
import pytest

import gauss
from gauss.errors import ArgumentError, SimulationError, TimeDependenceWarning

SAME = 1e-9  # relative: laws of time, and constants of the same value, take other paths of Newton's method
QUESTIONS = {
    "equilibrium": lambda scene, **t: gauss.equilibrium(scene, **t).state.q,
    "equilibria": lambda scene, **t: gauss.equilibria(scene, starts=3, **t)[0].state.q,
    "linearise": lambda scene, **t: gauss.linearise(scene, **t).A,
}


def torque(t):
    return 2.0 * gauss.math.sin(3.0 * t + 1.0)


def arm(law) -> gauss.Scene:
    """Pendulum with a torque and a torsional spring."""
    scene = gauss.Scene("arm")
    scene.body("arm", 1.0, (0.1, 0.1, 0.1), com=(0.5, 0.0, 0.0))
    scene.revolute("pin", "ground", "arm", axis=(0.0, 1.0, 0.0))
    scene.drive("pin", torque=law)
    return scene


def state_dependent(law):
    """A law of time and state: its slope counts in the linear model."""
    return lambda t, motion: law(t) * gauss.math.cos(motion.coordinate("pin"))


@pytest.mark.slow
@pytest.mark.parametrize("ask", QUESTIONS.values(), ids=QUESTIONS)
def test_values_are_those_of_the_named_time(ask):
    for t in (0.0, 0.7):
        value = torque(t)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            timed = ask(arm(state_dependent(torque)), t=t)
            constant = ask(arm(state_dependent(lambda _, value=value: value)))
        assert np.allclose(timed, constant, rtol=SAME, atol=SAME)


@pytest.mark.slow
@pytest.mark.parametrize("ask", QUESTIONS.values(), ids=QUESTIONS)
def test_a_time_that_is_not_named_is_warned_of_on_every_call(ask):
    scene = arm(torque)
    for _ in range(2):
        with pytest.warns(TimeDependenceWarning, match="drive of pin"):
            ask(scene)


def test_a_given_state_names_the_time():
    system = gauss.compile_scene(arm(torque))
    state = system.initial_state(t=0.7)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = gauss.equilibrium(system, state).state
        gauss.linearise(system, state)
    assert found.t == 0.7
    for function in (gauss.equilibrium, gauss.linearise):
        with pytest.raises(ArgumentError, match="time of its own"):
            function(system, state, t=0.3)
        with pytest.raises(ArgumentError, match="expected a time"):
            function(system, t=float("nan"))


def double(**law) -> gauss.Scene:
    """Pendulum that hangs from an arm with a prescribed motion."""
    scene = arm(0.0)
    scene.body("bob", 1.0, (0.1, 0.1, 0.1), com=(0.5, 0.0, 0.0))
    scene.revolute("hook", "arm", "bob", at=(1.0, 0.0, 0.0), axis=(0.0, 1.0, 0.0))
    scene.drive("pin", **law, name="motor")
    return scene


@pytest.mark.slow
def test_what_is_moved_does_not_rest():
    with pytest.raises(SimulationError, match="motor"):
        gauss.equilibrium(double(speed=1.0))
    swings = double(angle=lambda t: 0.3 + 0.1 * t**4)
    with pytest.warns(TimeDependenceWarning, match="motor"):
        resting = gauss.equilibrium(swings).state
    assert abs(resting.q[0] - 0.3) <= SAME
    with pytest.raises(SimulationError, match="pin"):
        gauss.equilibrium(swings, t=1.0)
