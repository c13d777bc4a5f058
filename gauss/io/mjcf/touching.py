"""Contacts and stops of MJCF files, on request: geoms become shapes, and pairs of geoms that may touch become contacts.

Which geoms may touch is decided as in MuJoCo: pairs that the file names, and geoms whose masks match, of bodies that are
neither one, nor parent and child, nor excluded. All are hard: softness, margins and torsional friction have no counterpart.
"""

from itertools import combinations

import mujoco
import numpy as np

from gauss import rotations
from gauss.errors import SceneError
from gauss.io.mjcf.names import SCALAR, Named
from gauss.io.mjcf.switches import is_off
from gauss.io.numbers import add_stop
from gauss.scene import Box, Capsule, ConvexMesh, Cylinder, Ellipsoid, HalfSpace, HeightField, Scene, Sphere

PLANE, SPHERE, CAPSULE, BOX, CYLINDER, ELLIPSOID, MESH, FIELD = (
    int(getattr(mujoco.mjtGeom, f"mjGEOM_{name}"))
    for name in ("PLANE", "SPHERE", "CAPSULE", "BOX", "CYLINDER", "ELLIPSOID", "MESH", "HFIELD")
)
GROUNDS = PLANE, FIELD  # two of which never touch in MuJoCo


def add_stops(scene: Scene, named: Named):
    """Stops of all hinges and slides that are limited."""
    for i in np.flatnonzero(named.model.jnt_limited):
        if named.kinds[i] in SCALAR:
            add_stop(scene, named.joints[i])


def add_contacts(scene: Scene, named: Named) -> list[str]:
    """Add shapes and contacts of all geoms that may touch; names of those without a counterpart."""
    model, unlike = named.model, set()
    pairs = [
        (int(a), int(b), *_of_pair(model, i)) for i, (a, b) in enumerate(_pairs(model)) if not _are_grounds(model, a, b)
    ]
    pairs += [(a, b, *_of_geoms(model, a, b)) for a, b in _matching(model)]
    for first, second, dimension, friction in pairs:
        shapes = [_shape(scene, named, geom) for geom in (first, second)]
        unlike |= {named.name("geom", geom) for geom, shape in zip((first, second), shapes, strict=True) if shape is None}
        one, other = shapes
        if one is None or other is None:
            continue
        name = f"{one.name} on {other.name}"
        if dimension > 3:
            unlike.add(f"friction of turning and rolling of {name}")
        scene.contact(name, one, other, friction=friction if dimension >= 3 else 0.0)
    return sorted(unlike)


def _pairs(model) -> list[tuple[int, int]]:
    if is_off(model, "CONTACT") or is_off(model, "CONSTRAINT"):
        return []
    return list(zip(model.pair_geom1, model.pair_geom2, strict=True))


def _of_pair(model, i: int) -> tuple[int, float]:
    along, across = model.pair_friction[i, :2]
    if along != across:
        raise SceneError(f"pair {i}: friction {along} along and {across} across; gauss has one coefficient.")
    return int(model.pair_dim[i]), float(along)


def _of_geoms(model, a: int, b: int) -> tuple[int, float]:
    """Condim and friction of two geoms: of the one of higher priority, else the larger of both."""
    priority = model.geom_priority[[a, b]]
    which = [a, b] if priority[0] == priority[1] else [(a, b)[int(np.argmax(priority))]]
    return int(model.geom_condim[which].max()), float(model.geom_friction[which, 0].max())


def _matching(model) -> list[tuple[int, int]]:
    """Geoms that may touch by their masks, and are no pair of the file."""
    named = {frozenset(pair) for pair in _pairs(model)}
    excluded = {frozenset((int(code) >> 16, int(code) & 0xFFFF)) for code in model.exclude_signature}
    found = []
    for a, b in combinations(range(model.ngeom), 2):
        masks = model.geom_contype[a] & model.geom_conaffinity[b] or model.geom_contype[b] & model.geom_conaffinity[a]
        bodies = int(model.geom_bodyid[a]), int(model.geom_bodyid[b])
        apart = frozenset(bodies) not in excluded and frozenset((a, b)) not in named
        if masks and apart and not _are_grounds(model, a, b) and not _are_bound(model, bodies):
            found.append((a, b))
    return found


def _are_grounds(model, a: int, b: int) -> bool:
    """Whether both geoms are planes or height fields."""
    return model.geom_type[a] in GROUNDS and model.geom_type[b] in GROUNDS


def _are_bound(model, bodies: tuple[int, int]) -> bool:
    """Whether two bodies are welded into one, or are parent and child, between which MuJoCo filters contacts."""
    one, other = (int(model.body_weldid[body]) for body in bodies)
    if one == other:
        return True
    if 0 in (one, other) or is_off(model, "FILTERPARENT"):
        return False
    parents = [int(model.body_weldid[model.body_parentid[body]]) for body in (one, other)]
    return parents[0] == other or parents[1] == one


def _shape(scene: Scene, named: Named, geom: int):
    """Shape of a geom, made when it is first needed; None if there is no counterpart."""
    model, name = named.model, named.name("geom", geom)
    if name in scene.shapes:
        return scene.shapes[name]
    body, at = named.bodies[int(model.geom_bodyid[geom])], tuple(model.geom_pos[geom])
    R, size = rotations.clean(rotations.from_quaternion(model.geom_quat[geom])), model.geom_size[geom]
    kind = int(model.geom_type[geom])
    if kind == SPHERE:
        return scene.add(Sphere(name, body, at, float(size[0])))
    if kind == CAPSULE:
        return scene.add(Capsule(name, body, at, float(size[0]), 2.0 * float(size[1]), tuple(R[:, 2])))
    if kind == BOX:
        return scene.add(Box(name, body, at, tuple(2.0 * size), R))
    if kind == CYLINDER:
        return scene.add(Cylinder(name, body, at, float(size[0]), 2.0 * float(size[1]), tuple(R[:, 2])))
    if kind == ELLIPSOID:
        return scene.add(Ellipsoid(name, body, at, tuple(size), R))
    if kind == MESH:
        start, count = (int(of[model.geom_dataid[geom]]) for of in (model.mesh_vertadr, model.mesh_vertnum))
        return scene.add(ConvexMesh(name, body, at, model.mesh_vert[start : start + count].astype(float), R))
    if kind == FIELD:
        return scene.add(_field(model, int(model.geom_dataid[geom]), name, body, at, R))
    return scene.add(HalfSpace(name, body, at, tuple(R[:, 2]))) if kind == PLANE else None


def _field(model, asset: int, name: str, body: str, at: tuple, R) -> HeightField:
    """Height field of an asset: elevations from 0 to 1, half edges, height of elevation 1, depth below elevation 0."""
    rows, columns, start = (int(of[asset]) for of in (model.hfield_nrow, model.hfield_ncol, model.hfield_adr))
    half_x, half_y, top, base = model.hfield_size[asset].tolist()
    share = model.hfield_data[start : start + rows * columns].astype(float).reshape(rows, columns)
    depth = base + top * float(share.min())
    heights = tuple(map(tuple, (top * share).tolist()))
    return HeightField(name, body, at, heights, (2.0 * half_x, 2.0 * half_y), R, depth)
