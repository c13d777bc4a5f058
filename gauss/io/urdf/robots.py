"""Scenes of robots: URDF files, by path or by the name of a robot of example-robot-data."""

import importlib.metadata
from pathlib import Path, PurePosixPath

from gauss.errors import FileError, did_you_mean
from gauss.io.urdf.extras import with_extras
from gauss.io.urdf.guard import guarded
from gauss.io.urdf.read import read_urdf
from gauss.io.urdf.side import with_side
from gauss.io.urdf.unknown import warn_of_rest
from gauss.scene import Scene

PACKAGE = "example-robot-data"
# Short names of robots that people ask for.
ALIASES = {
    "anymal": "anymal_b_simple_description/robots/anymal",
    "hyq": "hyq_no_sensors",
    "talos": "talos_reduced",
    "ur3": "ur3_robot",
    "ur5": "ur5_robot",
    "ur10": "ur10_robot",
}


def robot(name: str) -> Path:
    """URDF file of a robot of example-robot-data, by the name of the file, or "folder/…/file" where that is not unique.

    FileError if the package is not installed or has no such robot.
    """
    try:
        package = importlib.metadata.distribution(PACKAGE)
    except importlib.metadata.PackageNotFoundError:
        raise FileError(f"robot {name!r}: robots come with another package: pip install {PACKAGE}.") from None
    listed = (line.partition(",")[0] for line in (package.read_text("RECORD") or "").splitlines())
    urdfs = [PurePosixPath(file) for file in listed if file.endswith(".urdf")]
    wanted = ALIASES.get(name, name)
    found = [f for f in urdfs if str(f.with_suffix("")).endswith(f"/{wanted}")]
    if not found:
        raise FileError(f"no robot {name!r} in {PACKAGE}. {did_you_mean(name, [*ALIASES, *(f.stem for f in urdfs)])}")
    if len(found) > 1:
        places = ", ".join("/".join(f.with_suffix("").parts[-3:]) for f in found)
        raise FileError(f"robot {name!r} is not unique in {PACKAGE}; choose one of {places}.")
    return Path(str(package.locate_file(found[0])))


def read_robot(path: Path, options: dict, extras: dict) -> Scene:
    """Scene of a URDF file, with the .loops.toml beside it.

    Parameters
    ----------
    options : dict
        Of :func:`gauss.io.urdf.read.read_urdf`.
    extras : dict
        Of :func:`gauss.io.urdf.extras.with_extras`.
    """
    scene = read_urdf(path, **options)
    warn_of_rest(guarded(path))
    return with_side(with_extras(scene, path, **extras), path)
