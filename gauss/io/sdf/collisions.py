"""Collisions of an SDFormat link as shapes of contact."""

from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from gauss.io.collision_meshes import mesh_path, mesh_vertices
from gauss.io.guard import Source
from gauss.io.sdf.elements import numbers, text
from gauss.scene import Box, Capsule, Collider, Cone, ConvexMesh, Cylinder, Ellipsoid, HalfSpace, Sphere
from gauss.system.frames import Pose

TURNED: dict[str, type[Capsule] | type[Cylinder] | type[Cone]] = {"cylinder": Cylinder, "capsule": Capsule, "cone": Cone}


def shape_of(source: Source, collision: Element, name: str, carrier: str, place: Pose) -> Collider | None:
    """Shape of a collision; None where it has no counterpart, or its mesh is not there.

    Parameters
    ----------
    source : Source
        The file.
    name, carrier : str
        Of the shape, and of the body or frame that carries it.
    place : tuple of ndarray
        Rotation (3, 3) and position (3,) in that frame [m].
    """
    geometry = collision.find("geometry")
    R, at = tuple(map(tuple, place[0])), tuple(map(float, place[1]))
    axis = tuple(place[0][:, 2])
    for given in [] if geometry is None else geometry:

        def sizes(tag: str, count: int = 1, given=given) -> tuple[float, ...]:
            return tuple(numbers(source, given.find(tag), count))

        if given.tag == "sphere":
            return Sphere(name, carrier, at, sizes("radius")[0])
        if given.tag == "box":
            return Box(name, carrier, at, sizes("size", 3), R)
        if given.tag == "ellipsoid":
            return Ellipsoid(name, carrier, at, sizes("radii", 3), R)
        if given.tag in TURNED:
            (radius,), (length,) = sizes("radius"), sizes("length")
            return TURNED[given.tag](name, carrier, at, radius, length, axis)
        if given.tag == "plane":
            normal = np.array(sizes("normal", 3) if given.find("normal") is not None else (0.0, 0.0, 1.0))
            return HalfSpace(name, carrier, at, tuple(place[0] @ normal))
        path = mesh_path(Path(source.path), text(given, "uri")) if given.tag == "mesh" else None
        if path is not None:
            scale = sizes("scale", 3) if given.find("scale") is not None else (1.0, 1.0, 1.0)
            return ConvexMesh(name, carrier, at, tuple(map(tuple, mesh_vertices(path, scale))), R)
    return None
