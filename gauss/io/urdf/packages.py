"""Robots by other packages: files of robot_descriptions that are on disk, and xacro expanded to URDF.

A xacro file is a program: the package ``xacro`` evaluates its expressions, and it includes other files. So it is read only
where the caller says so.
"""

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from unittest.mock import patch

from gauss.errors import FileError, did_you_mean, extra
from gauss.scene.file_contents import LARGEST_FILE

CACHE = "~/.cache/robot_descriptions"  # of that package, unless ROBOT_DESCRIPTIONS_CACHE says another
ENDING = "_description"
FORMATS = ("URDF_PATH", "MJCF_PATH")


def description(name: str) -> Path:
    """File of a robot of the package robot_descriptions; nothing is fetched.

    Parameters
    ----------
    name : str
        Name there, with or without its ending, e.g. "panda" or "panda_mj_description".

    Raises
    ------
    MissingPackageError
        If the package is not installed.
    FileError
        If it has no such robot, or its files are not on disk.
    """
    module = name if name.endswith(ENDING) else f"{name}{ENDING}"
    with extra("descriptions"):
        package = import_module("robot_descriptions")
        cache = import_module("robot_descriptions._cache")
    known = [file.stem for folder in package.__path__ for file in Path(folder).glob(f"*{ENDING}.py")]
    if module not in known:
        raise FileError(f"description {name!r}: robot_descriptions has none. {did_you_mean(module, known)}")

    def on_disk(repository: str, commit: str | None = None) -> str:
        kept = cache.REPOSITORIES[repository].cache_path
        folder = Path(os.path.expanduser(os.environ.get("ROBOT_DESCRIPTIONS_CACHE", CACHE)))
        folder = folder / (f"{kept}-{commit}/{kept}" if commit else kept)
        if not folder.is_dir():
            raise FileError(
                f"description {name!r}: its files are not on disk ({folder}), and nothing is fetched here; "
                f"`python -m robot_descriptions pull {module}` does so."
            )
        return str(folder)

    with patch.object(cache, "clone_to_cache", on_disk):
        found = import_module(f"robot_descriptions.{module}")
    paths = [Path(getattr(found, kind)) for kind in FORMATS if hasattr(found, kind)]
    if not paths:
        raise FileError(f"description {name!r}: it has neither URDF nor MJCF.")
    return paths[0]


@contextmanager
def urdf_of_xacro(path: Path, arguments: Mapping[str, object] | bool | None) -> Iterator[Path]:
    """URDF file that a xacro file expands to, for a ``with`` statement.

    FileError if it may not be evaluated, or cannot be.

    Parameters
    ----------
    arguments : mapping or bool, optional
        Arguments of the file, or True for none; None if the caller did not say that the file may be evaluated.
    """
    if arguments is None or arguments is False:
        raise FileError(
            f"{path}: a xacro file is a program, which the package xacro evaluates; "
            "xacro=True, or a dict of its arguments, says that you trust it."
        )
    with extra("xacro"):
        import xacro
    given = {} if arguments is True else {str(key): str(value) for key, value in dict(arguments).items()}
    try:
        text = xacro.process_file(str(path), mappings=given).toxml()
    except Exception as error:  # whatever its expressions do
        raise FileError(f"{path}: xacro cannot expand it: {type(error).__name__}: {error}") from error
    if len(text) > LARGEST_FILE:
        raise FileError(f"{path}: xacro expands it to more than {LARGEST_FILE / 1e6:g} MB.")
    with TemporaryDirectory() as folder:
        made = Path(folder) / path.with_suffix("").with_suffix(".urdf").name
        made.write_text(text, encoding="utf-8")
        try:
            yield made
        except FileError as error:
            raise FileError(f"{path}, expanded: {str(error).replace(str(made), made.name)}") from error
