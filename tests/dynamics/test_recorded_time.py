"""Laws that read the time, of their first argument or of their second, and laws that do not."""

import math

import numpy as np
import pytest

import gauss
from gauss.dynamics.kinematics import kinematics
from gauss.dynamics.laws.recorded_time import reads_first, reads_time
from gauss.dynamics.laws.sampled_laws import sampled_times

SAME_TIME = 1e-9  # s, of a jump that is located by bisection


def _tried(t, motion):
    try:
        return math.sqrt(t - 1.0)
    except ValueError:
        return 0.0


def _kept(t, motion, seen=[]):  # noqa: B006  # the list that it keeps
    seen.append(t)
    return 0.0


LAWS = {
    "rate": (lambda t, motion: float(motion.state.v[0]), (False, False)),
    "compared": (lambda t, motion: 1.0 if t > 0.5 else 0.0, (True, False)),
    "equal": (lambda t, motion: float(t == 0.5), (True, False)),
    "converted": (lambda t, motion: float(t), (True, False)),
    "sine": (lambda t, motion: math.sin(t), (True, False)),
    "interpolated": (lambda t, motion: np.interp(t, [0.0, 1.0], [0.0, 1.0]), (True, False)),
    "in an array": (lambda t, motion: np.array([t, 0.0])[0], (True, False)),
    "in a table": (lambda t, motion: {0.0: 1.0}.get(t, 2.0), (True, False)),
    "by its type": (lambda t, motion: float(isinstance(t, float)), (True, False)),
    "returned": (lambda t, motion: t, (True, False)),
    "kept": (_kept, (True, False)),
    "tried": (_tried, (True, False)),
    "failed": (lambda t, motion: motion.rate("no joint"), (True, True)),
    "of the motion": (lambda t, motion: float(motion.t), (False, True)),
    "of the state": (lambda t, motion: 2.0 * motion.state.t, (False, True)),
}


@pytest.fixture(scope="module")
def motion():
    system = gauss.compile_scene(gauss.load("double_pendulum"))
    return kinematics(system, system.initial_state())


@pytest.mark.parametrize("name", LAWS)
def test_reading_the_time_is_recorded(motion, name):
    law, expected = LAWS[name]
    assert reads_time(law, motion) == expected
    assert reads_first(law, motion.state.t, motion) == expected[0]


@pytest.mark.slow
@pytest.mark.parametrize("time", [lambda t, motion: t, lambda t, motion: motion.t, lambda t, motion: motion.state.t])
def test_jumps_are_located_however_the_time_is_read(motion, time):
    found = sampled_times(lambda t, at: 1.0 if float(time(t, at)) > 0.7 else 0.0, motion, 0.0, 1.0).switches
    assert found == pytest.approx([0.7], abs=SAME_TIME)


def test_laws_that_remember_calls_are_told_without_reading_the_time(motion):
    calls = iter(range(10**9))
    (text,) = sampled_times(lambda t, at: float(next(calls)), motion, 0.0, 1.0, "the law").limitations
    assert text.startswith("the law")
