"""Forms of bodies: the meshes of their robot, or rods and plates between their joints, and their shapes of contact."""

from dataclasses import dataclass
from itertools import combinations
from typing import cast

import numpy as np
import trimesh

from gauss.scene import GROUND, Box, Capsule, Cone, ConvexMesh, Cylinder, Ellipsoid, HeightField, Points, Sphere
from gauss.system import System
from gauss.view.skeleton import lines, skeleton

ROD, JOINT = 0.014, 0.024  # radii of rods and joints, of the size of the mechanism
HINGE = 2.2  # length of a hinge over its diameter
ROOM = 8  # distance between bearings over the size that they are drawn for
UNMARKED = ("free", "planar")  # joints that are nowhere
SIDES = 20  # of what is round
FLAT_EXTENT = 1e-6  # of their extent: points that are no farther from a plane enclose nothing
DOT = 0.02  # m: radius of points that enclose nothing


@dataclass(frozen=True)
class BodyMesh:
    """Mesh on a body."""

    body: str  # the body, or "ground"
    role: str  # "link", "joint" or "contact"
    mesh: trimesh.Trimesh  # in the frame of the body [m]
    colour: tuple[float, float, float] | None = None  # red, green, blue, from 0 to 1; the colour of the body when not given


def size(system: System) -> float:
    """Length of the longest diagonal of any body [m], which the thickness of what is drawn follows; 1 if all are points."""
    extents = [float(np.linalg.norm(np.ptp(points, axis=0))) for points in skeleton(system).values() if len(points)]
    return max(extents, default=1.0) or 1.0


def corners(system: System) -> dict[str, np.ndarray]:
    """Corners (k, 3) of the boxes around the shapes of contact of every moving body that has some, in its frame [m]."""
    found: dict[str, list[np.ndarray]] = {}
    for shape in system.scene.shapes.values():
        if _solid(shape) is not None:
            body, _, mesh = _carried(system, shape)
            found.setdefault(body, []).append(trimesh.bounds.corners(mesh.bounds))
    return {body: np.concatenate(points) for body, points in found.items() if body != GROUND}


def forms(system: System, visuals=()) -> list[BodyMesh]:
    """Meshes of all bodies: those given for a body, or generated ones; joints; shapes of contact.

    Parameters
    ----------
    system : System
        The mechanism.
    visuals : iterable
        Given meshes, with ``body``, ``vertices``, ``faces`` and ``colour``; see :func:`gauss.io.visuals.read_visuals`.
    """
    length = size(system)
    found = [BodyMesh(v.body, "link", trimesh.Trimesh(v.vertices, v.faces, process=False), v.colour) for v in visuals]
    given = {form.body for form in found}
    touching = [BodyMesh(*_carried(system, shape)) for shape in system.scene.shapes.values() if _solid(shape) is not None]
    marked = [joint for joint in system.joints if joint.pair.kind not in UNMARKED]
    room = min(length, ROOM * _spacing(marked, length))
    found += _links(system, {GROUND, *given}, {form.body for form in touching}, room)
    if not given:
        found += [BodyMesh(*_joint(system, joint, room)) for joint in marked]
        found += [BodyMesh(GROUND, "joint", _bearing(joint, room)) for joint in marked if _is_bearing(joint)]
    return found + touching


def _links(system: System, given: set[str], shaped: set[str], room: float) -> list[BodyMesh]:
    """Generated meshes of the bodies that have none; none for a body that is a point and has a shape of contact."""
    found = []
    for body, points in skeleton(system).items():
        if body not in given:
            points = np.concatenate([points, *_feet(system, body)])
            if len(points) > 1 or body not in shaped:
                found.append(BodyMesh(body, "link", _link(points, room)))
    return found


def _feet(system: System, body: str) -> list[np.ndarray]:
    """Points of contact of a body that enclose nothing, each list in the frame of the body."""
    shapes = (shape for shape in system.scene.shapes.values() if isinstance(shape, Points) and shape.body == body)
    return [np.asarray(shape.corners) for shape in shapes if len(shape.corners) < 3]


def _spacing(joints, length: float) -> float:
    """Smallest distance between joints on the ground that are apart [m]: what is drawn of them must fit in between."""
    places = [joint.p_parent if joint.parent < 0 else joint.p_child for joint in joints if _is_bearing(joint)]
    apart = (float(np.linalg.norm(one - other)) for one, other in combinations(places, 2))
    return min((distance for distance in apart if distance > JOINT * length), default=length)


def _link(points: np.ndarray, length: float) -> trimesh.Trimesh:
    """Rods along the lines of a skeleton, a plate if there are more than two points."""
    if len(points) < 2:
        middle = points[0] if len(points) else np.zeros(3)
        return _ball(2 * JOINT * length, middle)
    parts = [_rod(points[a], points[b], ROD * length) for a, b in lines(points)]
    parts += [_ball(ROD * length, point) for point in points]
    if len(points) > 2:
        fan = [[0, k, k + 1] for k in range(1, len(points) - 1)]
        parts.append(trimesh.Trimesh(np.tile(points, (2, 1)), fan + [[len(points) + k for k in f[::-1]] for f in fan]))
    return _joined(parts)


