"""Holonomic constraints between points and axes of two bodies: coincidence, distance, plane, line, curve, angle."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from gauss import rotations
from gauss.errors import SceneError
from gauss.scene import values
from gauss.scene.relation import Relation

LEAST_DISTANCE = 1e-9  # relative to the lengths that it is the difference of: a shorter one has no direction
LEAST_SINE = 1e-9  # of the angle of two axes: smaller, they have no common plane


@dataclass(frozen=True)
class Between(Relation):
    """Relation between a point of a body and a point of another; either may be a named frame, or "ground".

    Parameters
    ----------
    name : str
        Name of the constraint.
    body, other : str
        Bodies or frames.
    at, other_at : array_like, shape (3,)
        The points, in the frames of the two [m].
    """

    body: str
    other: str
    at: tuple = (0.0, 0.0, 0.0)
    other_at: tuple = (0.0, 0.0, 0.0)

    frames: ClassVar[tuple[str, ...]] = ("body", "other")
    kind: ClassVar[str] = "constraint"

    def __post_init__(self):
        what = self.what
        values.text(self.name, f"name of a {self.kind}")
        if self.body == self.other:
            raise SceneError(f"{what}: both ends are on {self.body!r}; a constraint binds two bodies.")
        values.keep(self, at=values.vector(self.at, f"{what}: at", "m"))
        values.keep(self, other_at=values.vector(self.other_at, f"{what}: other_at", "m"))

    @property
    def what(self) -> str:
        """Its name in messages."""
        return f"{self.kind} {self.name!r}"

    def gap(self, at) -> np.ndarray:
        """Vector (3,) from the point of the other body to that of the first, in world axes."""
        return at.position(self.body, self.at) - at.position(self.other, self.other_at)

    def _reference_places(self, at) -> tuple[np.ndarray, np.ndarray]:
        (R, p), (R_other, p_other) = at.reference(self.body), at.reference(self.other)
        return p + R @ np.array(self.at), p_other + R_other @ np.array(self.other_at)

    def _reference_length(self, at) -> float:
        """Distance of the points at the reference configuration; a SceneError if they coincide there."""
        place, other = self._reference_places(at)
        length = float(np.linalg.norm(place - other))
        if length <= LEAST_DISTANCE * max(np.abs(place).max(), np.abs(other).max()):
            raise SceneError(f"{self.what}: its points coincide at the reference configuration; give length=.")
        return length


@dataclass(frozen=True)
class Coincident(Between):
    """Two points that coincide: a ball joint without coordinates. Three rows [m]."""

    kind: ClassVar[str] = "coincidence"

    def positions(self, at) -> list:
        """Difference of the points along the world axes."""
        return list(self.gap(at))


@dataclass(frozen=True)
class Distance(Between):
    """Two points at a constant distance, or one that is a law of time: a rigid rod without mass. One row [m].

    Parameters
    ----------
    length : float, callable or spline, optional
        Distance [m]; that of the reference configuration when not given.
    """

    length: float | Callable | None = None

    kind: ClassVar[str] = "distance"

    def __post_init__(self):
        super().__post_init__()
        if self.length is not None:
            values.keep(self, length=values.smooth_law(self.length, f"{self.what}: length", "m"))
            if not callable(self.length) and self.length <= 0.0:
                raise SceneError(f"{self.what}: length must be positive, got {self.length!r}; use coincident for none.")

    def positions(self, at) -> list:
        """(d² − l²)/(2 l): the distance less its length, to first order, without a root."""
        gap, length = self.gap(at), self.length
        if length is None:
            length = self._reference_length(at)
        length = values.evaluate(length, at.t)
        return [(gap @ gap - length * length) / (2.0 * length)]


@dataclass(frozen=True)
class OnPlane(Between):
    """Point of a body that stays on a plane of another. One row [m].

    Parameters
    ----------
    normal : array_like, shape (3,)
        Normal of the plane through ``other_at``, in the frame of the other.
    """

    normal: tuple = (0.0, 0.0, 1.0)

    kind: ClassVar[str] = "point on plane"

    def __post_init__(self):
        super().__post_init__()
        values.keep(self, normal=values.direction(self.normal, f"{self.what}: normal"))

    def positions(self, at) -> list:
        """Height above the plane."""
        return [(at.rotation(self.other) @ values.unit(self.normal)) @ self.gap(at)]


@dataclass(frozen=True)
class OnLine(Between):
    """Point of a body that stays on a line of another. Two rows [m].

    Parameters
    ----------
    axis : array_like, shape (3,)
        Direction of the line through ``other_at``, in the frame of the other.
    """

    axis: tuple = (1.0, 0.0, 0.0)

    kind: ClassVar[str] = "point on line"

    def __post_init__(self):
        super().__post_init__()
        values.keep(self, axis=values.direction(self.axis, f"{self.what}: axis"))

    def positions(self, at) -> list:
        """Offsets along two directions across the line."""
        across = at.rotation(self.other) @ rotations.along(values.unit(self.axis))[:, :2]
        return list(across.T @ self.gap(at))


@dataclass(frozen=True)
class OnCurve(Between):
    """Point of a body that stays on a curve or surface of another. A row for each equation.

    Parameters
    ----------
    curve : callable
        ``curve(p)`` of the point (3,) in the frame of the other, from ``other_at`` [m], returns residuals:
        two numbers for a curve, one for a surface; e.g. ``lambda p: (p[1] - p[0] ** 2, p[2])`` for a parabola.
    """

    curve: Callable | None = None

    kind: ClassVar[str] = "point on curve"

    def __post_init__(self):
        super().__post_init__()
        if not callable(self.curve):
            raise SceneError(f"{self.what}: curve must be a function of a point (x, y, z), got {self.curve!r}.")

    def positions(self, at) -> list:
        """Residuals of the equations of the curve."""
        assert self.curve is not None  # refused above
        residuals = self.curve(at.rotation(self.other).T @ self.gap(at))
        return list(np.asarray(residuals, dtype=object).ravel())


@dataclass(frozen=True)
class Angle(Between):
    """Axes of two bodies at a constant angle, or one that is a law of time. One row [rad].

    Parameters
    ----------
    axis, other_axis : array_like, shape (3,)
        The axes, in the frames of the two.
    angle : float, callable or spline, optional
        Angle between them [rad]; that of the reference configuration when not given. Not 0 or π: there the axes are
        parallel, which takes two right angles.
    """

    axis: tuple = (0.0, 0.0, 1.0)
    other_axis: tuple = (0.0, 0.0, 1.0)
    angle: float | Callable | None = None

    kind: ClassVar[str] = "angle"

    def __post_init__(self):
        super().__post_init__()
        values.keep(self, axis=values.direction(self.axis, f"{self.what}: axis"))
        values.keep(self, other_axis=values.direction(self.other_axis, f"{self.what}: other_axis"))
        if self.angle is not None:
            values.keep(self, angle=values.smooth_law(self.angle, f"{self.what}: angle", "rad"))

    def positions(self, at) -> list:
        """(cos α − e·e')/sin α: the angle less α, to first order."""
        e, other, angle = values.unit(self.axis), values.unit(self.other_axis), self.angle
        if angle is None:
            (R, _), (R_other, _) = at.reference(self.body), at.reference(self.other)
            angle = float(np.arccos(np.clip((R @ e) @ (R_other @ other), -1.0, 1.0)))
        if not callable(angle) and abs(np.sin(angle)) < LEAST_SINE:
            raise SceneError(f"{self.what}: the axes are parallel at angle {angle:.6g} rad; two angles of π/2 keep them so.")
        angle = values.evaluate(angle, at.t)
        cosine = (at.rotation(self.body) @ e) @ (at.rotation(self.other) @ other)
        return [(np.cos(angle) - cosine) / np.sin(angle)]
