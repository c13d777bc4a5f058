"""Gears: two wheels, or a wheel and a rack, with one velocity along the tooth at the pitch point: t·(v₂ − v₁) = 0.

The row acts along the tooth, so that bearings carry the tooth force, and the wheels may sit on any carrier.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from gauss.errors import SceneError
from gauss.rotations import cross
from gauss.scene import values
from gauss.scene.geometry import Between

PARALLEL_AXES = 1e-9  # sine of the angle between parallel axes; distance, relative to the scene, of one axis
INTERSECTION_DISTANCE = 1e-6  # of bevel axes, relative to the distance of the apex: typed digits


@dataclass(frozen=True)
class Gear(Between):
    """Pair of gears: spur gears on parallel axes, external or internal, or bevel gears on axes that intersect.

    Parameters
    ----------
    body, other : str
        The wheels; "ground" for a ring that stands still.
    at, other_at : array_like, shape (3,)
        Centres of the wheels, on their axes [m].
    teeth : tuple of float
        Numbers of teeth of the two wheels, or their pitch radii: only the ratio counts.
    axis, other_axis : array_like, shape (3,)
        Axes in the frames of the two; the second is that of the first, at the reference configuration, when not given.
    internal : bool
        Whether the wheel with more teeth is a ring around the other.
    """

    teeth: tuple = (1.0, 1.0)
    axis: tuple = (0.0, 0.0, 1.0)
    other_axis: tuple | None = None
    internal: bool = False

    kind: ClassVar[str] = "gear"

    def __post_init__(self):
        super().__post_init__()
        teeth = values.vector(self.teeth, f"{self.what}: teeth", "1", 2)
        if min(teeth) <= 0 or (self.internal and teeth[0] == teeth[1]):
            raise SceneError(f"{self.what}: teeth must be positive, and differ inside a ring; got {teeth}.")
        values.keep(self, teeth=teeth, axis=values.direction(self.axis, f"{self.what}: axis"))
        if self.other_axis is not None:
            values.keep(self, other_axis=values.direction(self.other_axis, f"{self.what}: other_axis"))

    def velocities(self, at) -> list:
        """Difference of the velocities of the two wheels at the pitch point, along the teeth."""
        (R, c), (R_other, c_other) = (self._placed(at.reference(b), p) for b, p in self._sides())
        n = R @ values.unit(self.axis)
        n_other = n if self.other_axis is None else R_other @ values.unit(self.other_axis)
        if np.linalg.norm(cross(n, n_other)) < PARALLEL_AXES:
            place, along = self._spur(at, n, c_other - c)
        else:
            place, along = self._bevel(at, (c, n), (c_other, n_other))
        slip = at.velocity_at(self.other, place) - at.velocity_at(self.body, place)
        return [along @ slip]

    def _sides(self):
        return (self.body, self.at), (self.other, self.other_at)

    @staticmethod
    def _placed(pose, point):
        R, p = pose
        return R, p + R @ np.array(point)

    def _spur(self, at, n, between):
        if np.linalg.norm(cross(n, between)) < PARALLEL_AXES * at.system.scale.length:
            raise SceneError(f"{self.what}: its wheels have one axis at the reference configuration; check at, other_at.")
        first, second = self.teeth
        share = first / (first - second) if self.internal else first / (first + second)
        axis = at.rotation(self.body) @ values.unit(self.axis)
        centre = at.position(self.body, self.at)
        between = at.position(self.other, self.other_at) - centre
        between = between - axis * (axis @ between)
        along = cross(axis, between)
        return centre + share * between, along / np.sqrt(along @ along)

    def _bevel(self, at, first, second):
        """Pitch point on the line z₂ n₁ + z₁ n₂ from the apex, axes pointing from the apex to the wheels."""
        if self.internal:
            raise SceneError(f"{self.what}: internal bevel gears are not known; axes must be parallel.")
        (c, n), (c_other, n_other) = first, second
        # the apex O = c + s n = c' + s' n' by least squares; the residual is the distance of the axes
        (s, s_other), *_ = np.linalg.lstsq(np.column_stack([n, -n_other]), c_other - c, rcond=None)
        apart = np.linalg.norm(c + s * n - c_other - s_other * n_other)
        nearer, farther = sorted((abs(s), abs(s_other)))
        if apart > INTERSECTION_DISTANCE * farther or nearer < PARALLEL_AXES * at.system.scale.length:
            raise SceneError(
                f"{self.what}: axes that are not parallel must intersect ({apart:.3g} m apart), and at and other_at be the "
                "centres of the wheels, away from the point of intersection."
            )
        axis = -np.sign(s) * (at.rotation(self.body) @ values.unit(self.axis))
        other_axis = -np.sign(s_other) * self._other_axis(at)
        pitch = self.teeth[1] * axis + self.teeth[0] * other_axis
        apex = at.position(self.body, self.at) - abs(s) * axis
        along = cross(axis, other_axis)
        return apex + abs(s) / (pitch @ axis) * pitch, along / np.sqrt(along @ along)

    def _other_axis(self, at):
        return at.rotation(self.other) @ values.unit(self.other_axis)


@dataclass(frozen=True)
class Rack(Between):
    """Wheel that rolls along a rack without slipping.

    Parameters
    ----------
    body, other : str
        The wheel and the rack.
    at : array_like, shape (3,)
        Centre of the wheel [m].
    other_at : array_like, shape (3,)
        A point of the pitch line of the rack [m]; its distance from the centre is the pitch radius.
    axis : array_like, shape (3,)
        Axis of the wheel, in its frame.
    along : array_like, shape (3,)
        Direction of the rack, in its frame.
    """

    axis: tuple = (0.0, 0.0, 1.0)
    along: tuple = (1.0, 0.0, 0.0)

    kind: ClassVar[str] = "rack"

    def __post_init__(self):
        super().__post_init__()
        values.keep(self, axis=values.direction(self.axis, f"{self.what}: axis"))
        values.keep(self, along=values.direction(self.along, f"{self.what}: along"))

    def velocities(self, at) -> list:
        """Difference of the velocities at the pitch point, along the rack."""
        axis, along = at.rotation(self.body) @ values.unit(self.axis), at.rotation(self.other) @ values.unit(self.along)
        reach = -self.gap(at)
        place = at.position(self.body, self.at) + reach - along * (along @ reach) - axis * (axis @ reach)
        return [along @ (at.velocity_at(self.other, place) - at.velocity_at(self.body, place))]
