"""Contact points of two shapes whose distance has no closed form: two solids, or a solid and terrain."""

from functools import cache

from gauss.scene.collision import Collider
from gauss.scene.contact_patch import Solid, SolidPair, solid_of
from gauss.scene.height_field import HeightField
from gauss.scene.support_faces import Segment
from gauss.scene.terrain import Terrain
from gauss.scene.terrain_contact import BallOnTerrain, SolidOnTerrain

PairOfSolids = SolidPair | BallOnTerrain | SolidOnTerrain


@cache
def _solid_at(shape: Collider) -> Solid | None:
    return solid_of(shape)


@cache
def _terrain_of(field: HeightField) -> Terrain:
    return Terrain(field)


@cache
def solid_pair(first: Collider, second: Collider) -> PairOfSolids:
    """Contact points of two shapes in their own axes, made once."""
    solid = _solid_at(first)
    assert solid is not None
    if not isinstance(second, HeightField):
        return SolidPair(solid, _solid_at(second))
    terrain = _terrain_of(second)
    if isinstance(solid, Segment) and not solid.half:
        return BallOnTerrain(solid, terrain)
    return SolidOnTerrain(solid, terrain)
