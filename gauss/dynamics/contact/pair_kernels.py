"""Machine code of each kind of pair of shapes: two poses and sizes in, contact distances, points and normals out.

    ġ_N = n · (v₁(p) − v₂(p)),   g̈_N = J q̈ + bias,   the same along two tangential directions

A pair of shapes has one or more pairs of features (:mod:`gauss.scene.contact_pairs`). Their functions are traced once as
functions of two poses, velocities and sizes, for all scenes: ``distances`` gives the distances of all pairs of features, and
``rows`` of one pair of features, selected by numbers, what the contact problem needs. The bias is the second derivative in
time while the rates of the joints are constant.
"""

from collections.abc import Callable
from copy import copy
from dataclasses import replace
from functools import cache
from itertools import product
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np

from gauss.codegen import Kernel, forward, from_disk, write
from gauss.rotations import cross
from gauss.scene import Box, Capsule, Collider, Cone, Cylinder, Ellipsoid, HalfSpace, Sphere
from gauss.scene.box_distances import CornerOnBox, Edges, separation
from gauss.scene.contact import tangents
from gauss.scene.contact_distances import Balls, Capsules, FeaturePair, OnCapsule, OnEdge, OnHalfSpace, Turned
from gauss.scene.contact_pairs import BOTH_SIDES, have_edges, places
from gauss.scene.curved_distances import LOWEST, QUARTERS, ApexOnHalfSpace, EllipsoidOnHalfSpace, RimOnHalfSpace

POSE = 24  # rotation (9), centre (3), angular velocity, velocity of the centre (6), rates of both where q̈ = 0 (6)
PLACE = 12  # of these rotation and centre
SIZES = 4  # half edges, half length as the last one; radius
ROWS = 55  # distance, point (3), rows of normal and tangents for both bodies (2, 3, 8), biases (3)
SIGNS = 3  # sides on which features lie
CYCLIC = np.array([(0, 1, 2), (1, 2, 0), (2, 0, 1)])  # axes of a box, the one of the edge first
LAST = {Box: 7, Capsule: 1, Sphere: 0}  # corner on the positive sides


class Feature(NamedTuple):
    """Pair of features of two shapes."""

    function: int  # which of the functions ``rows`` it has
    axes: tuple[int, int] = (0, 0)  # axes of both boxes that count as their first
    signs: tuple[float, ...] = ()  # sides on which the features lie; cosine and sine of a place on a rim


class PairOfShapes:
    """View of two shapes, each the only one of its body and in its axes, in numbers or expressions.

    Parameters
    ----------
    poses : sequence of ndarray, shape (24,)
        Rotation (rows), centre, angular velocity, velocity of the centre of each shape, and rates of the last two.
    length : Scalar
        Length of the scene [m].
    """

    def __init__(self, poses, length):
        parts = [np.split(pose, [9, 12, 15, 18, 21]) for pose in poses]
        names = "first", "second"
        self.R = {name: part[0].reshape(3, 3) for name, part in zip(names, parts, strict=True)}
        self.x, self.W, self.u, self.spin, self.pull = (
            {name: part[k] for name, part in zip(names, parts, strict=True)} for k in range(1, 6)
        )
        shapes = {name: SimpleNamespace(body=name) for name in names}
        self.system = SimpleNamespace(scale=SimpleNamespace(length=length), scene=SimpleNamespace(shapes=shapes))

    def position(self, name: str, point=(0.0, 0.0, 0.0)) -> np.ndarray:
        """Position (3,) of a point of a shape [m]."""
        return self.x[name] + self.R[name] @ np.asarray(point)

    def rotation(self, name: str) -> np.ndarray:
        """Rotation (3, 3) from the axes of a shape to world."""
        return self.R[name]

    def velocity_at(self, name: str, place) -> np.ndarray:
        """Velocity (3,) of the material point of a shape at a place in the world [m/s]."""
        return self.u[name] + cross(self.W[name], place - self.x[name])

    def derivative(self, values) -> np.ndarray:
        """Derivative in time of expressions, by the velocities of the shapes and the rates of these."""
        moving, rates = [], []
        for name in self.R:
            turning = np.array([cross(self.W[name], column) for column in self.R[name].T]).T
            pairs = (self.R, turning), (self.x, self.u[name]), (self.W, self.spin[name]), (self.u, self.pull[name])
            for part, rate in pairs:
                moving += list(np.ravel(part[name]))
                rates += list(np.ravel(rate))
        return forward(np.asarray(values, dtype=object), moving, rates)


