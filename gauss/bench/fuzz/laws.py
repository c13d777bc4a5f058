"""Random laws of loads, in every form that a user may write them: constants, waves, pulses, limits, feedback, opaque code.

Each is a function of (rng, strength, span, feel), where ``feel`` returns a coordinate and a rate of a motion.
"""

import math as plain
from collections.abc import Callable

import numpy as np

from gauss import math
from gauss.scene.profiles import Move, Sine


def random_law(rng, strength: float, span: float, feel: Callable):
    """Name and law: a number, or a function of (t) or (t, motion).

    Parameters
    ----------
    rng : Generator
        Chooses.
    strength : float
        Size of what it returns.
    span : float
        How long the motion lasts [s].
    feel : callable
        Motion → (coordinate, rate), made without units by the size of the scene and the span.
    """
    name = str(rng.choice(list(LAWS), p=WEIGHTS / WEIGHTS.sum()))
    return name, LAWS[name](rng, strength * rng.normal(), span, feel)


def _pulse(rng, span: float) -> tuple[float, float]:
    """Start and end, often late and short [s]."""
    begin = span * rng.uniform(0.05, 0.95)
    return begin, begin + span * float(10.0 ** rng.uniform(-3.0, -0.3))


def _sine(rng, strength, span, feel):
    return Sine(strength, float(rng.uniform(0.2, 5.0)) / span, phase=float(rng.uniform(0, 6)))


def _move(rng, strength, span, feel):
    begin, end = _pulse(rng, span)
    return Move(0.0, strength, end - begin, begin)


def _where_pulse(rng, strength, span, feel):
    begin, end = _pulse(rng, span)
    return lambda t: math.where((t > begin) & (t < end), strength, 0.0)


def _if_pulse(rng, strength, span, feel):
    begin, end = _pulse(rng, span)
    return lambda t: strength if begin <= t < end else 0.0


def _square(rng, strength, span, feel):
    rate = rng.uniform(2.0, 20.0) / span
    return lambda t: strength * math.sign(np.sin(rate * t))


def _clipped(rng, strength, span, feel):
    rate = rng.uniform(2.0, 20.0) / span
    return lambda t: math.clip(3.0 * strength * np.sin(rate * t), -abs(strength), abs(strength))


def _least(rng, strength, span, feel):
    rate = rng.uniform(0.5, 3.0) / span
    return lambda t: math.minimum(strength * rate * t, math.maximum(strength, 2.0 * strength * (1.0 - rate * t)))


def _opaque(rng, strength, span, feel):
    rate = rng.uniform(0.5, 10.0) / span
    return lambda t: strength * plain.cos(rate * float(t))


def _opaque_pulse(rng, strength, span, feel):
    begin, end = _pulse(rng, span)
    return lambda t: strength if begin <= float(t) < end else 0.0


def _opaque_feedback(rng, strength, span, feel):
    return lambda t, motion: -abs(strength) * plain.tanh(float(feel(motion)[1]))


def _feedback(rng, strength, span, feel):
    gain = rng.uniform(0.0, 2.0)
    return lambda t, motion: -abs(strength) * (feel(motion)[0] + gain * feel(motion)[1])


def _saturated(rng, strength, span, feel):
    gain = rng.uniform(0.5, 10.0)
    return lambda t, motion: math.clip(-gain * strength * feel(motion)[1], -abs(strength), abs(strength))


def _window(rng, strength, span, feel):
    at, width = rng.normal(), float(10.0 ** rng.uniform(-3.0, 0.0))
    return lambda t, motion: math.where(math.abs(feel(motion)[0] - at) < width, strength, 0.0)


def _if_beyond(rng, strength, span, feel):
    at = rng.normal()
    return lambda t, motion: strength if feel(motion)[0] > at else -0.5 * strength


def _one_way(rng, strength, span, feel):
    return lambda t, motion: -abs(strength) * math.maximum(feel(motion)[1], 0.0)


def _dry(rng, strength, span, feel):
    return lambda t, motion: -abs(strength) * math.sign(feel(motion)[1])


LAWS = {
    "constant": lambda rng, strength, span, feel: strength,
    "sine": _sine,
    "move": _move,
    "where pulse": _where_pulse,
    "if pulse": _if_pulse,
    "square": _square,
    "clip": _clipped,
    "min max": _least,
    "opaque": _opaque,
    "opaque pulse": _opaque_pulse,
    "opaque feedback": _opaque_feedback,
    "feedback": _feedback,
    "saturated": _saturated,
    "window": _window,
    "if beyond": _if_beyond,
    "one way": _one_way,
    "dry": _dry,
}
RARE = {"dry": 0.2, "opaque pulse": 0.4, "opaque": 0.6, "opaque feedback": 0.6}  # which chatter, or cost an evaluation each
WEIGHTS = np.array([RARE.get(name, 1.0) for name in LAWS])
