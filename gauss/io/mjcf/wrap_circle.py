"""Shortest paths around a circle about the origin of a plane, and through one, over numbers or symbols.

    tangent points of P:  W = (r² P ± r √(|P|² − r²) P⊥) / |P|²
    inside, by z = sin φ:  asin(A z) + asin(B z) − 2 φ + γ = 0,   A = r/|P₀|,  B = r/|P₁|

γ is the angle between the ends. A path with a side never crosses the ray from the centre away from that side, which is how
MuJoCo 4 chooses; so a tendon stays on its side as the mechanism moves. Conditions are numbers here, 0 or 1, and join as
products: traced, ``and`` and ``or`` would divide what is written down into cases.
"""

from typing import Any, NamedTuple

import numpy as np

from gauss import math

LEAST = 1e-15  # m, m², 1: below which MuJoCo takes a length, its square or a sine for zero
NEWTON = 9  # steps from φ = π/2: the function is concave and decreases, convergence is monotone, six reach rounding
Number = Any  # number or symbol


class PlanePath(NamedTuple):
    """Path around a circle."""

    touches: Number  # 1 if it touches the circle; otherwise it is straight, and the rest means nothing
    first: tuple[Number, Number]  # first, second: points at which it meets and leaves the circle [m]
    second: tuple[Number, Number]
    arc: Number  # length between them on the circle [m]


def holds(condition) -> Number:
    """1 where a condition holds, else 0."""
    return math.where(condition, 1.0, 0.0)


def around(P: tuple, Q: tuple, radius: float, side: tuple | None = None) -> PlanePath:
    """Path from P to Q around a circle, on the nearer side or on that asked for; straight where the circle is aside."""
    span, outside = (Q[0] - P[0], Q[1] - P[1]), holds(_dot(P, P) >= radius**2) * holds(_dot(Q, Q) >= radius**2)
    squared = _dot(span, span)
    share = math.clip(-_dot(span, P) / math.maximum(squared, LEAST), 0.0, 1.0)
    nearest = P[0] + share * span[0], P[1] + share * span[1]
    bends, sense = holds(_dot(nearest, nearest) <= radius**2), math.where(_cross(P, Q) < 0.0, 1.0, -1.0)
    if side is not None:
        other = _crosses_ray(P, Q, side)
        bends, sense = math.maximum(bends, other), sense * (1.0 - 2.0 * other)
    W, V = _tangent(P, radius, sense), _tangent(Q, radius, -sense)
    angle = np.arctan2(-sense * _cross(W, V), _dot(W, V))
    arc = radius * (angle + math.where(angle < 0.0, 2.0 * np.pi, 0.0))
    return PlanePath(bends * outside * holds(squared >= LEAST), W, V, arc)


def _crosses_ray(P: tuple, Q: tuple, side: tuple) -> Number:
    """Whether the segment PQ crosses the ray from the origin against a direction."""
    p, q = _cross(P, side), _cross(Q, side)
    along = math.where(p > q, 1.0, -1.0) * (_dot(Q, side) * p - _dot(P, side) * q)
    return holds(p * q <= 0.0) * holds(along < 0.0)


def through(P: tuple, Q: tuple, radius: float) -> PlanePath:
    """Path from P to Q that touches a circle from within, or passes through it in a straight line."""
    p, q = (np.sqrt(math.maximum(_dot(end, end), LEAST**2)) for end in (P, Q))
    span = Q[0] - P[0], Q[1] - P[1]
    squared = _dot(span, span)
    share = -_dot(span, P) / math.maximum(squared, LEAST)
    nearest = P[0] + share * span[0], P[1] + share * span[1]
    passes = holds(squared > LEAST) * holds(share > 0.0) * holds(share < 1.0) * holds(_dot(nearest, nearest) <= radius**2)
    # keep what is computed, and not taken, finite
    A, B = (radius / math.maximum(length, radius) for length in (p, q))
    cross = _cross(P, Q)
    gamma = np.arctan2(math.abs(cross), _dot(P, Q))
    phi = np.pi / 2
    for _ in range(NEWTON):
        a, b = (_arcsine(ratio * np.sin(phi)) for ratio in (A, B))
        slope = sum(ratio * np.cos(phi) / math.maximum(np.cos(angle), LEAST) for ratio, angle in ((A, a), (B, b))) - 2.0
        phi = phi - (a + b - 2.0 * phi + gamma) / math.minimum(slope, -LEAST)
    left = cross > 0.0
    turn = phi - math.where(left, _arcsine(A * np.sin(phi)), _arcsine(B * np.sin(phi)))
    x, y = (math.where(left, one / p, other / q) for one, other in zip(P, Q, strict=True))
    W = radius * (np.cos(turn) * x - np.sin(turn) * y), radius * (np.sin(turn) * x + np.cos(turn) * y)
    return PlanePath(holds(p > radius) * holds(q > radius) * (1.0 - passes), W, W, 0.0)


def _tangent(P: tuple, radius: float, sense: Number) -> tuple[Number, Number]:
    squared = math.maximum(_dot(P, P), radius**2)
    leg = sense * radius * np.sqrt(math.maximum(squared - radius**2, LEAST**2))
    return (radius**2 * P[0] + leg * P[1]) / squared, (radius**2 * P[1] - leg * P[0]) / squared


def _arcsine(x: Number) -> Number:
    return np.arctan2(x, np.sqrt(math.maximum(1.0 - x * x, LEAST**2)))


def _dot(a: tuple, b: tuple) -> Number:
    return a[0] * b[0] + a[1] * b[1]


def _cross(a: tuple, b: tuple) -> Number:
    return a[0] * b[1] - a[1] * b[0]
