"""Pairs of features (corners, edges, faces) by which two shapes may touch, for every pair of kinds of shapes."""

from collections.abc import Callable
from itertools import combinations_with_replacement, product

from gauss.errors import SceneError
from gauss.scene.box_distances import CornerOnBox, Edges
from gauss.scene.collision import Box, Capsule, Collider, HalfSpace, Points, Sphere
from gauss.scene.contact_distances import Balls, Capsules, FeaturePair, OnCapsule, OnEdge, OnHalfSpace, Turned
from gauss.scene.convex_mesh import ConvexMesh
from gauss.scene.curved_distances import ApexOnHalfSpace, EllipsoidOnHalfSpace, rim
from gauss.scene.curved_shapes import Cone, ConvexCollider, Cylinder, Ellipsoid
from gauss.scene.height_field import HeightField
from gauss.scene.patch_distances import feet_points, patch_points

BOTH_SIDES = (-1, 1)


def places(first: Collider, second: Collider) -> list[FeaturePair]:
    """Pairs of features by which the first shape may touch the second; normals point out of the second.

    SceneError if there is no rule for the two kinds.
    """
    kinds = type(first), type(second)
    if kinds in RULES:
        return RULES[kinds](first, second)
    if kinds[::-1] in RULES:
        return [Turned(place) for place in RULES[kinds[::-1]](second, first)]
    if set(kinds) == {HalfSpace}:
        raise SceneError(f"{first.what} and {second.what}: two half-spaces meet almost everywhere, so they make no contact.")
    if set(kinds) <= {HalfSpace, HeightField}:
        raise SceneError(f"{first.what} and {second.what} make no contact; give the one that moves a mesh or a box.")
    raise SceneError(f"{first.what} and {second.what} have no rule of contact; use spheres in place of points.")


def place_count(first: Collider, second: Collider) -> int:
    """Number of pairs of features: that of the kinds, but for sets of points.

    SceneError if there is no rule for the two kinds.
    """
    kinds = type(first), type(second)
    if Points in kinds:
        return len(places(first, second))
    if kinds not in _COUNTS:
        _COUNTS[kinds] = len(places(first, second))
    return _COUNTS[kinds]


def have_rule(first: Collider, second: Collider) -> bool:
    """Whether two shapes may touch: two half-spaces, or two sets of points without radius, do not."""
    kinds = type(first), type(second)
    if not (first.is_round or second.is_round) and set(kinds) == {Points}:
        return False
    return kinds in RULES or kinds[::-1] in RULES


def have_closed_form(first: Collider, second: Collider) -> bool:
    """Whether the distance of two shapes that may touch is traced; others are found by iteration in time stepping."""
    return all(place.is_traced for place in places(first, second))


def have_edges(first: Collider, second: Collider) -> bool:
    """Whether shapes may overlap with all gap functions positive: boxes deep in each other, a box about a capsule's axis."""
    return {type(first), type(second)} in ({Box}, {Box, Capsule})


def _on_half_space(first, second: HalfSpace) -> list[FeaturePair]:
    return [OnHalfSpace(first, k, second) for k in range(len(first.corners))]


def _balls(first, second) -> list[FeaturePair]:
    if not (first.is_round or second.is_round):
        raise SceneError(f"{first.what} and {second.what}: two points never touch; give one of them a radius [m].")
    return [Balls(first, i, second, k) for i, k in product(range(len(first.corners)), range(len(second.corners)))]


def _on_capsule(first, second: Capsule) -> list[FeaturePair]:
    return [OnCapsule(first, k, second) for k in range(len(first.corners))]


def _capsules(first: Capsule, second: Capsule) -> list[FeaturePair]:
    return [Capsules(first, second)]


def _on_box(first, second: Box) -> list[FeaturePair]:
    return [CornerOnBox(first, k, second) for k in range(len(first.corners))]


def _capsule_on_box(first: Capsule, second: Box) -> list[FeaturePair]:
    edges = [OnEdge(first, second, axis, sides) for axis in range(3) for sides in product(BOTH_SIDES, BOTH_SIDES)]
    return _on_box(first, second) + edges


def _boxes(first: Box, second: Box) -> list[FeaturePair]:
    corners = _on_box(first, second) + [Turned(place) for place in _on_box(second, first)]
    return corners + [Edges(first, second, *which) for which in product(range(3), range(3), BOTH_SIDES, BOTH_SIDES)]


Rule = Callable[..., list[FeaturePair]]
RULES: dict[tuple[type[Collider], type[Collider]], Rule] = {}
_COUNTS: dict[tuple[type[Collider], type[Collider]], int] = {}
RULES |= {(kind, HalfSpace): _on_half_space for kind in (Sphere, Points, Capsule, Box)}
RULES |= {(first, second): _balls for first in (Sphere, Points) for second in (Sphere, Points)}
RULES |= {(kind, Capsule): _on_capsule for kind in (Sphere, Points)} | {(Capsule, Capsule): _capsules}
RULES |= {(kind, Box): _on_box for kind in (Sphere, Points)} | {(Capsule, Box): _capsule_on_box, (Box, Box): _boxes}
RULES |= {
    (Ellipsoid, HalfSpace): lambda first, second: [EllipsoidOnHalfSpace(first, second)],
    (Cylinder, HalfSpace): lambda first, second: [*rim(first, second, -1), *rim(first, second, 1)],
    (Cone, HalfSpace): lambda first, second: [*rim(first, second, -1), ApexOnHalfSpace(first, second)],
}
SOLIDS: tuple[type[Collider], ...] = (Sphere, Capsule, Box, Ellipsoid, Cylinder, Cone, ConvexMesh, HalfSpace)
RULES |= {
    (first, second): patch_points
    for first, second in combinations_with_replacement(SOLIDS, 2)
    if (first, second) not in RULES and (issubclass(first, ConvexCollider) or issubclass(second, ConvexCollider))
}
RULES |= {(kind, HeightField): patch_points for kind in SOLIDS if kind is not HalfSpace} | {
    (Points, HeightField): feet_points
}
