"""Vertices of mesh files that robots name for their collisions, read by coal; their hulls are shapes of contact."""

from pathlib import Path, PurePosixPath

import numpy as np

from gauss.errors import FileError

FOLDERS_ABOVE = 6  # folders above a file in which its package:// paths are looked for
SCHEMES = ("package://", "model://", "file://")


def mesh_path(file: Path, named: str) -> Path | None:
    """Path of a mesh that a robot's file names; None if there is none, or if it lies outside its package.

    Parameters
    ----------
    named : str
        As it stands there.
    """
    scheme = next((scheme for scheme in SCHEMES if named.startswith(scheme)), "")
    rest = named.removeprefix(scheme)
    home, in_package = file.resolve().parent, scheme in SCHEMES[:2]
    if in_package and ".." in PurePosixPath(rest).parts:
        return None
    folders = file.resolve().parents[:FOLDERS_ABOVE] if in_package else [home]
    found = next((folder / rest for folder in folders if (folder / rest).is_file()), None)
    inside = found is not None and (in_package or found.resolve().is_relative_to(home.parent))  # meshes/ beside urdf/
    return found if inside else None


def mesh_vertices(path: Path, scale) -> np.ndarray:
    """Vertices (k, 3) of a mesh file, each once, scaled along its axes [m]; FileError if it cannot be read."""
    import coal  # few files have meshes

    try:
        found = coal.MeshLoader().load(str(path), np.array(scale, dtype=float))
        vertices = np.array(found.vertices())
    except Exception as error:  # its parsers raise whatever they do
        raise FileError(f"{path}: the mesh cannot be read: {error}") from error
    return np.unique(vertices.reshape(-1, 3), axis=0)
