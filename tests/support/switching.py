"""Sliders with switching loads, and the verdict on their motions: right, refused or warned of."""

import math
import warnings

import numpy as np
from scipy.interpolate import PPoly

import gauss
from gauss import math as gm
from gauss.errors import BalanceWarning, GaussError, SwitchingWarning

RELATIVE = 1e-8  # of the size of the result; the error of steps allowed is 1e-12
ABSOLUTE = 1e-11  # of rates: steps are allowed 1e-12 each
ROOT_PI = math.sqrt(math.pi)


def slider(law, rate=0.0, **options):
    """A kilogram on a rail, and a force on it."""
    scene = gauss.Scene("slider", gravity=(0, 0, 0))
    scene.body("b", 1.0)
    scene.prismatic("x", "ground", "b", axis=(1, 0, 0))
    scene.start("x", rate=rate)
    scene.drive("x", force=law, **options)
    return scene


def beside(law, rate=1.0):
    """A kilogram that flies along x, and another on which a force acts along y."""
    scene = gauss.Scene("beside", gravity=(0, 0, 0))
    scene.body("b", 1.0)
    scene.body("c", 1.0)
    scene.prismatic("x", "ground", "b", axis=(1, 0, 0))
    scene.prismatic("y", "ground", "c", axis=(0, 1, 0))
    scene.start("x", rate=rate)
    scene.drive("y", force=law)
    return scene


def verdict(move, expected, relative=RELATIVE) -> str:
    """Whether rates (…) that ``move`` returns are right; if not, whether that was said."""
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        try:
            found = np.asarray(move(), dtype=float)
        except GaussError as error:
            assert str(error)
            return "refused"
    off = np.abs(found - expected).max()
    if off <= relative * np.abs(expected).max() + ABSOLUTE:
        return "right"
    said = [w for w in heard if issubclass(w.category, SwitchingWarning | BalanceWarning)]
    return "warned" if said else f"silently wrong: {found} instead of {expected}"


def moved(system, duration, **options):
    """Coordinates and rates at the end."""
    motion = gauss.simulate(system, duration, progress=False, **options)
    return np.concatenate([motion.q[-1], motion.v[-1]])


# Laws of time, how long, the rate and the place of the slider at the end.


def between(t):
    return 10.0 if 5 <= t < 6 else 0.0


def bell(width, at):
    return lambda t: gm.exp(-(((t - at) / width) ** 2))


STEPS = PPoly(np.array([[0.0, 100.0, 0.0]]), [0.0, 8.0, 8.01, 20.0])


class Counting:
    """An opaque law that remembers."""

    def __init__(self):
        self.calls = 0

    def __call__(self, t):
        self.calls += 1
        return 10.0 if 5.0 <= float(t) < 6.0 else 0.0
