"""Model files of others: how many open, what the others are refused for, and how far accelerations are from others'.

Run it with:

    python -m benchmarks.foreign_files FOLDER...

Each folder holds a copy of a public source and is the root folder of its files: a wheel of the Python package index
unpacked (gymnasium, gymnasium-robotics, dm_control, brax, robosuite, example-robot-data, icub-models, jvrc-description,
rtb-data, differentiable-robot-model) or a checkout (google-deepmind/mujoco, gazebosim/gz-sim, gazebosim/sdformat,
unitreerobotics/unitree_ros, of bulletphysics/bullet3 only pybullet_data without random_urdfs). Files that MuJoCo, or
Pinocchio's parser of URDF, itself refuses, that hold flexible bodies or plugins, or where nothing moves, are counted
apart, as are SDFormat files with models on a server. URDF files get a floating base where nothing else moves, and their
inertias are taken as given where they break the triangle inequality: both are counted, too. Accelerations are compared at
random states and controls, without contacts, limits and friction. One file differs by its own design: MuJoCo drops the
terms of M between branches of a tree that a heavy tendon joins; gauss keeps them. The largest deviation of trees, of two
files of a dodecahedron, is MuJoCo's, which takes a centre of mass 2e-9 m beside the origin of a body for it. Many files of
sdformat are tests of what a reader is to refuse.
"""

import argparse
import re
import signal
import warnings
from collections import Counter
from pathlib import Path
from typing import NamedTuple

import mujoco

import gauss
from benchmarks.foreign_accelerations import NotCompared, deviation
from benchmarks.foreign_urdf import deviation_of_urdf, is_refused_by_parser, opened_urdf
from gauss.bench.markdown import table
from gauss.errors import GaussError

RESULTS = Path(__file__).parent / "results"
PATIENCE = 120  # s for each file
AGREED = 1e-9  # relative deviation of accelerations
KINDS = {".xml": "mujoco", ".sdf": "sdf", ".world": "sdf", ".urdf": "robot"}
FORMATS = {".xml": "MJCF", ".sdf": "SDFormat", ".world": "SDFormat", ".urdf": "URDF"}
ON_SERVER = "it is on a server"
STILL = ("nothing moves", "there is no model in it")
STATES = ("agreed", "opened", "nothing moves", "differs", "refused", "too slow", "crashed")
APART = ("some on a server, rest opens", "all on a server", "refused by the reference", "flex or plugin")
REFUSED_BY_REFERENCE = APART[2]
QUOTED, NUMBER = re.compile(r"'[^']*'"), re.compile(r"-?\d+(\.\d+)?(e[-+]?\d+)?")


class FileRecord(NamedTuple):
    """What became of a file: status, reasons of a refusal, deviation of accelerations (nan where not compared)."""

    source: str
    path: str
    status: str
    reasons: tuple[str, ...] = ()
    deviation: float = float("nan")
    has_loops: bool = False


def records(folder: Path, kind: str | None = None):
    """What became of every model file, or those of one ending, below a folder."""
    endings = KINDS if kind is None else (kind,)
    for path in sorted(path for path in folder.rglob("*") if path.suffix.lower() in endings and path.is_file()):
        if root_of(path) == KINDS[path.suffix.lower()]:
            yield of_file(folder, path)


def root_of(path: Path) -> str:
    """Outermost element of a file; empty where it is no XML."""
    found = re.search(r"<([A-Za-z_]\w*)", re.sub(r"<!--.*?-->", "", path.read_text(errors="replace"), flags=re.S))
    return found[1] if found else ""


def of_file(folder: Path, path: Path) -> FileRecord:
    """Open a file and compare its accelerations."""
    signal.alarm(PATIENCE)
    try:
        apart = excluded(path)
        found = (apart,) if apart else opened(folder, path)
    except GaussError as error:
        still = any(words in str(error) for words in STILL)
        gone = not still and ON_SERVER in str(error)
        found = ("nothing moves",) if still else (without_server(path),) if gone else ("refused", reasons(str(error)))
    except TimeoutError:
        found = ("too slow",)
    except Exception as error:  # a fault of gauss
        found = ("crashed", (f"{type(error).__name__}: {error}"[:90],))
    finally:
        signal.alarm(0)
    return FileRecord(folder.name, str(path.relative_to(folder)), *found)


def opened(folder: Path, path: Path) -> tuple:
    """Status, no reasons, deviation of accelerations and whether loops are closed, of a file that opens."""
    if path.suffix.lower() == ".urdf":
        return _opened_urdf(path)
    scene = gauss.load(path, root_folder=folder)
    if all(joint.kind == "fixed" for joint in scene.joints.values()):
        return ("nothing moves",)
    if path.suffix.lower() != ".xml":
        return ("opened",)
    has_loops = bool(scene.relations or scene.couplings) or len(scene.joints) > len(scene.bodies)
    try:
        found = deviation(path, scene)
    except NotCompared:
        return ("opened",)
    return "agreed" if found < AGREED else "differs", (), found, has_loops


def _opened_urdf(path: Path) -> tuple:
    """Status of a robot that opens, the options that it needs, and its deviation."""
    _, options = opened_urdf(path)
    needs = tuple(f"{key}={value!r}" for key, value in options.items())
    try:
        found = deviation_of_urdf(path, options)
    except NotCompared:
        return "opened", needs
    return "agreed" if found < AGREED else "differs", needs, found


