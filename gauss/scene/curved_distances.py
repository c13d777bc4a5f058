"""Gap functions of ellipsoids and of the rims of cylinders and cones over a half-space."""

from dataclasses import dataclass

import numpy as np

from gauss import math
from gauss.scene.collision import HalfSpace
from gauss.scene.contact_distances import FeaturePair, Touch
from gauss.scene.curved_shapes import Cone, Cylinder, Ellipsoid

UPRIGHT = 1e-6  # sine of the tilt of a rim against a plane below which no point of it is the lowest
QUARTERS = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))  # directions of the points fixed to a rim
LOWEST = (0.0, 0.0)  # in place of a direction: the lowest point of a rim


@dataclass(frozen=True)
class EllipsoidOnHalfSpace(FeaturePair):
    """Ellipsoid over a half-space: the height of its lowest point, c − D² u/|D u| with u the normal in its axes."""

    shape: Ellipsoid
    ground: HalfSpace

    def touch(self, at) -> Touch:
        """Height of the lowest point."""
        axes, radii = at.rotation(self.shape.body) @ self.shape.axes, self.shape.half_edges
        normal = self.ground.outward(at)
        stretched = radii * (axes.T @ normal)
        down = radii * stretched / np.sqrt(stretched @ stretched)
        return _height(at, at.position(self.shape.body, self.shape.centre) - axes @ down, normal, self.ground)


@dataclass(frozen=True)
class RimOnHalfSpace(FeaturePair):
    """A point of the rim of a cylinder or cone over a half-space.

    The lowest point of the rim moves along it, the faster the less the rim is tilted; a solid that stands rests on points
    that are fixed to the rim.
    """

    shape: Cylinder | Cone  # the solid
    ground: HalfSpace
    side: int  # on which end of its axis the rim lies, −1 or 1
    direction: tuple = LOWEST  # cosine and sine of the angle of a point fixed to the rim; (0, 0) for the lowest point

    @property
    def is_traced(self) -> bool:
        """Never: its lowest point moves fast where it is upright."""
        return False

    def touch(self, at) -> Touch:
        """Height of the point."""
        axes, half, normal = at.rotation(self.shape.body) @ self.shape.axes, self.shape.half_edges, self.ground.outward(at)
        x, y = -(axes.T @ normal)[:2]
        c, s = self.direction
        fixed = c * c + s * s
        tilt = x * x + y * y
        turned = math.where(tilt > UPRIGHT**2, 1.0, 0.0)
        length = np.sqrt(math.where(tilt > UPRIGHT**2, tilt, 1.0))
        lowest = [turned * x / length + (1.0 - turned), turned * y / length]
        along = [fixed * c + (1.0 - fixed) * lowest[0], fixed * s + (1.0 - fixed) * lowest[1]]
        point = np.array([half[0] * along[0], half[1] * along[1], self.side * half[2]])
        return _height(at, at.position(self.shape.body, self.shape.centre) + axes @ point, normal, self.ground)


@dataclass(frozen=True)
class ApexOnHalfSpace(FeaturePair):
    """Apex of a cone over a half-space."""

    shape: Cone
    ground: HalfSpace

    def touch(self, at) -> Touch:
        """Height of the apex."""
        axis = (at.rotation(self.shape.body) @ self.shape.axes)[:, 2]
        apex = at.position(self.shape.body, self.shape.centre) + self.shape.half_edges[2] * axis
        return _height(at, apex, self.ground.outward(at), self.ground)


def rim(shape, ground: HalfSpace, side: int) -> list[FeaturePair]:
    """Points of one rim: the lowest, and those fixed to it."""
    return [RimOnHalfSpace(shape, ground, side, direction) for direction in (LOWEST, *QUARTERS)]


def _height(at, point, normal, ground: HalfSpace) -> Touch:
    height = normal @ (point - at.position(ground.body, ground.at))
    return Touch(height, point - height * normal, normal)
