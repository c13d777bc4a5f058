"""Unilateral contact of two shapes, 0 ≤ g_N ⊥ λ_N ≥ 0, with Coulomb friction |λ_T| ≤ μ λ_N (Brogliato)."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from gauss import math
from gauss.errors import SceneError
from gauss.rotations import cross
from gauss.scene import values
from gauss.scene.box_distances import separation
from gauss.scene.contact_distances import FeaturePair, Touch
from gauss.scene.contact_pairs import have_edges, place_count, places
from gauss.scene.relation import Relation
from gauss.scene.unilateral import Unilateral

STEEP_NORMAL = 0.5  # squared component of a unit normal along x, above which the tangent is found from the y-axis


@dataclass(frozen=True)
class Contact(Unilateral):
    """Two shapes that may touch, with Coulomb friction where a coefficient is given.

    Parameters
    ----------
    name : str
        Name of the contact.
    shape, other : str
        The two shapes.
    restitution : float
        Speed after an impact over that before it, 0 to 1.
    friction: float
        Coefficient μ ≥ 0 of Coulomb friction, the same at rest and while sliding. Friction is integrated by
        ``integrator="time_stepping"``.
    """

    shape: str
    other: str
    restitution: float = 0.0
    friction: float = 0.0

    shapes: ClassVar[tuple[str, ...]] = ("shape", "other")

    def __post_init__(self):
        values.text(self.name, "name of a contact")
        if self.shape == self.other:
            raise SceneError(f"{self.what}: a shape does not touch itself; name two.")
        self._keep_restitution()
        values.keep(self, friction=values.number(self.friction, f"{self.what}: friction", "1", non_negative=True))

    def between(self, name: str, shape: str, other: str) -> "Contact":
        """The same contact of two other shapes, named as those of a scene are: they are not checked again."""
        found = object.__new__(Contact)
        vars(found).update(vars(self), name=name, shape=shape, other=other)
        return found

    def sides(self, scene) -> tuple[str, ...]:
        """Names of the gap functions: that of the contact, numbered from 1 if there are several."""
        if scene.shapes[self.shape].body == scene.shapes[self.other].body:
            raise SceneError(f"{self.what}: both shapes are on {scene.shapes[self.shape].body!r}; they never move apart.")
        number = place_count(scene.shapes[self.shape], scene.shapes[self.other])
        return (self.name,) if number == 1 else tuple(f"{self.name}.{k + 1}" for k in range(number))

    def gaps(self, at) -> list:
        """Contact distances of all pairs of features."""
        return [place.touch(at).gap for place in self.places(at.system.scene)]

    def position_residual_of(self, at, index: int):
        """Contact distance of one pair of features."""
        return self.touch(at, index).gap

    def touch(self, at, index: int) -> Touch:
        """Contact distance, point and normal of one pair of features."""
        return self.places(at.system.scene)[index].touch(at)

    def fixed(self, at, index: int) -> FeaturePair | None:
        """One pair with the features that touch; None if its features never change."""
        return self.places(at.system.scene)[index].fixed(at)

    def places(self, scene) -> list[FeaturePair]:
        """Pairs of features that may touch."""
        return places(scene.shapes[self.shape], scene.shapes[self.other])

    def guards(self, scene) -> "list[Guard]":
        """Its distance as a whole, where its gap functions might miss an overlap."""
        return [Guard(self.name, self)] if have_edges(scene.shapes[self.shape], scene.shapes[self.other]) else []


@dataclass(frozen=True)
class Guard(Relation):
    """Distance of the shapes of a contact as a whole: it is negative for any overlap, whatever the features.

    Parameters
    ----------
    name : str
        Name of the contact.
    whole : Contact
        The contact.
    """

    whole: Contact

    def positions(self, at) -> list:
        """Separation of the shapes [m]."""
        shapes = at.system.scene.shapes
        return [separation(shapes[self.whole.shape], shapes[self.whole.other], at)]


@dataclass(frozen=True)
class Slip(Relation):
    """Tangential velocity at one contact distance, as a constraint of its own: it is zero while the contact sticks.

    Parameters
    ----------
    name : str
        Name of the gap function.
    whole : Contact
        The contact.
    index : int
        Index of its gap function.
    """

    whole: Contact
    index: int

    def velocities(self, at) -> list:
        """Velocity of the first body relative to the second at the contact point, along two tangential directions."""
        touch, shapes = self.whole.touch(at, self.index), at.system.scene.shapes
        first, second = (at.velocity_at(shapes[name].body, touch.place) for name in (self.whole.shape, self.whole.other))
        return [along @ (first - second) for along in tangents(touch.normal)]


def tangents(normal) -> tuple[np.ndarray, np.ndarray]:
    """Two unit tangents: perpendicular to the normal and the x-axis, or the y-axis where the normal is near x; and both."""
    x, y, z = normal
    steep = x * x > STEEP_NORMAL
    across = [math.where(steep, along, other) for along, other in ((-z, 0.0), (0.0, z), (x, -y))]
    first = np.array(across) / np.sqrt(math.where(steep, x * x, y * y) + z * z)
    return first, cross(normal, first)
