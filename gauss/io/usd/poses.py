"""Numbers, units and poses of a USD stage in SI units: bodies and joint frames without the scales of their prims."""

from dataclasses import dataclass

import numpy as np

from gauss import rotations
from gauss.errors import FileError, extra
from gauss.io.guard import LARGEST_MAGNITUDE

with extra("usd"):
    from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics

UNIT_QUATERNION = 1e-3  # of half-precision numbers
RIGHT_ANGLE = 1e-4  # cosine between axes, of scales and rotations in single precision


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
    """Units of a stage, and the poses of its prims in the world."""

    def __init__(self, stage: Usd.Stage):
        self.length, self.mass = UsdGeom.GetStageMetersPerUnit(stage), UsdPhysics.GetStageKilogramsPerUnit(stage)
        for name, unit in (("metersPerUnit", self.length), ("kilogramsPerUnit", self.mass)):
            if not 0.0 < unit <= LARGEST_MAGNITUDE:
                raise FileError(f"{name}: expected a number above zero, got {unit}.")
        self._cache = UsdGeom.XformCache(Usd.TimeCode.Default())
        self._checked = set[Sdf.Path]()

    def pose(self, prim: Usd.Prim) -> FramePose:
        """FramePose of a prim in the world."""
        return FramePose(self.point(prim, (0.0, 0.0, 0.0)), self.axes(prim))

    def axes(self, prim: Usd.Prim) -> np.ndarray:
        """Axes (3, 3) of a prim in the world."""
        rotation = self._transform(prim).RemoveScaleShear().ExtractRotationMatrix()
        return rotations.clean(np.array(rotation).T)

    def point(self, prim: Usd.Prim, at) -> np.ndarray:
        """Point (3,) of the world [m] from one in the frame of a prim, which its scale moves."""
        moved = self._transform(prim).Transform(tuple(map(float, at)))
        return checked(prim, np.array(moved) * self.length)

    def _transform(self, prim: Usd.Prim) -> Gf.Matrix4d:
        """Place of a prim in the world.

        FileError if it has no axes of its own, as where it is mirrored or sheared, or changes with time.
        """
        if prim.GetPath() not in self._checked:
            above = prim
            while above and not above.IsPseudoRoot():
                _check_operations(above)
                above = above.GetParent()
            _check_axes(prim, np.array(self._cache.GetLocalToWorldTransform(prim))[:3, :3])
            self._checked.add(prim.GetPath())
        return self._cache.GetLocalToWorldTransform(prim)

    def local(self, prim: Usd.Prim, at, quaternion) -> FramePose:
        """Frame of a joint in the body of a prim, from its place in the frame of the prim."""
        body = self.pose(prim)
        return FramePose(body.R.T @ (self.point(prim, at) - body.p), matrix(prim, quaternion))


def _check_operations(prim: Usd.Prim):
    """Refuse operations of a transform that change with time, and quaternions of which USD makes another rotation."""
    for operation in UsdGeom.Xformable(prim).GetOrderedXformOps() if prim.IsA(UsdGeom.Xformable) else ():
        if operation.GetNumTimeSamples():
            raise FileError(f"{prim.GetPath()}: {operation.GetOpName()} changes with time; write one value without time.")
        turned = operation.Get() if operation.GetOpType() == UsdGeom.XformOp.TypeOrient else None
        if turned is not None and not abs(turned.GetLength() - 1.0) <= UNIT_QUATERNION:
            where, length = f"{prim.GetPath()}: {operation.GetOpName()}", turned.GetLength()
            raise FileError(f"{where}: expected a quaternion of length 1, got {length:.6g}.")


def _check_axes(prim: Usd.Prim, rows: np.ndarray):
    """Refuse axes (3, 3), in rows, that are not at right angles, left-handed or of no length."""
    sizes = np.linalg.norm(rows, axis=1)
    if not (np.isfinite(sizes).all() and sizes.all()):
        raise FileError(f"{prim.GetPath()}: expected a scale of finite numbers other than zero, got {sizes.tolist()}.")
    unit = rows / sizes[:, None]
    if abs(unit @ unit.T - np.eye(3)).max() > RIGHT_ANGLE or np.linalg.det(unit) < 0.0:
        raise FileError(f"{prim.GetPath()}: its transform mirrors or shears it, so that a body in it has no axes.")


def number(prim: Usd.Prim, attribute: Usd.Attribute, largest: float = LARGEST_MAGNITUDE) -> float:
    """Number of an attribute; zero where it has none.

    FileError if it is not a number, or beyond the largest.
    """
    value = float(attribute.Get() or 0.0)
    if not abs(value) <= largest:
        raise FileError(f"{prim.GetPath()}: {attribute.GetName()}: expected a number up to {largest:g}, got {value}.")
    return value


def matrix(prim: Usd.Prim, quaternion) -> np.ndarray:
    """Axes (3, 3) of a quaternion of USD; the identity for one that is zero, which means none."""
    Q = checked(prim, np.array([quaternion.GetReal(), *quaternion.GetImaginary()], dtype=float))
    size = np.linalg.norm(Q)
    return rotations.clean(rotations.from_quaternion(Q / size)) if size else np.eye(3)


def checked(prim: Usd.Prim, numbers: np.ndarray) -> np.ndarray:
    """Finite numbers of a prim.

    FileError if one is not finite, or beyond reason.
    """
    if not (np.abs(numbers) <= LARGEST_MAGNITUDE).all():
        raise FileError(f"{prim.GetPath()}: expected finite numbers up to {LARGEST_MAGNITUDE:g}, got {numbers.tolist()}.")
    return numbers
