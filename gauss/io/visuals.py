"""Meshes that a URDF file gives its links, read by Pinocchio, in the frames of the bodies of the scene."""

import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gauss.errors import FileError, NotImportedWarning, extra
from gauss.io.collision_meshes import FOLDERS_ABOVE
from gauss.io.urdf.guard import guarded, require_own_meshes
from gauss.io.urdf.numbers import for_parser
from gauss.io.urdf.read import ROOTS, base_of, body_names
from gauss.io.urdf.robots import robot
from gauss.scene import GROUND, Scene
from gauss.simulation.provenance import library

with extra():
    import pinocchio as pin


@dataclass(frozen=True)
class Visual:
    """Mesh on a body."""

    body: str  # the body, or "ground"
    vertices: np.ndarray  # (k, 3) in the frame of the body [m]
    faces: np.ndarray  # (m, 3) vertices of the triangles
    colour: tuple[float, float, float]  # red, green, blue, from 0 to 1


def read_visuals(source, root: str = "fixed") -> list[Visual]:
    """Meshes of a robot; none if the source is no URDF file.

    FileError if a mesh cannot be read.

    Parameters
    ----------
    source : str or Path
        A .urdf file or "robot:NAME", as for :func:`gauss.load`.
    root : str
        As for :func:`gauss.load`.
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
        folders = [str(folder) for folder in path.resolve().parents[:FOLDERS_ABOVE] if folder != folder.parent]
        found = pin.buildGeomFromUrdfString(model, text, pin.GeometryType.VISUAL, package_dirs=folders)
    except Exception as error:  # the parser raises whatever its libraries do
        raise FileError(f"{path}: its meshes cannot be read: {error}") from error
    names = body_names(model)
    return [_visual(entry, names[entry.parentJoint]) for entry in found.geometryObjects if _is_mesh(entry.geometry)]


def visuals_of(scene: Scene) -> list[Visual]:
    """Meshes of a scene that was read from a URDF file, or of a motion of it that was saved, from that file.

    Parameters
    ----------
    scene : Scene
        The scene; its ``source`` tells the file.

    Warns
    -----
    NotImportedWarning
        If the file is gone, or is one of another robot by now: then there are none.
    """
    if not scene.source:
        return []
    try:
        for root in ROOTS[::-1]:  # where the base floats it is a body
            found = read_visuals(scene.source, root)
            if all(visual.body in (GROUND, *scene.bodies) for visual in found):
                return found
        why = f"{scene.source} has bodies that the scene has not"
    except FileError as error:
        why = str(error).rstrip(".")
    warnings.warn(f"scene {scene.name!r} is without its meshes: {why}.", NotImportedWarning, stacklevel=2)
    return []


def as_arrays(visuals) -> dict[str, tuple]:
    """Meshes as variables of an xarray Dataset, one behind the other; nothing without meshes."""
    if not visuals:
        return {}
    about = {"units": "m", "long_name": "vertices of the meshes, in the frames of their bodies"}
    return {
        "mesh_body": ("mesh", np.array([visual.body for visual in visuals], dtype=str)),
        "mesh_colour": (("mesh", "channel"), np.array([visual.colour for visual in visuals], dtype=float), {"units": "1"}),
        "mesh_vertices": ("mesh", np.array([len(visual.vertices) for visual in visuals])),
        "mesh_triangles": ("mesh", np.array([len(visual.faces) for visual in visuals])),
        "mesh_vertex": (("vertex", "axis"), np.concatenate([visual.vertices for visual in visuals]), about),
        "mesh_triangle": (("triangle", "corner"), np.concatenate([visual.faces for visual in visuals]).astype(np.int32)),
    }


def from_arrays(found) -> list[Visual]:
    """Meshes of a Dataset that :func:`as_arrays` filled."""
    if "mesh_body" not in found:
        return []
    vertices, faces = found.mesh_vertex.values, found.mesh_triangle.values
    ends = np.cumsum(found.mesh_vertices.values)[:-1], np.cumsum(found.mesh_triangles.values)[:-1]
    parts = zip(found.mesh_body.values, np.split(vertices, ends[0]), np.split(faces, ends[1]), strict=True)
    colours = (tuple(colour) for colour in found.mesh_colour.values.tolist())
    return [
        Visual(str(body), points, corners, colour) for (body, points, corners), colour in zip(parts, colours, strict=True)
    ]


def saved_visuals(path) -> list[Visual]:
    """Meshes that :func:`gauss.save` kept with a motion.

    Parameters
    ----------
    path : str or Path
        File (.nc, .h5) or folder (.zarr) of the motion.
    """
    engine = "zarr" if Path(path).suffix.lower() == ".zarr" else "h5netcdf"
    with library("xarray").open_dataset(path, engine=engine) as file:
        return from_arrays(file.load())


def _is_mesh(shape) -> bool:
    return hasattr(shape, "num_tris") and shape.num_tris > 0


def _visual(entry, body: str) -> Visual:
    shape = entry.geometry
    faces = np.array([[triangle[k] for k in range(3)] for triangle in map(shape.tri_indices, range(shape.num_tris))])
    vertices = np.array(shape.vertices()) @ entry.placement.rotation.T + entry.placement.translation
    red, green, blue = (float(c) for c in entry.meshColor[:3])
    return Visual(body, vertices, faces, (red, green, blue))
