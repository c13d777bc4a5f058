"""One entry for everything that can be read or written."""

from collections.abc import Callable
from dataclasses import replace
from importlib import import_module
from pathlib import Path

from gauss.codegen import gc_pause
from gauss.errors import ArgumentError, FileError, SceneError, StateError, did_you_mean, extra, require, writing
from gauss.io.catalog import families, servo_files, shipped
from gauss.scene import Scene
from gauss.scene.toml import from_tables, tables, write_toml

EXTRAS = ("limits", "resistance", "collisions", "motors")  # of a URDF file, where they are asked for
OF_SDF = ("root", "limits", "root_folder", "missing", "collisions")
OF_USD = ("limits", "root_folder")
OF_MJCF = ("limits", "contacts", "root_folder", "keyframe")


def load(source, **options):
    """Scene of a file, a shipped model, a family of models, or a robot.

    Parameters
    ----------
    source : str or Path
        * path of a .toml scene, a .urdf robot (with the .loops.toml beside it, if there is one), a model in SDFormat (.sdf,
          or .world of Gazebo), in MJCF (.xml, needs MuJoCo), or in USD (.usda, .usdc, .usd; extra "usd");
        * name of a shipped model, e.g. "four_bar" (see :func:`gauss.catalog`);
        * name of a family, with its parameters as options, e.g. ``load("n_pendulum", n=10)``;
        * "robot:NAME" for a robot of the package example-robot-data, e.g. "robot:panda";
        * "description:NAME" for one of the package robot_descriptions whose files are on disk, e.g. "description:panda";
        * path of a .xacro file, which is a program: with ``xacro=True``, or a dict of its arguments.
    **options
        For robots ``root="fixed"|"free"``, ``mimic=True|False``, ``inertia="as given"``, ``limits="start"|"stops"``,
        ``resistance=True``, ``collisions=True`` and ``motors=True`` (see :func:`gauss.io.urdf.extras.with_extras`).

        For .sdf ``root``, ``limits``, ``root_folder=FOLDER``, ``missing`` and ``collisions=True`` (see
        :func:`gauss.io.sdf.read.read_sdf`).

        For .xml ``limits``, ``contacts=True``, ``root_folder=FOLDER`` and ``keyframe=NAME`` (see
        :func:`gauss.io.mjcf.read.read_mjcf`).

        For .usda, .usdc and .usd ``limits`` and ``root_folder=FOLDER`` (see :func:`gauss.io.usd.read.read_usd`).

        For families their parameters.

    Returns
    -------
    Scene or Servo
        A :class:`gauss.servo.Servo` for a file with servo tables, e.g. "servo/crane"; its scene is ``.system.scene``.

    Raises
    ------
    FileError
        If there is no such thing, or it is not what it claims to be.
    """
    require(source, (str, Path), "load")
    name, path = str(source), Path(source)
    if name.startswith("robot:"):
        return _read_urdf(_robots().robot(name.removeprefix("robot:")), options, name)
    if name.startswith("description:"):
        found = _packages().description(name.removeprefix("description:"))
        return load(found, **options)
    read = READERS.get(path.suffix.lower())
    if read is not None:
        return read(path, options, name)
    files = shipped() | servo_files()
    if name in files:
        return _without_options(name, options, _read_toml, files[name])
    if name in families():
        try:
            return families()[name](**options)
        except TypeError as error:
            raise FileError(f"family {name!r}: {error}.") from error
    raise FileError(_neither(name, path, [*files, *families(), "robot:panda", "robot:talos", "robot:ur5"]))


def _exists(path: Path) -> bool:
    """Whether there is such a file or folder; none has a name that the system cannot take."""
    try:
        return path.exists()
    except OSError:
        return False


def _neither(name: str, path: Path, everything: list[str]) -> str:
    """Message about what is neither a file that can be read nor a model."""
    if path.suffix or _exists(path):
        what = "it is a folder" if path.is_dir() else f"cannot read a file of type {path.suffix or 'unknown'!r}"
        return f"{name or repr(name)}: {what}; expected {' or '.join(READERS)}."
    return f"{name!r} is neither a file nor a model. {did_you_mean(name, everything)}"


def writer(path: Path, kind: str) -> Callable:
    """Function (thing, path) that writes things of a kind, a key of :data:`WRITERS`, with the ending of this path.

    FileError if the ending does not fit, or there is no such folder.
    MissingPackageError if the library of such files is not installed.
    """
    writers = WRITERS[kind]
    if path.suffix.lower() not in writers:
        remedy = ELSEWHERE.get(path.suffix.lower(), "")
        raise FileError(f"{path}: a {NAMES.get(kind, kind)} is written as {' or '.join(writers)}.{remedy}")
    if not path.parent.is_dir():
        raise FileError(f"{path}: there is no folder {str(path.parent)!r}.")
    wanted, library = LIBRARIES.get(path.suffix.lower(), ("", ""))
    if wanted:
        with extra(wanted):
            import_module(library)
    return writers[path.suffix.lower()]


def save(thing, path) -> Path:
    """Write a scene (.toml, .urdf, or .xml for MuJoCo) or a result (.npz, .csv, .json, .nc, .h5, .zarr).

    Parameters
    ----------
    thing : Scene, Trajectory, Tracking, RotorMotion, Rollout, Cycle, CrankRun, Dataset or dict
        What is written; a Dataset of :func:`gauss.sweep` as its outcomes, a row a member, unless the file is a labelled one
        (.nc, .h5, .zarr); of a dict its columns.
    path : str or Path
        Where; the ending says how.

    Returns
    -------
    Path
        Where it went.

    Raises
    ------
    ArgumentError
        If it is neither.
    FileError
        If the ending does not fit.
    """
    require(path, (str, Path), "save")
    path, kind = Path(path), type(thing).__name__.lower()
    if kind not in WRITERS:
        raise ArgumentError(f"save: expected a Scene, a motion or another result, got a {type(thing).__name__}.")
    write = writer(path, kind)
    try:
        with writing(path):
            return write(thing, path)
    except UnicodeEncodeError as error:
        raise FileError(f"{path}: no file can hold {error.object[error.start]!r}, which is in a name.") from error


