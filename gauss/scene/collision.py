"""Collision shapes of bodies: sphere, capsule, box, points such as feet, and the half-space."""

from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from typing import ClassVar

import numpy as np

from gauss.errors import SceneError
from gauss.scene import values

KEPT = 4096  # rotations of boxes


@dataclass(frozen=True)
class Collider:
    """Collision shape fixed to a body; contacts name the pairs that may touch.

    Parameters
    ----------
    name : str
        Name of the shape.
    body : str
        Body or named frame that carries it, or "ground".
    at : array_like, shape (3,)
        Its centre, in that frame [m].
    """

    name: str
    body: str
    at: tuple = (0.0, 0.0, 0.0)

    kind: ClassVar[str] = "shape"

    def __post_init__(self):
        values.text(self.name, f"name of a {self.kind}")
        values.keep(self, at=values.vector(self.at, f"{self.what}: at", "m"))

    @property
    def what(self) -> str:
        """Its name in messages."""
        return f"{self.kind} {self.name!r}"

    @property
    def radius(self) -> float:
        """Radius [m] by which the shape exceeds the hull of its corners."""
        return 0.0

    @property
    def is_round(self) -> bool:
        """Whether the shape exceeds the hull of its corners."""
        return bool(self.radius)

    @property
    def corners(self) -> np.ndarray:
        """Points (k, 3) in the frame of the body [m]: the shape is their hull, thickened by its radius."""
        return np.array([self.at])

    def places(self, at) -> list:
        """The corners in world axes, by a view of the mechanism."""
        return [at.position(self.body, corner) for corner in self.corners]

    def _keep_length(self, key: str, **condition):
        values.keep(self, **{key: values.number(getattr(self, key), f"{self.what}: {key}", "m", **condition)})


@dataclass(frozen=True)
class Sphere(Collider):
    """Ball around ``at``.

    Parameters
    ----------
    radius : float
        [m].
    """

    radius: float = 0.0

    kind: ClassVar[str] = "sphere"

    def __post_init__(self):
        super().__post_init__()
        self._keep_length("radius", positive=True)

    @property
    def is_round(self) -> bool:
        """Always."""
        return True


@dataclass(frozen=True)
class Capsule(Collider):
    """Cylinder with round ends around ``at``.

    Parameters
    ----------
    radius : float
        Of the cylinder and of its ends [m].
    length : float
        Between the centres of the ends [m].
    axis : array_like, shape (3,)
        Of the cylinder, in the frame of the body.
    """

    radius: float = 0.0
    length: float = 0.0
    axis: tuple = (0.0, 0.0, 1.0)

    kind: ClassVar[str] = "capsule"

    def __post_init__(self):
        super().__post_init__()
        self._keep_length("radius", positive=True)
        self._keep_length("length", positive=True)
        values.keep(self, axis=values.direction(self.axis, f"{self.what}: axis"))

    @property
    def is_round(self) -> bool:
        """Always."""
        return True

    @property
    def corners(self) -> np.ndarray:
        """Centres of the ends."""
        half = 0.5 * self.length * values.unit(self.axis)
        return np.array(self.at) + np.array([-half, half])


@dataclass(frozen=True)
class Box(Collider):
    """Box around ``at``.

    Parameters
    ----------
    size : array_like, shape (3,)
        Edges [m].
    rotation : array_like
        Axes of its edges, from the frame of the body.
    """

    size: tuple = (0.0, 0.0, 0.0)
    rotation: tuple = (0.0, 0.0, 0.0)

    kind: ClassVar[str] = "box"

    def __post_init__(self):
        super().__post_init__()
        values.keep(self, size=values.vector(self.size, f"{self.what}: size", "m"))
        values.keep(self, rotation=values.rotation(self.rotation, f"{self.what}: rotation"))
        if min(self.size) <= 0.0:
            raise SceneError(f"{self.what}: size is three edges > 0 [m], got {self.size}.")

    @property
    def axes(self) -> np.ndarray:
        """Rotation (3, 3) from its edges to the frame of the body."""
        return _axes(self.rotation)

    @property
    def corners(self) -> np.ndarray:
        """Its eight corners."""
        half = np.array(list(product((-0.5, 0.5), repeat=3))) * self.size
        return np.array(self.at) + half @ self.axes.T


@lru_cache(maxsize=KEPT)
def _axes(rotation: tuple) -> np.ndarray:
    """Rotation matrix (3, 3) of a box, not to be written to: gap functions ask for it in every state."""
    found = values.rotation_matrix(rotation)
    found.flags.writeable = False
    return found


@dataclass(frozen=True)
class Points(Collider):
    """Points of a body, or balls around them: its feet.

    Parameters
    ----------
    points : sequence of array_like, shape (3,)
        The points, from ``at`` [m].
    radius : float
        Radius of the balls around the points [m].
    """

    points: tuple = ((0.0, 0.0, 0.0),)
    radius: float = 0.0

    kind: ClassVar[str] = "points"

    def __post_init__(self):
        super().__post_init__()
        try:
            points = tuple(values.vector(point, f"{self.what}: points", "m") for point in self.points)
        except TypeError:
            points = ()
        if not points:
            raise SceneError(f"{self.what}: points is a list of points [m], for instance [[0, 0, 0]], got {self.points!r}.")
        values.keep(self, points=points)
        self._keep_length("radius", non_negative=True)

    @property
    def corners(self) -> np.ndarray:
        """The points."""
        return np.array(self.at) + np.array(self.points)


@dataclass(frozen=True)
class HalfSpace(Collider):
    """Everything behind a plane through ``at``: a floor, a wall, the face of a wedge.

    Parameters
    ----------
    normal : array_like, shape (3,)
        Outward normal of the plane, in the frame of the body.
    """

    normal: tuple = (0.0, 0.0, 1.0)

    kind: ClassVar[str] = "half-space"

    def __post_init__(self):
        super().__post_init__()
        values.keep(self, normal=values.direction(self.normal, f"{self.what}: normal"))

    def outward(self, at) -> np.ndarray:
        """Normal (3,) in world axes."""
        return at.rotation(self.body) @ values.unit(self.normal)
