"""Joints of two bodies, by kinematic pair, point and axes; ideal couplings of two joint coordinates."""

from dataclasses import dataclass

import numpy as np

from gauss import rotations
from gauss.errors import SceneError, did_you_mean
from gauss.scene import values
from gauss.scene.pairs import PAIRS, Pair, screw

PERPENDICULAR = 1e-6  # axes typed with 7 digits are meant as perpendicular


@dataclass(frozen=True)
class Joint:
    """Joint between a parent and a child body.

    Point and axes are given at the reference configuration, in the frame named by ``frame``.

    Parameters
    ----------
    name : str
        Name; it also names the joint's coordinate.
    kind : str
        revolute, prismatic, fixed, free, cylindrical, universal, ball, planar or screw.
    parent, child : str
        Bodies; the joint's coordinates move the child relative to the parent.
    at : array_like, shape (3,)
        Joint point [m].
    axis : array_like, shape (3,)
        Axis of the pair; normal of a planar pair; first axis of a universal joint (fixed in the parent).
    second_axis : array_like, shape (3,), optional
        Second axis of a universal joint (fixed in the child), or first direction of translation of a planar
        pair; perpendicular to ``axis``. Found by the library when not given.
    rotation : array_like, optional
        Axes of a ball or free joint, in which its coordinates are zero at the reference configuration.
    pitch : float
        Advance of a screw [m/rad].
    frame : str
        "world", or the name of a body.
    child_frame : str, optional
        For a joint that closes a loop: ``at`` and the axes are given in two frames by the same numbers, in ``frame`` on the
        parent and in this one on the child (named frames, or the bodies themselves). The loop need not be closed at the
        reference configuration.
    child_at : array_like, shape (3,), optional
        Joint point once more, in the frame of the child [m]: checked against ``at``, and refused when the two
        differ at the reference configuration.
    limits : array_like, shape (2,), optional
        Lowest and highest coordinate of a joint of one freedom [rad, m]: kept when a start is assembled.
    """

    name: str
    kind: str
    parent: str
    child: str
    at: tuple = (0.0, 0.0, 0.0)
    axis: tuple = (0.0, 0.0, 1.0)
    second_axis: tuple | None = None
    rotation: tuple = (0.0, 0.0, 0.0)
    pitch: float = 0.0
    frame: str = "world"
    child_frame: str | None = None
    child_at: tuple | None = None
    limits: tuple | None = None

    def __post_init__(self):
        what = f"joint {values.text(self.name, 'name of a joint')!r}"
        if not isinstance(self.kind, str) or self.kind not in PAIRS:
            raise SceneError(f"{what}: unknown type {self.kind!r}. {did_you_mean(str(self.kind), PAIRS)}")
        if self.parent == self.child:
            raise SceneError(f"{what}: parent and child are both {self.child!r}; a joint binds two bodies.")
        keep = {
            "at": values.vector(self.at, f"{what}: at", "m"),
            "axis": values.direction(self.axis, f"{what}: axis"),
            "rotation": values.rotation(self.rotation, f"{what}: rotation"),
            "pitch": values.number(self.pitch, f"{what}: pitch", "m/rad"),
        }
        if self.second_axis is not None:
            keep["second_axis"] = values.direction(self.second_axis, f"{what}: second_axis")
        if self.child_at is not None:
            keep["child_at"] = values.vector(self.child_at, f"{what}: child_at", "m")
        if self.limits is not None:
            keep["limits"] = values.vector(self.limits, f"{what}: limits", "rad or m", 2)
        values.keep(self, **keep)
        self._check_child_frame(what)
        self._check_relevant(what)

    def _check_relevant(self, what: str):
        """Refuse fields that have no meaning for the kind of the joint."""
        self._check_second_axis(what)
        if self.limits is not None and (self.pair.n_v != 1 or self.limits[0] >= self.limits[1]):
            raise SceneError(
                f"{what}: limits are the lowest and highest coordinate of a joint of one freedom, got {self.limits} of a "
                f"{self.kind} joint."
            )
        if self.pitch and self.kind != "screw":
            raise SceneError(f"{what}: pitch has no meaning for a {self.kind} joint; only a screw has one.")
        if self.kind == "screw" and not self.pitch:
            raise SceneError(f"{what}: a screw needs a pitch [m/rad] other than 0; use a revolute joint without advance.")
        if np.any(self.rotation) and self.rotation != (0.0, 0.0, 0.0) and self.kind not in ("ball", "free", "fixed"):
            raise SceneError(f"{what}: rotation has no meaning for a {self.kind} joint; give its axis.")

    def _check_child_frame(self, what: str):
        if self.child_frame is not None and (self.frame == "world" or self.child_at is not None):
            raise SceneError(f"{what}: child_frame goes with a frame on the parent, and without child_at.")

    def _check_second_axis(self, what: str):
        if self.second_axis is None:
            return
        if self.kind not in ("universal", "planar"):
            raise SceneError(f"{what}: second_axis has no meaning for a {self.kind} joint.")
        if abs(values.unit(self.axis) @ values.unit(self.second_axis)) > PERPENDICULAR:
            raise SceneError(f"{what}: second_axis {self.second_axis} is not perpendicular to axis {self.axis}.")

    @property
    def pair(self) -> Pair:
        """The kinematic pair: pose map and motion subspace."""
        return screw(self.pitch) if self.kind == "screw" else PAIRS[self.kind]

    def axes(self) -> np.ndarray:
        """Rotation (3, 3) of the joint frame, z along the axis, relative to ``frame``."""
        if self.kind in ("ball", "free", "fixed"):
            return values.rotation_matrix(self.rotation)
        z = values.unit(self.axis)
        if self.second_axis is None:
            return rotations.along(z)
        x = np.asarray(self.second_axis) - z * (z @ np.asarray(self.second_axis))
        x = values.unit(x)
        return rotations.clean(np.column_stack([x, rotations.cross(z, x), z]))


@dataclass(frozen=True)
class Coupling:
    """Ideal coupling of two joint coordinates (gear pair, belt, mimic joint): q_driven = ratio · q_driver + offset.

    Parameters
    ----------
    name : str
        Name of the coupling.
    driven, driver : str
        Joints of one freedom.
    ratio : float
        Rate of the driven coordinate over that of the driver.
    offset : float
        Driven coordinate when the driver is at zero [rad or m].
    """

    name: str
    driven: str
    driver: str
    ratio: float
    offset: float = 0.0

    def __post_init__(self):
        what = f"coupling {values.text(self.name, 'name of a coupling')!r}"
        values.keep(self, ratio=values.number(self.ratio, f"{what}: ratio", "1"))
        values.keep(self, offset=values.number(self.offset, f"{what}: offset", "rad or m"))
        if self.driven == self.driver:
            raise SceneError(f"{what}: joint {self.driven!r} cannot drive itself.")
