"""Collision shapes with curved surfaces: ellipsoid, cylinder and cone."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from gauss import rotations
from gauss.errors import SceneError
from gauss.scene import values
from gauss.scene.collision import Collider


class BoundedCollider(Collider, ABC):
    """Shape within a box around its centre, ``half_edges`` (3,) along its ``axes`` (3, 3) [m]."""

    @property
    @abstractmethod
    def half_edges(self) -> np.ndarray:
        """Half edges (3,) of that box [m]."""

    @property
    @abstractmethod
    def axes(self) -> np.ndarray:
        """Rotation (3, 3) from its edges to the frame of the body."""

    @property
    def is_round(self) -> bool:
        """Never: its corners are those of the box around it."""
        return False

    @property
    def centre(self) -> np.ndarray:
        """Middle (3,) of that box, in the frame of the body [m]."""
        return np.array(self.at)

    @property
    def corners(self) -> np.ndarray:
        """Corners (8, 3) of that box in the frame of the body [m]."""
        signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1], indexing="ij")).reshape(3, -1).T
        return self.centre + signs * self.half_edges @ self.axes.T


class ConvexCollider(BoundedCollider):
    """Convex shape within a box around its centre."""


@dataclass(frozen=True)
class Ellipsoid(ConvexCollider):
    """Ellipsoid around ``at``.

    Parameters
    ----------
    radii : array_like, shape (3,)
        Half axes [m].
    rotation : array_like
        Of its axes, from the frame of the body.
    """

    radii: tuple = (0.0, 0.0, 0.0)
    rotation: tuple = (0.0, 0.0, 0.0)

    kind: ClassVar[str] = "ellipsoid"

    def __post_init__(self):
        super().__post_init__()
        values.keep(self, radii=values.vector(self.radii, f"{self.what}: radii", "m"))
        values.keep(self, rotation=values.rotation(self.rotation, f"{self.what}: rotation"))
        if min(self.radii) <= 0.0:
            raise SceneError(f"{self.what}: radii are three half axes > 0 [m], got {self.radii}.")

    @property
    def axes(self) -> np.ndarray:
        """Rotation (3, 3) from its axes to the frame of the body."""
        return values.rotation_matrix(self.rotation)

    @property
    def half_edges(self) -> np.ndarray:
        """Its half axes (3,) [m]."""
        return np.array(self.radii)


@dataclass(frozen=True)
class _Turned(ConvexCollider):
    """Solid of revolution around ``at``, the middle of its axis."""

    radius: float = 0.0
    length: float = 0.0
    axis: tuple = (0.0, 0.0, 1.0)

    def __post_init__(self):
        super().__post_init__()
        self._keep_length("radius", positive=True)
        self._keep_length("length", positive=True)
        values.keep(self, axis=values.direction(self.axis, f"{self.what}: axis"))

    @property
    def axes(self) -> np.ndarray:
        """Rotation (3, 3) to the frame of the body, of axes of which the last is its own."""
        return rotations.along(values.unit(self.axis))

    @property
    def half_edges(self) -> np.ndarray:
        """Radius twice, and half its length (3,) [m]."""
        return np.array([self.radius, self.radius, 0.5 * self.length])


@dataclass(frozen=True)
class Cylinder(_Turned):
    """Cylinder with flat ends.

    Parameters
    ----------
    radius : float
        Radius of its ends [m].
    length : float
        Between its ends [m].
    axis : array_like, shape (3,)
        Its axis, in the frame of the body.
    """

    kind: ClassVar[str] = "cylinder"


@dataclass(frozen=True)
class Cone(_Turned):
    """Cone around ``at``, the middle between base and apex.

    Parameters
    ----------
    radius : float
        Radius of its base [m].
    length : float
        From its base to its apex [m].
    axis : array_like, shape (3,)
        From its base to its apex, in the frame of the body.
    """

    kind: ClassVar[str] = "cone"