def _read_toml(path: Path):
    data = tables(path)
    try:
        found = import_module("gauss.io.servo").servo_from_tables(data) if "servo" in data else from_tables(data)
    except (SceneError, StateError) as error:  # a servo may ask for what its scene does not have
        raise FileError(f"{path}: {error}") from error
    if isinstance(found, Scene) and not found.bodies:
        raise FileError(f"{path}: a scene without bodies; write [[body]] with a name and a mass, once for each.")
    return found


def _read_xacro(path: Path, options, name: str) -> Scene:
    arguments = options.pop("xacro", None)
    with _packages().urdf_of_xacro(path, arguments) as made:
        return _read_urdf(made, options, "")


def _read_sdf(path: Path, options, name: str) -> Scene:
    return import_module("gauss.io.sdf.read").read_sdf(path, **_known(name, options, OF_SDF))


def _read_urdf(path: Path, options, name: str) -> Scene:
    options = _known(str(path), options, ("root", "mimic", "inertia", *EXTRAS))
    extras = {key: options.pop(key) for key in EXTRAS if key in options}
    with gc_pause():
        return replace(_robots().read_robot(path, options, extras), source=name)


def _robots():
    """Robots, whose parser takes long to import."""
    return import_module("gauss.io.urdf.robots")


def _packages():
    """Robots by other packages."""
    return import_module("gauss.io.urdf.packages")


def _read_mjcf(path: Path, options, name: str) -> Scene:
    options = _known(name, options, OF_MJCF)
    with extra("mjcf"):  # MuJoCo's parser
        reader = import_module("gauss.io.mjcf.read")
    return reader.read_mjcf(path, **options)


def _read_usd(path: Path, options, name: str) -> Scene:
    return import_module("gauss.io.usd.read").read_usd(path, **_known(name, options, OF_USD))


def _later(module: str, name: str) -> Callable:
    """Writer that is imported when it is first called: few need it, and its parts take milliseconds to import."""
    return lambda thing, path: getattr(import_module(module), name)(thing, path)


def _known(name: str, options: dict, names: tuple[str, ...]) -> dict:
    unknown = [key for key in options if key not in names]
    if unknown:
        raise FileError(f"{name}: unknown option {unknown[0]!r}. {did_you_mean(unknown[0], names)}")
    return options


def _without_options(name: str, options, read, path) -> Scene:
    if options:
        robots = ", ".join(f"{key}=" for key in ("root", "mimic", *EXTRAS))
        raise FileError(f"{name}: takes no options, got {', '.join(options)}; {robots} are for robots.")
    return read(path)


READERS: dict[str, Callable] = {  # (path, options, name) by ending
    ".toml": lambda path, options, name: _without_options(name, options, _read_toml, path),
    ".urdf": _read_urdf,
    ".xacro": _read_xacro,
    ".xml": _read_mjcf,
    ".sdf": _read_sdf,
    ".world": _read_sdf,
    ".usda": _read_usd,
    ".usdc": _read_usd,
    ".usd": _read_usd,
}


def _table(name: str) -> Callable:
    """Writer of the columns of a result."""

    def write(thing, path: Path) -> Path:
        columns = import_module("gauss.io.columns").columns(thing)
        return getattr(import_module("gauss.io.results"), name)(columns, path)

    return write


LABELLED = {
    ".nc": _later("gauss.io.dataset", "write_netcdf"),
    ".h5": _later("gauss.io.dataset", "write_netcdf"),
    ".zarr": _later("gauss.io.dataset", "write_zarr"),
}
LIBRARIES = {".nc": ("results", "h5netcdf"), ".h5": ("results", "h5netcdf"), ".zarr": ("sweep", "zarr")}  # and their extras
TABLES = {".csv": _table("write_csv"), ".json": _table("write_json")}
RESULTS = {".npz": _table("write_arrays")} | TABLES | LABELLED
WRITERS: dict[str, dict[str, Callable]] = {  # by the name of the class: most are not imported yet
    "scene": {
        ".toml": write_toml,
        ".xml": _later("gauss.io.mjcf.write", "write_mjcf"),
        ".urdf": _later("gauss.io.urdf.write", "write_urdf"),
    },
    "trajectory": RESULTS | {".npz": _later("gauss.io.results", "write_npz")},
    "tracking": RESULTS | {".npz": _later("gauss.io.servo", "write_tracking")},
    "rotormotion": RESULTS,
    "rollout": RESULTS,
    "cycle": RESULTS,
    "crankrun": RESULTS,
    "dict": RESULTS,
    "dataset": RESULTS,
}
NAMES = {"rotormotion": "motion of rotors", "crankrun": "run of a linkage", "dict": "table", "dataset": "sweep"}
FIGURE = " Figures are drawn by --plot, or gauss.view."
FILM = " Films are made by gauss show --video, or gauss.view.viewer."
ELSEWHERE = {  # remedies where a picture is asked for as a file of numbers
    **dict.fromkeys((".png", ".svg", ".pdf"), FIGURE),
    **dict.fromkeys((".gif", ".mp4"), FILM),
    ".html": " Pages are made by gauss show --html, or gauss.view.viewer.",
}
