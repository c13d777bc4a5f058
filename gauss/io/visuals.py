"""Meshes that a URDF file gives its links, read by Pinocchio, in the frames of the bodies of the scene."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio as pin

from gauss.errors import FileError
from gauss.io.catalog import robot
from gauss.io.urdf.guard import guarded, require_own_meshes
from gauss.io.urdf.numbers import for_parser
from gauss.io.urdf.read import base_of, body_names

ABOVE = 6  # folders above a file in which its package:// paths are looked for


@dataclass(frozen=True)
class Visual:
    """Mesh on a body.

    Parameters
    ----------
    body : str
        The body, or "ground".
    vertices : ndarray, shape (k, 3)
        In the frame of the body [m].
    faces : ndarray, shape (m, 3)
        Vertices of the triangles.
    colour : tuple of float
        Red, green, blue, from 0 to 1.
    """

    body: str
    vertices: np.ndarray
    faces: np.ndarray
    colour: tuple[float, float, float]


def read_visuals(source, root: str = "fixed") -> list[Visual]:
    """Meshes of a robot; none if the source is no URDF file.

    Parameters
    ----------
    source : str or Path
        A .urdf file or "robot:NAME", as for :func:`gauss.load`.
    root : str
        As for :func:`gauss.load`.

    Raises
    ------
    FileError
        If a mesh cannot be read.
    """
    name = str(source)
    path = robot(name.removeprefix("robot:")) if name.startswith("robot:") else Path(source)
    if path.suffix.lower() != ".urdf":
        return []
    source = guarded(path)
    require_own_meshes(source)
    text = for_parser(source)
    try:
        model = pin.buildModelFromXML(text, *base_of(root))
        folders = [str(folder) for folder in path.resolve().parents[:ABOVE] if folder != folder.parent]
        found = pin.buildGeomFromUrdfString(model, text, pin.GeometryType.VISUAL, package_dirs=folders)
    except Exception as error:  # the parser raises whatever its libraries do
        raise FileError(f"{path}: its meshes cannot be read: {error}") from error
    names = body_names(model)
    return [_visual(entry, names[entry.parentJoint]) for entry in found.geometryObjects if _is_mesh(entry.geometry)]


def _is_mesh(shape) -> bool:
    return hasattr(shape, "num_tris") and shape.num_tris > 0


def _visual(entry, body: str) -> Visual:
    shape = entry.geometry
    faces = np.array([[triangle[k] for k in range(3)] for triangle in map(shape.tri_indices, range(shape.num_tris))])
    vertices = np.array(shape.vertices()) @ entry.placement.rotation.T + entry.placement.translation
    return Visual(body, vertices, faces, tuple(float(c) for c in entry.meshColor[:3]))