def _shape(kind: type[Collider], name: str, sizes) -> Any:
    """Shape in its own axes whose sizes may be expressions, which its checks would refuse."""
    half, radius = sizes[:3], sizes[3]
    made: Collider = object.__new__(kind)
    given: dict = {"name": name, "body": name, "at": (0.0, 0.0, 0.0)}
    if kind is Sphere:
        given["radius"] = radius
    elif kind is Capsule:
        given |= {"radius": radius, "length": 2.0 * half[2], "axis": (0.0, 0.0, 1.0)}
    elif kind is Box:
        given |= {"size": 2.0 * half, "rotation": (0.0, 0.0, 0.0)}
    elif kind is Ellipsoid:
        given |= {"radii": half, "rotation": (0.0, 0.0, 0.0)}
    elif kind in (Cylinder, Cone):
        given |= {"radius": half[0], "length": 2.0 * half[2], "axis": (0.0, 0.0, 1.0)}
    elif kind is HalfSpace:
        given["normal"] = (0.0, 0.0, 1.0)
    for key, value in given.items():
        object.__setattr__(made, key, value)
    return made


CORNERS: dict[type, list[tuple[int, ...]]] = {
    Sphere: [()],
    Capsule: [(s,) for s in BOTH_SIDES],
    Box: list(product(BOTH_SIDES, repeat=3)),
}
ALONE: dict[tuple[type, type], Callable] = {
    (Sphere, Sphere): lambda a, b, s: Balls(a, 0, b, 0),
    (Sphere, Capsule): lambda a, b, s: OnCapsule(a, 0, b),
    (Capsule, Capsule): lambda a, b, s: Capsules(a, b),
}


def _rim(side: int) -> list[Feature]:
    return [Feature(0, signs=(side, *direction)) for direction in (LOWEST, *QUARTERS)]


def _on_rim(a, b, s) -> FeaturePair:
    return RimOnHalfSpace(a, b, s[0], (s[1], s[2]))


CURVED: dict[tuple[type, type], tuple[list[Feature], list[Callable]]] = {
    (Ellipsoid, HalfSpace): ([Feature(0)], [lambda a, b, s: EllipsoidOnHalfSpace(a, b)]),
    (Cylinder, HalfSpace): ([*_rim(-1), *_rim(1)], [_on_rim]),
    (Cone, HalfSpace): ([*_rim(-1), Feature(1)], [_on_rim, lambda a, b, s: ApexOnHalfSpace(a, b)]),
}


def _features(kinds: tuple[type, type]) -> tuple[list[Feature], list[Callable]]:
    """Pairs of features in the order of :func:`gauss.scene.contact_pairs.places`, and makers of one by shapes and signs."""
    one, other = kinds
    if kinds in CURVED:
        return CURVED[kinds]
    if kinds in ALONE:
        return [Feature(0)], [ALONE[kinds]]
    corners = [Feature(0, signs=s) for s in CORNERS[one]]
    if other is HalfSpace:
        return corners, [lambda a, b, s: OnHalfSpace(_mirrored(a, s), LAST[one], b)]
    found, makers = _edges(one)
    return [*corners, *found], [lambda a, b, s: CornerOnBox(_mirrored(a, s), LAST[one], b), *makers]