def without_server(path: Path) -> str:
    """Status of a file that names models on a server: whether the rest of it opens."""
    try:
        gauss.load(path, missing="left out")
    except GaussError:
        return "all on a server"
    return "some on a server, rest opens"


def excluded(path: Path) -> str:
    """Why a MJCF file is counted apart; empty where it is not."""
    if path.suffix.lower() == ".urdf":
        return REFUSED_BY_REFERENCE if is_refused_by_parser(path) else ""
    if path.suffix.lower() != ".xml":
        return ""
    text = path.read_text(errors="replace")
    if re.search(r"<(flex|flexcomp|plugin|extension)\b", text):
        return "flex or plugin"
    try:
        model = mujoco.MjModel.from_xml_path(str(path))
    except (ValueError, RuntimeError):
        return REFUSED_BY_REFERENCE
    return "flex or plugin" if model.nflex or model.nplugin else ""


def reasons(message: str) -> tuple[str, ...]:
    """Reasons of a refusal without names, places, numbers and advice."""
    text = re.sub(r"^\S+?\.(xml|sdf|world|urdf)(:\d+)?: (not modelled: )?", "", message).partition(". Remove them")[0]
    parts = [
        re.sub(r"\S*/\S+", "…", part).strip("; ").partition("; ")[0].strip() for part in re.split(r"\([^()]*:\d+\)", text)
    ]
    return tuple(sorted({NUMBER.sub("#", QUOTED.sub("…", part))[:110] for part in parts if part}))


def page(found: list[FileRecord]) -> list[str]:
    """Page of the results."""
    about = (__doc__ or "").split("\n")[6:]
    lines = ["# Model files of others", "", *about, f"gauss {gauss.__version__}, MuJoCo {mujoco.__version__}.", ""]
    rows = [_row(name, [one for one in found if name in (one.source, _format(one), "all")]) for name in _sources(found)]
    lines += table(("source", "files", *STATES, *APART, "of those that move, open"), rows)
    trees = [one.deviation for one in found if one.status == "agreed" and not one.has_loops]
    loops = [one.deviation for one in found if one.status == "agreed" and one.has_loops]
    lines += ["", "Largest relative deviation of accelerations of those that agree: "]
    lines += [f"{max(trees, default=0.0):.1e} of trees, {max(loops, default=0.0):.1e} of loops.", ""]
    return [*lines, *_needs(found), *_refusals(found), *_exceptions(found), ""]


def _sources(found: list[FileRecord]) -> list[str]:
    return [*dict.fromkeys(one.source for one in found), *dict.fromkeys(_format(one) for one in found), "all"]


def _format(one: FileRecord) -> str:
    return FORMATS[Path(one.path).suffix.lower()]


def _needs(found: list[FileRecord]) -> list[str]:
    """Options of the URDF files that open."""
    robots = [one for one in found if _format(one) == "URDF" and one.status in ("agreed", "opened", "differs")]
    count = Counter(", ".join(one.reasons) or "none" for one in robots)
    return [*table(("options that a URDF file needs", "files"), count.most_common()), ""] if count else []


def _row(source: str, own: list[FileRecord]) -> tuple:
    count = Counter(one.status for one in own)
    good = count["agreed"] + count["opened"] + count["differs"]
    moving = good + count["refused"] + count["too slow"] + count["crashed"]
    numbers = [count[status] for status in (*STATES, *APART)]
    return source, len(own), *numbers, f"{good} of {moving}: {100 * good / max(moving, 1):.0f} %"


def _refusals(found: list[FileRecord]) -> list[str]:
    refused = [one.reasons for one in found if one.status == "refused"]
    alone = Counter(one[0] for one in refused if len(one) == 1)
    count = Counter(reason for one in refused for reason in one)
    rows = [(reason, number, alone[reason]) for reason, number in count.most_common()]
    return table(("refused for", "files", "alone"), rows)


def _exceptions(found: list[FileRecord]) -> list[str]:
    odd = [one for one in found if one.status in ("differs", "crashed", "too slow")]
    rows = [(f"{one.source}/{one.path}", one.status, f"{one.deviation:.1e} {' '.join(one.reasons)}") for one in odd]
    return ["", *table(("file", "status", ""), rows)] if rows else []


def _too_slow(*_):
    raise TimeoutError


def main():
    """Command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.foreign_files", description=(__doc__ or "").split("\n")[0])
    parser.add_argument("folders", nargs="+", type=Path, help="folders of public sources")
    parser.add_argument("--out", type=Path, default=RESULTS / "foreign_files.md", help="page that is written")
    parser.add_argument("--kind", choices=KINDS, help="files of one ending only")
    parser.add_argument("--list", type=Path, help="file that gets a line for each model file")
    given = parser.parse_args()
    warnings.simplefilter("ignore")
    signal.signal(signal.SIGALRM, _too_slow)
    found = [one for folder in given.folders for one in records(folder.resolve(), given.kind)]
    if given.list:
        given.list.write_text("\n".join("\t".join(map(str, one)) for one in found))
    given.out.write_text("\n".join(page(found)), encoding="utf-8")
    print("\n".join(page(found)))


if __name__ == "__main__":
    main()
