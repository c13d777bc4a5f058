"""Gap functions of pairs of features: exact signed distance g_N [m], contact point and normal."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from gauss import math
from gauss.scene import values
from gauss.scene.collision import Box, Capsule, Collider, HalfSpace

PARALLEL_SEGMENTS = 1e-12  # sin² of the angle between two segments below which they are parallel
COINCIDENT_POINTS = 1e-24  # squared distance, relative to that of the scene, below which two points have no direction


class Touch(NamedTuple):
    """Contact distance, point and normal of two features."""

    gap: object  # g_N [m], negative inside
    place: np.ndarray  # (3,): on the surface of one of them, in world axes [m]
    normal: np.ndarray  # (3,): unit vector out of the second shape


class FeaturePair:
    """Pair of features, one of each shape, that may touch.

    A kind gives ``touch``, of a view of the mechanism. Most gap functions are smooth wherever they may become zero. One that
    changes its features there, such as a corner that slides off a face, returns by ``fixed`` a pair of the present features;
    the ``margin`` of that becomes negative where other features take over.
    """

    @property
    def is_traced(self) -> bool:
        """Whether its distance is a closed form, the second derivatives of which hold over a whole time step."""
        return True

    def touch(self, at) -> Touch:
        """Contact distance, point and normal, by a view of the mechanism."""
        raise NotImplementedError

    def fixed(self, at) -> "FeaturePair | None":
        """Pair of the features that touch now, by a view in numbers; None if the features never change."""
        return None

    def margin(self, at):
        """Distance [m] of the contact point from the border of its features, positive inside."""
        raise NotImplementedError


@dataclass(frozen=True)
class Turned(FeaturePair):
    """Pair of features with the two shapes swapped."""

    place: FeaturePair

    def touch(self, at) -> Touch:
        """Contact distance, with the opposite normal."""
        gap, place, normal = self.place.touch(at)
        return Touch(gap, place, -normal)

    @property
    def is_traced(self) -> bool:
        """As the pair."""
        return self.place.is_traced

    def fixed(self, at) -> "Turned | None":
        """Pair of the present features."""
        kept = self.place.fixed(at)
        return None if kept is None else Turned(kept)

    def margin(self, at):
        """Margin of the pair."""
        return self.place.margin(at)


@dataclass(frozen=True)
class OnHalfSpace(FeaturePair):
    """Corner of a shape over a half-space: its height."""

    shape: Collider
    index: int
    ground: HalfSpace

    def touch(self, at) -> Touch:
        """Height of the corner, less the radius."""
        p, normal = corner(self.shape, self.index, at), self.ground.outward(at)
        height = normal @ (p - at.position(self.ground.body, self.ground.at))
        return Touch(height - self.shape.radius, p - height * normal, normal)


@dataclass(frozen=True)
class Balls(FeaturePair):
    """Balls around corners of two shapes."""

    shape: Collider
    index: int
    other: Collider
    other_index: int

    def touch(self, at) -> Touch:
        """Distance of the corners, less both radii."""
        p, other = corner(self.shape, self.index, at), corner(self.other, self.other_index, at)
        return ball(at, p, other, self.shape.radius, self.other.radius)


@dataclass(frozen=True)
class OnCapsule(FeaturePair):
    """Ball around a corner of a shape, and a capsule."""

    shape: Collider
    index: int
    capsule: Capsule

    def touch(self, at) -> Touch:
        """Distance of the corner from the axis of the capsule, less both radii."""
        p, (middle, axis), half = corner(self.shape, self.index, at), segment(self.capsule, at), 0.5 * self.capsule.length
        nearest = middle + math.clip(axis @ (p - middle), -half, half) * axis
        return ball(at, p, nearest, self.shape.radius, self.capsule.radius)


@dataclass(frozen=True)
class Capsules(FeaturePair):
    """Two capsules."""

    shape: Capsule
    other: Capsule

    def touch(self, at) -> Touch:
        """Distance of their axes, less both radii."""
        halves = 0.5 * self.shape.length, 0.5 * self.other.length
        p, other = nearest_points(segment(self.shape, at), segment(self.other, at), *halves)
        return ball(at, p, other, self.shape.radius, self.other.radius)


@dataclass(frozen=True)
class OnEdge(FeaturePair):
    """A capsule across an edge of a box."""

    capsule: Capsule
    box: Box
    axis: int  # along which of its axes the edge lies
    sides: tuple[int, int]  # on which sides of the next two axes, −1 or 1

    def touch(self, at) -> Touch:
        """Distance of the edge from the axis of the capsule, less its radius."""
        axes = at.rotation(self.box.body) @ self.box.axes
        half, (j, k) = 0.5 * np.array(self.box.size), across(self.axis)
        middle = at.position(self.box.body, self.box.at)
        middle = middle + self.sides[0] * half[j] * axes[:, j] + self.sides[1] * half[k] * axes[:, k]
        edge, lengths = (middle, axes[:, self.axis]), (0.5 * self.capsule.length, half[self.axis])
        p, other = nearest_points(segment(self.capsule, at), edge, *lengths)
        return ball(at, p, other, self.capsule.radius, 0.0)


def corner(shape: Collider, index: int, at) -> np.ndarray:
    """Corner (3,) of a shape in world axes [m]."""
    return at.position(shape.body, shape.corners[index])


def segment(capsule: Capsule, at):
    """Middle (3,) and direction (3,) of the axis of a capsule in world axes."""
    return at.position(capsule.body, capsule.at), at.rotation(capsule.body) @ values.unit(capsule.axis)


def across(axis: int) -> tuple[int, int]:
    """Return the two other axes of a box."""
    return (axis + 1) % 3, (axis + 2) % 3


def ball(at, p, other, radius: float, other_radius: float) -> Touch:
    """Balls around two points."""
    apart = p - other
    distance = np.sqrt(math.maximum(apart @ apart, COINCIDENT_POINTS * at.system.scale.length**2))
    normal = apart / distance
    return Touch(distance - (radius + other_radius), other + other_radius * normal, normal)


def nearest_points(first, second, a: float, b: float):
    """Nearest points of two segments of half lengths a, b (Ericson, Real-Time Collision Detection, 5.1.9)."""
    (c1, e1), (c2, e2) = first, second
    k, along, across = e1 @ e2, e1 @ (c1 - c2), e2 @ (c1 - c2)
    s = math.clip((k * across - along) / math.maximum(1.0 - k * k, PARALLEL_SEGMENTS), -a, a)
    t = math.clip(k * s + across, -b, b)
    s = math.clip(k * t - along, -a, a)
    return c1 + s * e1, c2 + t * e2
