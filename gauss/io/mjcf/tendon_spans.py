"""Pieces of spatial tendons of a MuJoCo model: straight between two sites, or wrapped around a sphere or cylinder.

    straight:  L = |q − p|,                     force e on the body of q, −e on that of p
    wrapped:   L = |w − p| + arc + |q − v|,     force e_v on that of q, −e_p on that of p, e_p at w and −e_v at v on the geom

The path is the shortest one, so that what w and v move on the geom changes nothing: L̇ is that of points held on it.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from gauss import math
from gauss.io.mjcf.wrap_circle import LEAST, PlanePath, around, holds, through
from gauss.rotations import cross
from gauss.scene import GROUND, Force

LEAST_SQUARE = 1e-30  # m², below which the root of a squared length is not taken: the points meet but for rounding
Law = Callable  # (t, motion) → number


@dataclass(frozen=True)
class PathPoint:
    """Site of a tendon: body, point of its frame [m]."""

    body: str
    at: tuple[float, ...]


@dataclass(frozen=True)
class WrapSurface:
    """Sphere or cylinder that a tendon may touch."""

    body: str  # body that it belongs to
    at: tuple[float, ...]  # centre, in the body frame [m]
    axes: np.ndarray  # (3, 3) its axes in the body frame, columns; a cylinder lies along the third
    radius: float  # radius [m]
    is_cylinder: bool  # whether it is a cylinder, without ends, or a sphere
    # point on whose side the tendon passes; the tendon passes through the surface while this lies within
    side: PathPoint | None = None

    def path(self, p: np.ndarray, q: np.ndarray, side: np.ndarray | None) -> tuple:
        """1 if the path between two points touches it, where it meets and leaves it, the length between; in its axes."""
        plane = np.eye(3)[:2] if self.is_cylinder else _plane(p, q)
        P, Q = (tuple(axis @ end for axis in plane) for end in (p, q))
        touches, first, second, arc = self._plane_path(P, Q, plane, side)
        w, v = (plane[0] * x + plane[1] * y for x, y in (first, second))
        if not self.is_cylinder:
            return touches, w, v, arc
        legs = [_length(end[:2] - point[:2]) for end, point in ((p, w), (q, v))]
        flat, rise = legs[0] + arc + legs[1], q[2] - p[2]
        axis = np.eye(3)[2]
        w, v = w + axis * (p[2] + rise * legs[0] / flat), v + axis * (p[2] + rise * (legs[0] + arc) / flat)
        return touches, w, v, arc * np.sqrt(1.0 + (rise / flat) ** 2)

    def _plane_path(self, P: tuple, Q: tuple, plane, side: np.ndarray | None) -> PlanePath:
        """Path in a plane: around the surface, or through it while the side point is within."""
        if side is None:
            return around(P, Q, self.radius)
        outer, inner = around(P, Q, self.radius, tuple(axis @ side for axis in plane)), through(P, Q, self.radius)
        within = holds(side @ side < self.radius**2)
        if isinstance(within, float | np.floating):
            return inner if within else outer
        first, second = (
            (math.where(within > 0.5, inside[0], outside[0]), math.where(within > 0.5, inside[1], outside[1]))
            for inside, outside in ((inner.first, outer.first), (inner.second, outer.second))
        )
        touches = within * inner.touches + (1.0 - within) * outer.touches
        return PlanePath(touches, first, second, (1.0 - within) * outer.arc)


@dataclass(frozen=True)
class PathSpan:
    """Piece of a tendon between two of its points, with the share 1/divisor of its branch."""

    first: PathPoint  # first, second: its ends
    second: PathPoint
    share: float  # factor of its length
    over: WrapSurface | None = None  # what it may wrap around

    def length(self, at):
        """Length [m] by a view of the mechanism."""
        return self.share * self._shape(at)[0]

    def rate(self, at):
        """Rate of its length [m/s] by a view of the mechanism."""
        _, e_p, e_q, w, v = self._shape(at)
        moved = e_q @ at.velocity(self.second.body, self.second.at) - e_p @ at.velocity(self.first.body, self.first.at)
        if self.over is not None:
            body = self.over.body
            omega, moving = at.angular_velocity(body), at.velocity(body, (0.0, 0.0, 0.0))
            moved = moved + e_p @ (moving + cross(omega, w)) - e_q @ (moving + cross(omega, v))
        return self.share * moved

    def forces(self, name: str, number: int) -> Iterator[Force]:
        """Forces on bodies under a force of 1 N along its length."""
        for sign, point, end in ((-1.0, self.first, 1), (1.0, self.second, 2)):
            if point.body != GROUND:
                called = f"{name} on {point.body}, {number}"
                yield Force(called, point.body, self._at_end(sign * self.share, end), at=point.at)
        if self.over is not None and self.over.body != GROUND:
            called, body = f"{name} on {self.over.body}, {number} wrapped", self.over.body
            yield Force(called, body, self._on_surface, self._turning_surface, at=(0.0, 0.0, 0.0))

    def _at_end(self, factor: float, end: int) -> Law:
        return lambda t, motion: factor * self._shape(motion)[end]

    def _on_surface(self, t, motion):
        _, e_p, e_q, _, _ = self._shape(motion)
        return self.share * (e_p - e_q)

    def _turning_surface(self, t, motion):
        _, e_p, e_q, w, v = self._shape(motion)
        return self.share * (cross(w, e_p) - cross(v, e_q))

    def _shape(self, at) -> tuple:
        """Length, unit vectors at both ends, and arms, from the origin of the body, of the points on the surface."""
        p, q = at.position(self.first.body, self.first.at), at.position(self.second.body, self.second.at)
        straight = _length(q - p)
        e = (q - p) / straight
        if self.over is None:
            return straight, e, e, None, None
        body, R = self.over.body, at.rotation(self.over.body) @ self.over.axes
        arm, origin = at.rotation(body) @ np.array(self.over.at), at.position(body, (0.0, 0.0, 0.0))
        ends = [R.T @ (end - origin - arm) for end in (p, q)]
        found, w, v, arc = self.over.path(ends[0], ends[1], self._side(at, R, origin + arm))
        touches = found > 0.5
        w, v = arm + R @ w, arm + R @ v
        to, off = w + origin - p, q - v - origin
        first, last = _length(to), _length(off)
        length = math.where(touches, first + arc + last, straight)
        # where the path is straight, the surface is not loaded: any arm will do, if both are the same
        w, v = (math.where(touches, point, arm) for point in (w, v))
        return length, math.where(touches, to / first, e), math.where(touches, off / last, e), w, v

    def _side(self, at, R, centre) -> np.ndarray | None:
        """Side point in the axes of the surface: a constant, if it is on the same body."""
        assert self.over is not None
        side, surface = self.over.side, self.over
        if side is None:
            return None
        if side.body == surface.body:
            return surface.axes.T @ np.subtract(side.at, surface.at)
        return R.T @ (at.position(side.body, side.at) - centre)


def _plane(p: np.ndarray, q: np.ndarray) -> tuple:
    """Unit vectors that span the plane of two points and the origin, the first towards p."""
    first = p / _length(p)
    normal = cross(p, q)
    aligned = normal @ normal < LEAST**2
    x, y, z = (math.abs(component) for component in first)
    second, third = holds(y > x) * holds(y > z), holds(z > x) * holds(z > y)  # largest: zero there, as MuJoCo has it
    other = [second + third, 1.0 - second, 1.0 - third]
    normal = math.where(aligned, cross(first, np.array(other)), normal)
    across = cross(normal, first)
    return first, across / _length(across)


def _length(vector):
    return np.sqrt(math.maximum(vector @ vector, LEAST_SQUARE))
