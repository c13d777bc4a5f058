"""Gap functions of two solids without a closed form, in numbers: points of their patch of contact."""

from dataclasses import dataclass

import numpy as np

from gauss.codegen import Expression
from gauss.errors import SceneError
from gauss.rotations import along
from gauss.scene import values
from gauss.scene.box_distances import far
from gauss.scene.collision import Box, Capsule, Collider, HalfSpace, Points
from gauss.scene.contact_distances import FeaturePair, Touch
from gauss.scene.contact_patch import SLOTS, SolidPose
from gauss.scene.curved_shapes import BoundedCollider
from gauss.scene.solid_pairs import solid_pair


@dataclass(frozen=True)
class PatchPoint(FeaturePair):
    """A point of the patch of contact of two solids; far where the patch has fewer.

    Parameters
    ----------
    shape, other : Collider
        The shapes.
    index : int
        Which point.
    corner : int
        Which ball of the first shape, where it is a set of points.
    """

    shape: Collider
    other: Collider
    index: int
    corner: int = 0

    @property
    def is_traced(self) -> bool:
        """Never: it takes numbers only."""
        return False

    def touch(self, at) -> Touch:
        """Distance, point and normal, by a view in numbers.

        Raises
        ------
        SceneError
            If the view is in symbols: the distance is found by iteration.
        """
        poses = _pose(self.shape, at, self.corner), _pose(self.other, at)
        if any(isinstance(entry, Expression) for pose in poses for entry in (*np.ravel(pose.R), *pose.x)):
            raise SceneError(f"{no_closed_form(self.shape, self.other)}; use integrator='time_stepping'.")
        found = solid_pair(self.shape, self.other).points(*poses, far(at))
        if self.index < len(found):
            return Touch(*found[self.index])
        return Touch(far(at), poses[0].x, np.array([0.0, 0.0, 1.0]))


def no_closed_form(one: Collider, other: Collider) -> str:
    """Reason why the distance of two shapes is not traced."""
    return f"the distance of {one.what} and {other.what} is found by iteration"


def patch_points(first: Collider, second: Collider) -> list[FeaturePair]:
    """Points of the patch of two shapes."""
    return [PatchPoint(first, second, k) for k in range(SLOTS)]


def feet_points(first: Points, second: Collider) -> list[FeaturePair]:
    """Points of the patches of balls around points and a shape.

    Raises
    ------
    SceneError
        If the points have no radius.
    """
    if not first.is_round:
        raise SceneError(f"{first.what} and {second.what}: points touch it as balls; give them a radius [m].")
    return [PatchPoint(first, second, k, corner) for corner in range(len(first.corners)) for k in range(SLOTS)]


def _pose(shape: Collider, at, corner: int = 0) -> SolidPose:
    if isinstance(shape, Points):
        return SolidPose(at.rotation(shape.body), at.position(shape.body, shape.corners[corner]))
    centre = shape.centre if isinstance(shape, BoundedCollider) else shape.at
    return SolidPose(at.rotation(shape.body) @ axes_of(shape), at.position(shape.body, centre))


def axes_of(shape: Collider) -> np.ndarray:
    """Rotation (3, 3) from the axes of a shape to the frame of its body."""
    if isinstance(shape, BoundedCollider | Box):
        return shape.axes
    if isinstance(shape, Capsule):
        return along(values.unit(shape.axis))
    return along(values.unit(shape.normal)) if isinstance(shape, HalfSpace) else np.eye(3)