def _edges(kind: type) -> tuple[list[Feature], list[Callable]]:
    """Pairs of features of a shape and a box beyond the corners of the shape."""
    sides = list(product(BOTH_SIDES, repeat=2))
    if kind is Capsule:
        across = [Feature(1, (0, axis), s) for axis in range(3) for s in sides]
        return across, [lambda a, b, s: OnEdge(a, b, 0, (s[0], s[1]))]
    if kind is not Box:
        return [], []
    found = [Feature(1, signs=s) for s in CORNERS[Box]]
    found += [Feature(2, axes, s) for axes in product(range(3), range(3)) for s in sides]
    turned = lambda a, b, s: Turned(CornerOnBox(_mirrored(b, s), LAST[Box], a))  # noqa: E731
    return found, [turned, lambda a, b, s: Edges(a, b, 0, 0, s[0], s[1])]


def _mirrored(shape, signs):
    """Shape whose last corner is the one on the given sides; the others change places."""
    if isinstance(shape, Sphere):
        return shape
    made = copy(shape)
    if isinstance(shape, Capsule):
        object.__setattr__(made, "length", shape.length * signs[0])
    else:
        object.__setattr__(made, "size", shape.size * signs)
    return made


class PairKernels:
    """Machine code of one kind of pairs.

    Parameters
    ----------
    kinds : tuple of type
        Kinds of the two shapes, in the order of a rule of :mod:`gauss.scene.contact_pairs`.

    Attributes
    ----------
    features : list of Feature
        Pairs of features.
    distances : Kernel
        (rotation, centre, sizes of one shape, the same of the other, length of the scene) → distances of all pairs of
        features; where these may miss an overlap, the separation of the shapes as a whole [m].
    rows : list of Kernel
        Of one pair of features each: (pose and sizes of one shape, centre of mass of its body, the same of the other, length
        of the scene, signs) → distance, point, rows for the twists (ω, u) of both bodies that give the relative velocities
        along normal and tangents, each with two zeros at its end; biases of these velocities.
    """

    otherwise = None  # other distances, asked for where these have none

    def __init__(self, kinds: tuple[type, type]):
        self.features, makers = _features(kinds)
        self.guarded = {*kinds} in ({Box}, {Box, Capsule})

        def distances(pose, sizes, other, other_sizes, length):
            still = np.zeros(POSE - PLACE)
            view = PairOfShapes([np.concatenate([pose, still]), np.concatenate([other, still])], length[0])
            shapes = _shape(kinds[0], "first", sizes), _shape(kinds[1], "second", other_sizes)
            apart = [separation(*shapes, view)] if have_edges(*shapes) else []
            return [*(place.touch(view).gap for place in places(*shapes)), *apart]

        self.distances = Kernel(write(distances, PLACE, SIZES, PLACE, SIZES, 1, name="distances"))
        self.rows = [_rows(kinds, maker) for maker in makers]


def _rows(kinds: tuple[type, type], maker: Callable[..., FeaturePair]) -> Kernel:
    def rows(pose, sizes, x, other, other_sizes, x_other, length, signs):
        view = PairOfShapes([pose, other], length[0])
        place = maker(_shape(kinds[0], "first", sizes), _shape(kinds[1], "second", other_sizes), signs)
        if isinstance(place, Edges):
            place = replace(place, signs=place._facing(view))
        gap, point, normal = place.touch(view)
        slip = view.velocity_at("first", point) - view.velocity_at("second", point)
        axes = tangents(normal)
        rates = [*view.derivative([gap]), *(axis @ slip for axis in axes)]
        arms = (1.0, point - x), (-1.0, point - x_other)
        J = [[*(sign * cross(arm, axis)), *(sign * axis), 0.0, 0.0] for sign, arm in arms for axis in (normal, *axes)]
        bias = view.derivative(rates) if place.is_traced else np.zeros(3)
        return [gap], point, *J, bias

    return Kernel(write(rows, POSE, SIZES, 3, POSE, SIZES, 3, 1, SIGNS, name="rows"))


@cache
def pair_kernels(kinds: tuple[type, type]) -> PairKernels:
    """Machine code of a kind of pairs, made once on a machine."""
    return from_disk((PairKernels, *kinds), lambda: PairKernels(kinds))
