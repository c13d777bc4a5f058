"""Laws that keep something from one call for the next: said where the motion depends on it, and only there."""

import itertools
import warnings

import numpy as np
import pytest

import gauss
from gauss.errors import SimulationError, SwitchingWarning
from tests.support.switching import slider


class Latch:
    """Changes over for good once the slider has passed a place."""

    on = False

    def __call__(self, t, motion):
        self.on = self.on or motion.coordinate("x") > 0.5
        return -1.0 if self.on else 1.0


class LatchOfTime:
    """The same at a time."""

    on = False

    def __call__(self, t):
        self.on = self.on or float(t) > 0.5
        return -1.0 if self.on else 1.0


class Sampled:
    """Controller that holds its output between its own samples."""

    def __init__(self):
        self.due, self.output = 0.0, 0.0

    def __call__(self, t, motion):
        if float(t) >= self.due:
            self.output, self.due = 1.0 - float(motion.coordinate("x")), self.due + 0.1
        return self.output


class Integral:
    """Controller that adds up what it sees."""

    total = 0.0

    def output(self, motion):
        self.total += 1.0 - float(motion.coordinate("x"))
        return 0.01 * self.total


class Log:
    """Feedback that notes when it was called."""

    def __init__(self):
        self.times = []

    def __call__(self, t, motion):
        self.times.append(float(t))
        return 1.0 - float(motion.coordinate("x"))


def summed():
    """Law whose closure holds the controller."""
    integral = Integral()
    return lambda t, motion: integral.output(motion)


REMEMBERS = {"latch": Latch, "latch of time": LatchOfTime, "sampled": Sampled, "integral": summed}
FORGETS = {"log": Log, "feedback": lambda: lambda t, motion: 1.0 - float(motion.coordinate("x"))}


def said(law) -> bool:
    """Whether a motion warns that a law depends on what it keeps."""
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        gauss.simulate(slider(law), 1.5, integrator="rk4", step=0.05, progress=False)
    return any(issubclass(one.category, SwitchingWarning) and "state=motion.state(-1)" in str(one.message) for one in heard)


@pytest.mark.slow
@pytest.mark.parametrize("name", REMEMBERS)
def test_a_law_with_a_memory_is_said_in_every_call(name):
    for _ in range(2):
        assert said(REMEMBERS[name]())


@pytest.mark.slow
@pytest.mark.parametrize("name", FORGETS)
def test_a_law_that_only_notes_its_calls_is_none(name):
    assert not said(FORGETS[name]())


def test_questions_about_a_scene_leave_the_state_of_a_law():
    law = LatchOfTime()
    system = gauss.compile_scene(slider(law))
    assert system.scale.time > 0.0 and system.explain() and not law.on


def test_a_controller_is_simulated_from_sample_to_sample():
    """Held between samples, the output of the controller gives parabolas."""
    held, period = [0.0], 0.1
    system = gauss.compile_scene(slider(lambda t: held[0]))
    state, x, v = system.initial_state(), 0.0, 0.0
    for _ in range(10):
        held[0] = 1.0 - state.q[0] - state.v[0]
        u = 1.0 - x - v
        x, v = x + period * v + 0.5 * period**2 * u, v + period * u
        state = gauss.simulate(system, period, state=state, progress=False).state(-1)
    assert (state.q[0], state.v[0]) == pytest.approx((x, v), abs=1e-11)


@pytest.mark.parametrize("width", [1e-6, 1e-3])
def test_a_law_that_asks_for_the_time_and_never_changes_is_said(width):
    """A pulse between all samples; one that is seen is right, and not warned of."""
    system = gauss.compile_scene(slider(lambda t: 1.0 / width if 5.0 <= float(t) < 5.0 + width else 0.0))
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        rate = gauss.simulate(system, 10.0, progress=False).v[-1, 0]
    assert np.isclose(rate, 1.0, rtol=1e-8) != bool(heard)


RNG, COUNT = np.random.default_rng(1), itertools.count()
RANDOM = {
    "of time": lambda t: float(RNG.normal()),
    "of the state": lambda t, motion: float(RNG.normal()) - motion.rate("x"),
    "an iterator": lambda t: float(next(COUNT)),
}


@pytest.mark.parametrize("name", RANDOM)
@pytest.mark.parametrize("integrator", ["dop853", "radau5", "scipy_dop853"])
def test_a_random_law_is_refused_by_adaptive_steps(name, integrator):
    scene = slider(RANDOM[name])
    with warnings.catch_warnings(), pytest.raises(SimulationError, match="as if it were random"):
        warnings.simplefilter("ignore", SwitchingWarning)
        gauss.simulate(scene, 1.0, integrator=integrator, progress=False)


@pytest.mark.slow
@pytest.mark.parametrize("name", RANDOM)
def test_a_random_law_is_warned_of_by_fixed_steps(name):
    with pytest.warns(SwitchingWarning, match="gives other values when it is called again"):
        gauss.simulate(slider(RANDOM[name]), 0.1, integrator="rk4", step=0.05, progress=False)
