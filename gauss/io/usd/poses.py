"""Numbers, units and poses of a USD stage in SI units: bodies and joint frames without the scales of their prims."""

from dataclasses import dataclass

import numpy as np

from gauss import rotations
from gauss.errors import FileError, extra
from gauss.io.guard import LARGEST_MAGNITUDE

with extra("usd"):
    from pxr import Usd, UsdGeom, UsdPhysics


@dataclass(frozen=True)
class FramePose:
    """Place of a frame: origin (3,) [m] and axes (3, 3), columns."""

    p: np.ndarray
    R: np.ndarray

    def __matmul__(self, other: "FramePose") -> "FramePose":
        return FramePose(self.p + self.R @ other.p, self.R @ other.R)

    @property
    def inverse(self) -> "FramePose":
        """Place of the world in this frame."""
        return FramePose(-self.R.T @ self.p, self.R.T)


GROUND_POSE = FramePose(np.zeros(3), np.eye(3))


class StageUnits:
    """Units of a stage, and the poses of its prims in the world.

    Parameters
    ----------
    stage : Usd.Stage
        The stage.
    """

    def __init__(self, stage: Usd.Stage):
        self.length, self.mass = UsdGeom.GetStageMetersPerUnit(stage), UsdPhysics.GetStageKilogramsPerUnit(stage)
        self._cache = UsdGeom.XformCache(Usd.TimeCode.Default())

    def pose(self, prim: Usd.Prim) -> FramePose:
        """FramePose of a prim in the world."""
        return FramePose(self.point(prim, (0.0, 0.0, 0.0)), self.axes(prim))

    def axes(self, prim: Usd.Prim) -> np.ndarray:
        """Axes (3, 3) of a prim in the world."""
        rotation = self._cache.GetLocalToWorldTransform(prim).RemoveScaleShear().ExtractRotationMatrix()
        return rotations.clean(np.array(rotation).T)

    def point(self, prim: Usd.Prim, at) -> np.ndarray:
        """Point (3,) of the world [m] from one in the frame of a prim, which its scale moves."""
        moved = self._cache.GetLocalToWorldTransform(prim).Transform(tuple(map(float, at)))
        return checked(prim, np.array(moved) * self.length)

    def local(self, prim: Usd.Prim, at, quaternion) -> FramePose:
        """Frame of a joint in the body of a prim, from its place in the frame of the prim."""
        body = self.pose(prim)
        return FramePose(body.R.T @ (self.point(prim, at) - body.p), matrix(prim, quaternion))


def matrix(prim: Usd.Prim, quaternion) -> np.ndarray:
    """Axes (3, 3) of a quaternion of USD; the identity for one that is zero, which means none."""
    Q = checked(prim, np.array([quaternion.GetReal(), *quaternion.GetImaginary()], dtype=float))
    size = np.linalg.norm(Q)
    return rotations.clean(rotations.from_quaternion(Q / size)) if size else np.eye(3)


def checked(prim: Usd.Prim, numbers: np.ndarray) -> np.ndarray:
    """Finite numbers of a prim.

    Raises
    ------
    FileError
        If one is not finite, or beyond reason.
    """
    if not (np.abs(numbers) <= LARGEST_MAGNITUDE).all():
        raise FileError(f"{prim.GetPath()}: expected finite numbers up to {LARGEST_MAGNITUDE:g}, got {numbers.tolist()}.")
    return numbers
