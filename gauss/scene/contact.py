"""Contact of two shapes: they do not enter each other, and friction resists their sliding."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from gauss import math
from gauss.errors import SceneError
from gauss.rotations import cross
from gauss.scene import values
from gauss.scene.box_distances import separation
from gauss.scene.contact_distances import Place, Touch
from gauss.scene.contact_pairs import have_edges, places
from gauss.scene.relation import Relation
from gauss.scene.unilateral import OneSided

STEEP = 0.5  # squared component of a normal along an axis above which another axis serves to find a tangent


@dataclass(frozen=True)
class Contact(OneSided):
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
        """Check every value."""
        values.text(self.name, "name of a contact")
        if self.shape == self.other:
            raise SceneError(f"{self.what}: a shape does not touch itself; name two.")
        self._keep_restitution()
        self._keep(friction=values.number(self.friction, f"{self.what}: friction", "1", non_negative=True))

    def sides(self, scene) -> tuple[str, ...]:
        """Names of the gaps: that of the contact, numbered from 1 if there are many places."""
        if scene.shapes[self.shape].body == scene.shapes[self.other].body:
            raise SceneError(f"{self.what}: both shapes are on {scene.shapes[self.shape].body!r}; they never move apart.")
        number = len(self.places(scene))
        return (self.name,) if number == 1 else tuple(f"{self.name}.{k + 1}" for k in range(number))

    def gaps(self, at) -> list:
        """Distances of the places that may touch."""
        return [place.touch(at).gap for place in self.places(at.system.scene)]

    def position_residual_of(self, at, index: int):
        """Distance of one of these places."""
        return self.touch(at, index).gap

    def touch(self, at, index: int) -> Touch:
        """What is found at one of these places."""
        return self.places(at.system.scene)[index].touch(at)

    def fixed(self, at, index: int) -> Place | None:
        """One of these places with the features that touch; None if it needs no such."""
        return self.places(at.system.scene)[index].fixed(at)

    def places(self, scene) -> list[Place]:
        """Places where the shapes may touch."""
        return places(scene.shapes[self.shape], scene.shapes[self.other])

    def guards(self, scene) -> "list[Guard]":
        """Its distance as a whole, where its gaps might miss an overlap."""
        return [Guard(self.name, self)] if have_edges(scene.shapes[self.shape], scene.shapes[self.other]) else []


@dataclass(frozen=True)
class Guard(Relation):
    """Distance of the shapes of a contact as a whole, which sees them overlap whatever features they have there.

    Parameters
    ----------
    name : str
        Name of the contact.
    whole : Contact
        What it guards.
    """

    whole: Contact

    def positions(self, at) -> list:
        """How far they are apart."""
        shapes = at.system.scene.shapes
        return [separation(shapes[self.whole.shape], shapes[self.whole.other], at)]


@dataclass(frozen=True)
class Slip(Relation):
    """Sliding at one gap of a contact, as a constraint of its own: what sticking is.

    Parameters
    ----------
    name : str
        Name of the gap.
    whole : Contact
        What it belongs to.
    index : int
        Which of its gaps it is.
    """

    whole: Contact
    index: int

    def velocities(self, at) -> list:
        """Velocity of the first body at the place against the second, along two directions of the tangent plane."""
        touch, shapes = self.whole.touch(at, self.index), at.system.scene.shapes
        first, second = (at.velocity_at(shapes[name].body, touch.place) for name in (self.whole.shape, self.whole.other))
        across = _across(touch.normal)
        return [along @ (first - second) for along in (across, cross(touch.normal, across))]


def _across(normal) -> np.ndarray:
    """A unit vector across a normal: away from the x-axis, or from the y-axis where that is too near."""
    x, y, z = normal
    steep = x * x > STEEP
    across = [math.where(steep, along, other) for along, other in ((-z, 0.0), (0.0, z), (x, -y))]
    return np.array(across) / np.sqrt(math.where(steep, x * x, y * y) + z * z)
