"""Scenes on which orders of integrators are measured, and the measure."""

import numpy as np

import gauss
from gauss.integrators import METHODS, FixedStep
from tests.support import closed_forms, mechanisms

MECHANICAL = [name for name, method in METHODS.items() if isinstance(method, FixedStep) and method.mechanical]


def order_of(steps, errors) -> float:
    """Exponent p of errors ≈ C hᵖ (1 + c h)."""
    h = 1.0 / np.array(steps)
    return np.linalg.lstsq(np.stack([np.ones_like(h), np.log(h), h], axis=1), np.log(errors))[0][1]


GENTLE = {  # motions that swing by 0.3 rad: of wider ones terms of higher order are felt until rounding is
    "pendulum": (lambda: closed_forms.pendulum(0.3), (6, 8, 10, 12, 14)),
    "free body": (closed_forms.symmetric_body, (4, 5, 6, 7, 8, 9, 10)),
    "loop": (lambda: closed_forms.parallelogram(0.3), (6, 8, 10, 12, 14)),
}


def loaded():
    """Four-bar with what acts on bodies and joints, the one that closes the loop among them."""
    scene = mechanisms.four_bar()
    scene.drive("A", torque=lambda t: 5.0 * np.sin(3 * t))
    scene.joint_spring("S", "D", stiffness=3.0, damping=0.4, rest=0.2)
    scene.spring(
        "rope", "coupler", "ground", at=(0.5, 0, 0), other_at=(1.0, 1.0, 0.5), stiffness=20.0, damping=0.7, length=0.4
    )
    scene.force("wind", "rocker", force=lambda t: (0.0, 2.0 * t, 1.0), at=(0.3, 0, 0))
    return scene


def driven():
    """Four-bar whose crank is made to turn as a function of time: its constraint does work."""
    from gauss import math

    scene = mechanisms.four_bar()
    scene.drive("A", angle=lambda t: 10.0 * t + 0.3 * math.sin(5.0 * t))
    return scene


FORCED = {"four-bar": mechanisms.four_bar, "loads": loaded, "motion": driven, "gears": lambda: gauss.load("gear_pair")}
