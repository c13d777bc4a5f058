"""Cases of laws that act for a while, against closed forms, and of constraints that switch along the motion."""

from dataclasses import replace

import numpy as np
from scipy.integrate import quad
from scipy.optimize import brentq

from gauss import math
from gauss.bench.atlas.case import FailureCase
from gauss.bench.atlas.methods import Method
from gauss.dynamics import compile_scene
from gauss.scene import Scene
from gauss.scene.profiles import Move
from gauss.system import System

SPEED, PLACE, END, STEP = 2.0, 1.05, 1.0, 0.02  # of a carriage [m/s], where it switches [m], duration and step [s]
SLOPE = 0.5  # of a cam behind its kink
RISE, WIDTH = 0.05, 2e-3  # of a narrow cam [m]
RATIO = 2.0  # of a transmission behind the jump, 1 before


def _quiet(law, rate: float = 0.0) -> System:
    """A kilogram on each of two rails: one flies along x, the other is at rest until the law acts on it."""
    scene = Scene("quiet start", gravity=(0, 0, 0))
    for name, axis in (("x", (1, 0, 0)), ("y", (0, 1, 0))):
        scene.body(f"body {name}", 1.0)
        scene.prismatic(name, "ground", f"body {name}", axis=axis)
    scene.start("x", rate=rate)
    scene.drive("y", force=law)
    return compile_scene(scene)


def _acting(law, impulse: float, rate: float = 0.0):
    """Relative error of the rate of a kilogram after a law has acted on it for a while."""

    def figure(method: Method, _) -> float:
        trajectory = method.motion(_quiet(law, rate), 10.0, 0.02)
        return float(abs(trajectory.v[-1, 1] - impulse) / impulse)

    return figure


def _friction_by_sign(method: Method, _) -> float:
    """A slider that friction, written by hand, brings to rest: where it stands."""
    scene = Scene("friction by sign", gravity=(0, 0, 0))
    scene.body("block", 1.0)
    scene.prismatic("rail", "ground", "block", axis=(1, 0, 0))
    scene.start("rail", rate=1.0)
    scene.drive("rail", force=lambda t, motion: -2.0 * math.sign(motion.rate("rail")))
    trajectory = method.motion(compile_scene(scene), 1.0, 3e-3)
    return float(abs(trajectory.coordinate("rail")[-1] - 0.25) / 0.25)


def _carried(jumps: dict[float, float], **prescribed):
    """A kilogram on a spring in a cart whose prescribed speed jumps: x = −Σ (Δ/ω) sin ω (t − t_jump), beside its size.

    It is at rest before the first jump; a speed at the start is a jump at t = 0.
    """

    def figure(method: Method, _) -> float:
        scene, rate, end = Scene("carried oscillator", gravity=(0, 0, 0)), 5.0, 1.0
        scene.body("cart", 2.0)
        scene.body("mass", 1.0)
        scene.prismatic("rail", "ground", "cart", axis=(1, 0, 0))
        scene.prismatic("guide", "cart", "mass", axis=(1, 0, 0))
        scene.joint_spring("spring", "guide", stiffness=rate**2)
        scene.drive("rail", **prescribed)
        trajectory = method.motion(compile_scene(scene), end, 5e-3)
        exact = -sum(change / rate * np.sin(rate * (end - t)) for t, change in jumps.items())
        size = sum(abs(change) for change in jumps.values()) / rate
        return float(abs(trajectory.coordinate("guide")[-1] - exact) / size)

    return figure


WIDTH = 0.05  # of a bell [s, m]
ACTING = "error of the rate that it leaves behind"
CARRIED = "error of the place of what is carried"
ACTS = (
    FailureCase("pulse after rest", ACTING, _acting(lambda t: 10.0 if 5.0 <= t < 6.0 else 0.0, 10.0)),
    FailureCase("profile after rest", ACTING, _acting(Move(0.0, 4.0, 1.0, 8.0), 6.0), passes=1e-8),
    FailureCase("bell after rest", ACTING, _acting(lambda t: math.exp(-(((t - 8.0) / WIDTH) ** 2)), WIDTH * np.sqrt(np.pi))),
    FailureCase(
        "narrow place",
        ACTING,
        _acting(lambda t, motion: 1e3 if 3.303 < motion.coordinate("x") < 3.304 else 0.0, 1.0, rate=1.0),
        passes=1e-7,
    ),
    FailureCase(
        "jump of a prescribed speed",
        CARRIED,
        _carried({0.0: 2.0, 0.3: 4.0}, speed=lambda t: math.where(t < 0.3, 2.0, 6.0)),
        passes=1e-7,
    ),
    FailureCase(
        "late and short speed",
        CARRIED,
        _carried({0.801: 4.0, 0.8015: -4.0}, speed=lambda t: math.where((t >= 0.801) & (t < 0.8015), 4.0, 0.0)),
        passes=1e-7,
    ),
    FailureCase(
        "kink of a prescribed position",
        CARRIED,
        _carried({0.3: 2.0}, displacement=lambda t: 2.0 * math.maximum(t - 0.3, 0.0)),
        passes=1e-7,
    ),
    FailureCase("friction by sign", "error of where it stops, or said", _friction_by_sign, solvable=False),
)


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
