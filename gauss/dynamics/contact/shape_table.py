"""Shapes of a system as arrays, and the laws of their pairs."""

from functools import cached_property
from typing import NamedTuple

import numpy as np

from gauss.dynamics.contact.pair_kernels import SIZES
from gauss.rotations import along
from gauss.scene import (
    Box,
    Capsule,
    Collider,
    Cone,
    Contact,
    ConvexMesh,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    HeightField,
    Points,
    Sphere,
)
from gauss.scene.curved_shapes import BoundedCollider
from gauss.scene.values import unit
from gauss.system import System

KINDS = (Sphere, Capsule, Box, Ellipsoid, Cylinder, Cone, ConvexMesh, HalfSpace, HeightField)
MOST_FEATURES = 64  # pairs of features of one pair of parts, for keys of contacts
RANK = {kind: k for k, kind in enumerate(KINDS)}  # the order of kinds in a rule of contacts


class ConvexPart(NamedTuple):
    """Convex part of a shape."""

    shape: str  # name of the shape
    kind: type  # one of ``KINDS``
    body: int  # its body; −1 is the ground
    rotation: np.ndarray  # rotation, centre: its axes (3, 3) and centre (3,) in the principal central frame of the body
    centre: np.ndarray
    sizes: np.ndarray  # (4,) half edges of the box around it, or half length as the last one; radius beyond it [m]


def convex_parts(system: System, shape: Collider) -> list[ConvexPart]:
    """Convex parts of a shape: each point of its own, any other shape as it is."""
    frame = system.frame(shape.body)
    centres = shape.corners if isinstance(shape, Points) else np.array([shape.at])
    kind, axes, half = Sphere if isinstance(shape, Points) else type(shape), np.eye(3), np.zeros(3)
    if isinstance(shape, Box):
        axes, half = shape.axes, 0.5 * np.array(shape.size)
    elif isinstance(shape, Capsule):
        axes, half = along(unit(shape.axis)), np.array([0.0, 0.0, 0.5 * shape.length])
    elif isinstance(shape, HalfSpace):
        axes = along(unit(shape.normal))
    elif isinstance(shape, BoundedCollider):
        axes, half, centres = shape.axes, shape.half_edges, shape.centre[None]
    sizes = np.append(half, 0.0 if isinstance(shape, BoundedCollider) else shape.radius)
    places = [(frame.R @ axes, frame.p + frame.R @ centre) for centre in centres]
    return [ConvexPart(shape.name, kind, frame.body, *place, sizes) for place in places]


def _parts(system: System, contacts: list[Contact]) -> list[ConvexPart]:
    """Convex parts of the shapes of contacts, in the order of kinds: pairs are then in the order of a rule."""
    names = dict.fromkeys(name for contact in contacts for name in (contact.shape, contact.other))
    parts = [part for name in names for part in convex_parts(system, system.scene.shapes[name])]
    return sorted(parts, key=lambda part: RANK[part.kind])


def carriers_of(system: System) -> tuple[int, ...]:
    """Bodies that carry shapes of contacts, without the ground."""
    contacts = [contact for contact in system.scene.contacts.values() if isinstance(contact, Contact)]
    shapes = {system.scene.shapes[name].body for contact in contacts for name in (contact.shape, contact.other)}
    return tuple(sorted({body for shape in shapes if (body := system.frame(shape).body) >= 0}))


