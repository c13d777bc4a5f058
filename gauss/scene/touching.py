"""Where two shapes come closest: the gap between them, the place, and the normal, for every pair of kinds.

Gaps are exact where they are zero, with the right slope; elsewhere they are good to first order. None takes a root.
"""

from typing import NamedTuple

import numpy as np

from gauss import math
from gauss.errors import SceneError
from gauss.scene import values
from gauss.scene.collision import Box, Capsule, Collider, HalfSpace, Points, Sphere

PARALLEL = 1e-12  # sin² of the angle between capsules below which they touch in the middle


class Touch(NamedTuple):
    """One place where two shapes may touch.

    Attributes
    ----------
    gap : number or Expression
        Distance [m], negative inside.
    place : ndarray, shape (3,)
        On the surface of one of them, in world axes [m].
    normal : ndarray, shape (3,)
        Unit vector out of the second shape.
    """

    gap: object
    place: np.ndarray
    normal: np.ndarray


def touches(first: Collider, second: Collider, at) -> list[Touch]:
    """Places where the first shape may touch the second, where a view shows the mechanism.

    Raises
    ------
    SceneError
        If there is no rule for the two kinds.
    """
    rule, turned = _rule(first, second)
    if not turned:
        return rule(first, second, at)
    return [Touch(gap, place, -normal) for gap, place, normal in rule(second, first, at)]


def count(first: Collider, second: Collider) -> int:
    """Number of these places; a SceneError if there is no rule for the two kinds."""
    if _rule(first, second)[0] is _on_half_space:
        return max(len(first.corners), len(second.corners))
    ends = [len(shape.corners) if isinstance(shape, Points) else 1 for shape in (first, second)]
    return ends[0] * ends[1]


def _rule(first: Collider, second: Collider):
    """Rule for two kinds, and whether it takes them the other way round."""
    kinds = type(first), type(second)
    if kinds in RULES:
        return RULES[kinds], False
    if kinds[::-1] in RULES:
        return RULES[kinds[::-1]], True
    raise SceneError(
        f"{first.what} and {second.what}: there is no contact of a {first.kind} with a {second.kind}. A half-space takes "
        "any other shape, a sphere and a capsule take points, spheres and capsules, and a box takes spheres."
    )


def _on_half_space(first, second: HalfSpace, at) -> list[Touch]:
    normal, foot = second.outward(at), at.position(second.body, second.at)
    heights = [(normal @ (place - foot), place) for place in first.places(at)]
    return [Touch(height - first.radius, place - height * normal, normal) for height, place in heights]


def _balls(first, second, at) -> list[Touch]:
    return [_ball(p, other, first, second) for p in first.places(at) for other in second.places(at)]


def _ball(p, other, first, second) -> Touch:
    """Balls around two points: (d² − r²)/(2 r) with r the sum of their radii."""
    apart, r = p - other, first.radius + second.radius
    if not r:
        raise SceneError(f"{first.what} and {second.what}: two points never touch; give one of them a radius [m].")
    squared = apart @ apart
    normal = apart / np.sqrt(squared)
    return Touch((squared - r * r) / (2.0 * r), other + second.radius * normal, normal)


def _on_capsule(first, second: Capsule, at) -> list[Touch]:
    middle, axis = _segment(second, at)
    half = 0.5 * second.length
    nearest = (middle + math.clip(axis @ (p - middle), -half, half) * axis for p in first.places(at))
    return [_ball(p, other, first, second) for p, other in zip(first.places(at), nearest, strict=True)]


def _capsules(first: Capsule, second: Capsule, at) -> list[Touch]:
    """Nearest points of two segments (Ericson, Real-Time Collision Detection, 5.1.9)."""
    (c1, e1), (c2, e2), a, b = _segment(first, at), _segment(second, at), 0.5 * first.length, 0.5 * second.length
    k, along, across = e1 @ e2, e1 @ (c1 - c2), e2 @ (c1 - c2)
    s = math.clip((k * across - along) / math.maximum(1.0 - k * k, PARALLEL), -a, a)
    t = math.clip(k * s + across, -b, b)
    s = math.clip(k * t - along, -a, a)
    return [_ball(c1 + s * e1, c2 + t * e2, first, second)]


def _segment(capsule: Capsule, at):
    return at.position(capsule.body, capsule.at), at.rotation(capsule.body) @ values.unit(capsule.axis)


def _on_box(first: Sphere, second: Box, at) -> list[Touch]:
    middle, R = at.position(second.body, second.at), at.rotation(second.body) @ second.axes
    (centre,) = first.places(at)
    half = 0.5 * np.array(second.size)
    return [_ball(centre, middle + R @ math.clip(R.T @ (centre - middle), -half, half), first, second)]


SOLID = (Sphere, Points, Capsule, Box)
RULES = {(kind, HalfSpace): _on_half_space for kind in SOLID}
RULES |= {(first, second): _balls for first in (Sphere, Points) for second in (Sphere, Points)}
RULES |= {(kind, Capsule): _on_capsule for kind in (Sphere, Points)}
RULES |= {(Capsule, Capsule): _capsules, (Sphere, Box): _on_box}
