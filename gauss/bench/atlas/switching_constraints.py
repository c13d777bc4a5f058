"""Cases of constraints that switch along the motion: a kink and a narrow rise of a cam, a ratio that jumps."""

from dataclasses import replace

import numpy as np
from scipy.integrate import quad
from scipy.optimize import brentq

from gauss import math
from gauss.bench.atlas.case import FailureCase
from gauss.bench.atlas.methods import Method
from gauss.dynamics import compile_scene
from gauss.scene import Scene

SPEED, PLACE, END, STEP = 2.0, 1.05, 1.0, 0.02  # of a carriage [m/s], where it switches [m], duration and step [s]
SLOPE = 0.5  # of a cam behind its kink
RISE, WIDTH = 0.05, 2e-3  # of a narrow cam [m]
RATIO = 2.0  # of a transmission behind the jump, 1 before


def _carriage(**constraint) -> Scene:
    """Two bodies of 1 kg: a carriage on a rail, and a slide on it that a cam or a transmission moves."""
    scene = Scene("carriage", gravity=(0, 0, 0))
    scene.body("carriage", 1.0)
    scene.body("slide", 1.0)
    scene.prismatic("X", "ground", "carriage", axis=(1, 0, 0))
    scene.prismatic("Z", "carriage", "slide", axis=(0, 0, 1))
    scene.start("X", rate=SPEED)
    if "profile" in constraint:
        scene.cam("cam", "X", "Z", constraint["profile"])
    else:
        scene.transmission("gearing", "Z", "X", constraint["ratio"])
        scene.start("Z", rate=SPEED)
    return scene


def _place(expected: float, **constraint):
    """Error of the place of the carriage at the end, relative."""

    def figure(method: Method, _) -> float:
        # constraints that switch divide a motion into phases, whatever is believed of single accelerations
        trajectory = replace(method, certified=True).motion(compile_scene(_carriage(**constraint)), END, STEP)
        return float(abs(trajectory.coordinate("X")[-1] - expected) / expected)

    return figure


def _behind(speed: float) -> float:
    """Place at the end [m] where the carriage goes on at another speed [m/s]."""
    return PLACE + speed * (END - PLACE / SPEED)


def _over_the_rise() -> float:
    """Place at the end [m], from the energy (2 + f′²) ẋ²/2 of both bodies."""

    def stretch(x: float) -> float:
        slope = -2.0 * (x - PLACE) / WIDTH**2 * RISE * np.exp(-(((x - PLACE) / WIDTH) ** 2))
        return np.sqrt(1.0 + 0.5 * slope * slope) - 1.0

    reach = 12.0 * WIDTH
    longer, _ = quad(stretch, PLACE - reach, PLACE + reach, points=[PLACE], epsabs=1e-14, epsrel=1e-13, limit=500)
    return float(brentq(lambda x: x + longer - SPEED * END, PLACE + reach, SPEED * END))


PLACED = "error of the place at the end"
SWITCHED = (
    FailureCase(
        "kink of a cam",
        PLACED,
        _place(_behind(2.0 * SPEED / (2.0 + SLOPE**2)), profile=lambda x: SLOPE * math.maximum(0.0, x - PLACE)),
        passes=1e-7,
    ),
    FailureCase(
        "narrow rise of a cam",
        PLACED,
        _place(_over_the_rise(), profile=lambda x: RISE * math.exp(-(((x - PLACE) / WIDTH) ** 2))),
        passes=1e-7,
    ),
    FailureCase(
        "ratio that jumps",
        PLACED,
        _place(
            _behind(SPEED * (2.0 + RATIO) / (2.0 + RATIO**2)),
            ratio=lambda at: math.where(at.coordinate("X") > PLACE, RATIO, 1.0),
        ),
        passes=1e-7,
    ),
)