def _joint(system: System, joint, length: float) -> tuple:
    """Body, role and mesh: a pin along the axis of what turns about one, a box for what slides, a ball for all others."""
    on_child = joint.child >= 0
    body = system.structure.bodies[joint.child if on_child else joint.parent]
    frame, R, p = system.frames[body], *((joint.R_child, joint.p_child) if on_child else (joint.R_parent, joint.p_parent))
    at, axis = frame.R.T @ (p - frame.p), frame.R.T @ R[:, 2]
    return body, "joint", _pin(joint.pair.kind, at, axis, length)


def _is_bearing(joint) -> bool:
    return joint.pair.kind in ("revolute", "cylindrical", "screw") and min(joint.parent, joint.child) < 0


def _bearing(joint, length: float) -> trimesh.Trimesh:
    """Two disks that hold a hinge on the ground."""
    R, p = (joint.R_parent, joint.p_parent) if joint.parent < 0 else (joint.R_child, joint.p_child)
    radius, axis = JOINT * length, R[:, 2]
    inner, outer = (HINGE * radius * part * axis for part in (1.0, 1.35))
    return _joined([_rod(p + side * inner, p + side * outer, 1.9 * radius) for side in (-1, 1)])


def _pin(kind: str, at, axis, length: float) -> trimesh.Trimesh:
    radius = JOINT * length
    if kind in ("revolute", "cylindrical", "screw"):
        half = HINGE * radius * axis
        return _rod(at - half, at + half, radius)
    if kind == "prismatic":
        box = trimesh.creation.box(extents=radius * np.array([2.2, 2.2, 4.0]))
        return box.apply_transform(trimesh.geometry.align_vectors([0, 0, 1], axis)).apply_translation(at)
    return _ball(1.4 * radius, at)


def _carried(system: System, shape) -> tuple:
    """Body, role and mesh of a shape of contact, in the frame of the body."""
    if shape.body == GROUND:
        return GROUND, "contact", _solid(shape, np.zeros(3))
    placed = system.frames[shape.body]
    body = system.structure.bodies[placed.body]
    own = system.frames[body]
    mesh = cast(trimesh.Trimesh, _solid(shape, -placed.R.T @ placed.p))  # half-spaces are on the ground
    return body, "contact", mesh.apply_transform(_pose(own.R.T @ placed.R, own.R.T @ (placed.p - own.p)))


def _solid(shape, com=(0.0, 0.0, 0.0)) -> trimesh.Trimesh | None:
    """Mesh of a shape of contact in the frame that carries it; None for a half-space, which the floor shows.

    Feet become the hull of themselves and the centre of mass.
    """
    if isinstance(shape, Sphere):
        return _ball(shape.radius, np.array(shape.at))
    if isinstance(shape, Capsule):
        start, end = shape.corners
        return _joined([_rod(start, end, shape.radius), _ball(shape.radius, start), _ball(shape.radius, end)])
    if isinstance(shape, Box):
        return trimesh.creation.box(extents=shape.size, transform=_pose(shape.axes, shape.at))
    if isinstance(shape, ConvexMesh):
        return trimesh.convex.convex_hull(shape.corners)
    if isinstance(shape, HeightField):
        return trimesh.Trimesh(*shape.surface, process=False)
    if isinstance(shape, Cylinder | Cone | Ellipsoid):
        return _curved(shape).apply_transform(_pose(shape.axes, shape.at))
    if isinstance(shape, Points):
        corners = np.vstack([shape.corners, com])
        if np.linalg.matrix_rank(corners - corners[0], tol=FLAT_EXTENT * np.ptp(corners, axis=0).max()) == 3:
            return trimesh.convex.convex_hull(corners)
        return _joined([_ball(shape.radius or DOT, corner) for corner in shape.corners])
    return None


def _curved(shape: Cylinder | Cone | Ellipsoid) -> trimesh.Trimesh:
    """Mesh of a curved shape in its own axes."""
    if isinstance(shape, Ellipsoid):
        return _ball(1.0, np.zeros(3)).apply_scale(shape.radii)
    if isinstance(shape, Cylinder):
        return trimesh.creation.cylinder(radius=shape.radius, height=shape.length, sections=SIDES)
    cone = trimesh.creation.cone(radius=shape.radius, height=shape.length, sections=SIDES)
    return cone.apply_translation((0.0, 0.0, -0.5 * shape.length))


def _pose(R, p) -> np.ndarray:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = R, p
    return pose


def _joined(meshes: list[trimesh.Trimesh]) -> trimesh.Trimesh:
    return cast(trimesh.Trimesh, trimesh.util.concatenate(meshes))


def _rod(start, end, radius: float) -> trimesh.Trimesh:
    return trimesh.creation.cylinder(radius=radius, segment=[start, end], sections=SIDES)


def _ball(radius: float, at) -> trimesh.Trimesh:
    return trimesh.creation.icosphere(subdivisions=2, radius=radius).apply_translation(at)