class ShapeTable:
    """Convex parts of the shapes of a system that take part in contacts, as arrays with one column for each part.

    Parameters
    ----------
    system : System
        The system; all of its unilateral constraints are contacts of shapes.

    Attributes
    ----------
    parts : list of ConvexPart
        The parts.
    body : ndarray of int, shape (k,)
        Their bodies, −1 for the ground.
    law : ndarray of int, shape (k, k)
        1 + the number of the contact of two parts, 0 where they have none.
    friction, restitution : ndarray
        Coefficients of each contact.
    """

    def __init__(self, system: System):
        self.scene = system.scene
        self.contacts = [contact for contact in system.scene.contacts.values() if isinstance(contact, Contact)]
        self.parts = _parts(system, self.contacts)
        self.body = np.array([part.body for part in self.parts], dtype=np.int64)
        self.kind = np.array([RANK[part.kind] for part in self.parts], dtype=np.int64)
        self.sizes = np.array([part.sizes for part in self.parts]).reshape(-1, SIZES).T.copy()
        self.own = np.array([part.rotation.ravel() for part in self.parts]).reshape(-1, 9).T.copy()
        self.centre = np.array([part.centre for part in self.parts]).reshape(-1, 3).T.copy()
        self.friction = np.array([contact.friction for contact in self.contacts])
        self.restitution = np.array([contact.restitution for contact in self.contacts])
        self.law = self._laws()

    def _laws(self) -> np.ndarray:
        law, places = np.zeros((len(self.parts),) * 2, dtype=np.int64), dict[str, list[int]]()
        for k, part in enumerate(self.parts):
            places.setdefault(part.shape, []).append(k)
        for number, contact in enumerate(self.contacts):
            for i in places[contact.shape]:
                for j in places[contact.other]:
                    law[i, j] = law[j, i] = number + 1
        return law

    @cached_property
    def length(self) -> np.ndarray:
        """Distances (k,) of the farthest points of the parts from the centres of mass of their bodies [m]."""
        half, radius = self.sizes[:3], self.sizes[3]
        return np.linalg.norm(self.centre, axis=0) + np.linalg.norm(half, axis=0) + radius

    @cached_property
    def ball(self) -> np.ndarray:
        """Radii (k,) of balls around the parts, about their centres; infinite of half-spaces [m]."""
        around = np.linalg.norm(self.sizes[:3], axis=0) + self.sizes[3]  # of the boxes of meshes, whose vertices are nearer
        shapes = (self.scene.shapes[part.shape] for part in self.parts)
        nearer = [np.linalg.norm(s.hull[0], axis=1).max() if isinstance(s, ConvexMesh) else np.inf for s in shapes]
        return np.where(self.kind == KINDS.index(HalfSpace), np.inf, np.minimum(around, nearer))

    @cached_property
    def gaps(self) -> np.ndarray:
        """Numbers (k + 1,) of the gap functions before each contact, in the order of the scene."""
        return np.cumsum([0, *(len(contact.sides(self.scene)) for contact in self.contacts)])

    @cached_property
    def number(self) -> tuple[np.ndarray, np.ndarray]:
        """Number of each part within its shape, and of the parts of that shape."""
        names = [part.shape for part in self.parts]
        own = [names[:k].count(name) for k, name in enumerate(names)]
        return np.array(own), np.array([names.count(name) for name in names])

    def sides(self, key: np.ndarray) -> np.ndarray:
        """1 for contacts whose first part is of the first shape of the scene's contact, −1 for the others, by their keys."""
        first, second = self.pair(key)
        contacts = (self.contacts[law - 1] for law in self.law[first, second])
        return np.array([1.0 if self.parts[i].shape == c.shape else -1.0 for i, c in zip(first, contacts, strict=True)])

    def pair(self, key: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Parts of contacts by their keys."""
        first, second = np.divmod(key // MOST_FEATURES, len(self.parts))
        return first, second

    def bodies(self, key: np.ndarray) -> np.ndarray:
        """Bodies (m, 2) of contacts by their keys."""
        return self.body[np.column_stack(self.pair(key))].reshape(-1, 2)

    def closed(self, key: np.ndarray, force: np.ndarray) -> np.ndarray:
        """Whether each contact of the scene bears a force, by the keys and forces (m, 3) of its points."""
        found = np.zeros(len(self.contacts), dtype=bool)
        found[self.law[self.pair(key[force[:, 0] > 0.0])] - 1] = True
        return found

    def gap_places(self, key: np.ndarray) -> np.ndarray:
        """Places of contacts among all gap functions of the scene, by their keys."""
        first, second = self.pair(key)
        turned = self.sides(key) < 0.0
        one, other = np.where(turned, second, first), np.where(turned, first, second)
        (place, count), law = self.number, self.law[first, second]
        features = (self.gaps[law] - self.gaps[law - 1]) // (count[one] * count[other])  # of each pair of parts
        return self.gaps[law - 1] + (place[one] * count[other] + place[other]) * features + key % MOST_FEATURES
