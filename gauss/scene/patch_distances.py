"""Gap functions of two solids, or of a solid and terrain, without a closed form: points of their patch of contact."""

from dataclasses import dataclass
from functools import cache, lru_cache

import numpy as np

from gauss.codegen import Expression
from gauss.errors import SceneError
from gauss.rotations import along
from gauss.scene import values
from gauss.scene.box_distances import far
from gauss.scene.collision import Box, Capsule, Collider, HalfSpace, Points
from gauss.scene.contact_distances import FeaturePair, Touch
from gauss.scene.contact_patch import SLOTS, ContactPoint, Solid, SolidPair, SolidPose, solid_of
from gauss.scene.curved_shapes import BoundedCollider
from gauss.scene.height_field import HeightField
from gauss.scene.support_faces import Segment
from gauss.scene.terrain import Terrain
from gauss.scene.terrain_contact import BallOnTerrain, SolidOnTerrain

KEPT = 4096  # patches: all points of one are asked for, also for the pictures of a motion one after the other
PairOfSolids = SolidPair | BallOnTerrain | SolidOnTerrain


@dataclass(frozen=True)
class PatchPoint(FeaturePair):
    """A point of the patch of contact of two solids; far where the patch has fewer, and from terrain that is not near."""

    shape: Collider  # shape, other: the shapes
    other: Collider
    index: int
    corner: int = 0  # which ball of the first shape, where it is a set of points

    @property
    def is_traced(self) -> bool:
        """Never: it takes numbers only."""
        return False

    def touch(self, at) -> Touch:
        """Distance, point and normal, by a view in numbers.

        SceneError if the view is in symbols: the distance is found by iteration.
        """
        poses = _pose(self.shape, at, self.corner), _pose(self.other, at)
        if any(isinstance(entry, Expression) for pose in poses for entry in (*np.ravel(pose.R), *pose.x)):
            raise SceneError(f"{no_closed_form(self.shape, self.other)}; use integrator='time_stepping'.")
        one, other = (np.array([*pose.R.flat, *pose.x], dtype=float).tobytes() for pose in poses)
        found = _patch(self.shape, self.other, one, other, far(at))
        if self.index < len(found):
            return Touch(*found[self.index])
        return Touch(far(at), poses[0].x, np.array([0.0, 0.0, 1.0]))


@lru_cache(maxsize=KEPT)
def _patch(first: Collider, second: Collider, one: bytes, other: bytes, reach: float) -> list[ContactPoint]:
    """Contact points of two shapes by rotations and centres of their solids; those of terrain near the solid alone."""
    pair = solid_pair(first, second)
    a, b = np.frombuffer(one), np.frombuffer(other)
    poses = SolidPose(a[:9].reshape(3, 3), a[9:]), SolidPose(b[:9].reshape(3, 3), b[9:])
    return pair.points(poses[0], poses[1], min(reach, pair.farthest))


def no_closed_form(one: Collider, other: Collider) -> str:
    """Reason why the distance of two shapes is not traced."""
    return f"the distance of {one.what} and {other.what} is found by iteration"


def patch_points(first: Collider, second: Collider) -> list[FeaturePair]:
    """Points of the patch of two shapes."""
    return [PatchPoint(first, second, k) for k in range(SLOTS)]


def feet_points(first: Points, second: Collider) -> list[FeaturePair]:
    """Points of the patches of balls around points and a shape; SceneError if the points have no radius."""
    if not first.is_round:
        raise SceneError(f"{first.what} and {second.what}: points touch it as balls; give them a radius [m].")
    return [PatchPoint(first, second, k, corner) for corner in range(len(first.corners)) for k in range(SLOTS)]


def _pose(shape: Collider, at, corner: int = 0) -> SolidPose:
    axes, centre = _own_pose(shape, corner)
    return SolidPose(at.rotation(shape.body) @ axes, at.position(shape.body, centre))


@cache
def _own_pose(shape: Collider, corner: int) -> SolidPose:
    """Axes and centre of a shape, or of one of its balls, in the frame of its body."""
    if isinstance(shape, Points):
        return SolidPose(np.eye(3), shape.corners[corner])
    return SolidPose(axes_of(shape), np.array(shape.centre if isinstance(shape, BoundedCollider) else shape.at))


def axes_of(shape: Collider) -> np.ndarray:
    """Rotation (3, 3) from the axes of a shape to the frame of its body."""
    if isinstance(shape, BoundedCollider | Box):
        return shape.axes
    if isinstance(shape, Capsule):
        return along(values.unit(shape.axis))
    return along(values.unit(shape.normal)) if isinstance(shape, HalfSpace) else np.eye(3)


@cache
def _solid_at(shape: Collider) -> Solid | None:
    return solid_of(shape)


@cache
def terrain_of(field: HeightField) -> Terrain:
    """Surface of a field, made once."""
    return Terrain(field)


@cache
def solid_pair(first: Collider, second: Collider) -> PairOfSolids:
    """Contact points of two shapes in their own axes, made once."""
    solid = _solid_at(first)
    assert solid is not None
    if not isinstance(second, HeightField):
        return SolidPair(solid, _solid_at(second))
    terrain = terrain_of(second)
    if isinstance(solid, Segment) and not solid.half:
        return BallOnTerrain(solid, terrain)
    return SolidOnTerrain(solid, terrain)
