"""Model files of others: how many open, what the others are refused for, and how far accelerations are from MuJoCo's.

Run it with:

    python -m benchmarks.foreign_files FOLDER...

Each folder holds a copy of a public source, as a wheel of the Python package index unpacked (gymnasium, gymnasium-robotics,
dm_control, brax, robosuite) or a checkout (google-deepmind/mujoco, gazebosim/gz-sim, gazebosim/sdformat). It is the root
folder of its files. Files that MuJoCo itself refuses, that hold flexible bodies or plugins, or where nothing moves, are
counted apart. Accelerations are compared at random states without contacts, limits and friction.
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
from gauss.errors import GaussError

RESULTS = Path(__file__).parent / "results"
PATIENCE = 120  # s for each file
AGREED = 1e-9  # relative deviation of accelerations; of closed loops, whose reference is differenced, AGREED_LOOPS
AGREED_LOOPS = 1e-5
KINDS = {".xml": "mujoco", ".sdf": "sdf", ".world": "sdf"}
STILL = ("nothing moves", "there is no model in it")
QUOTED, NUMBER = re.compile(r"'[^']*'"), re.compile(r"-?\d+(\.\d+)?(e[-+]?\d+)?")


class FileRecord(NamedTuple):
    """What became of a file: status, reasons of a refusal, deviation of accelerations (nan where not compared)."""

    source: str
    path: str
    status: str
    reasons: tuple[str, ...]
    deviation: float = float("nan")
    has_loops: bool = False


def records(folder: Path):
    """What became of every model file below a folder."""
    for path in sorted(path for path in folder.rglob("*") if path.suffix.lower() in KINDS and path.is_file()):
        if root_of(path) == KINDS[path.suffix.lower()]:
            yield of_file(folder, path)


def root_of(path: Path) -> str:
    """Outermost element of a file; empty where it is no XML."""
    found = re.search(r"<([A-Za-z_]\w*)", re.sub(r"<!--.*?-->", "", path.read_text(errors="replace"), flags=re.S))
    return found[1] if found else ""


def of_file(folder: Path, path: Path) -> FileRecord:
    """Open a file and compare its accelerations."""
    make = lambda status, *rest: FileRecord(folder.name, str(path.relative_to(folder)), status, *rest)  # noqa: E731
    if path.suffix == ".xml":
        apart = excluded(path)
        if apart:
            return make(apart, ())
    signal.alarm(PATIENCE)
    try:
        scene = gauss.load(path, root_folder=folder)
        status = "opened" if any(joint.kind != "fixed" for joint in scene.joints.values()) else "nothing moves"
        if path.suffix != ".xml" or status != "opened":
            return make(status, ())
        try:
            found = deviation(path, scene)
            agreed = found < (AGREED_LOOPS if scene.relations or scene.couplings else AGREED)
            return make("agreed" if agreed else "differs", (), found, bool(scene.relations))
        except NotCompared:
            return make("opened", (), float("nan"))
    except GaussError as error:
        if any(words in str(error) for words in STILL):
            return make("nothing moves", ())
        return make("refused", reasons(str(error)))
    except TimeoutError:
        return make("too slow", ())
    except Exception as error:  # a fault of gauss
        return make("crashed", (f"{type(error).__name__}: {error}"[:90],))
    finally:
        signal.alarm(0)


def excluded(path: Path) -> str:
    """Why a MJCF file is counted apart; empty where it is not."""
    text = path.read_text(errors="replace")
    if re.search(r"<(flex|flexcomp|plugin|extension)\b", text):
        return "flex or plugin"
    try:
        model = mujoco.MjModel.from_xml_path(str(path))
    except (ValueError, RuntimeError):
        return "refused by MuJoCo"
    return "flex or plugin" if model.nflex or model.nplugin else ""


def reasons(message: str) -> tuple[str, ...]:
    """Reasons of a refusal without names, places and numbers."""
    message = re.sub(r"\([^()]*:\d+\)", "", message)
    text = re.sub(r"^\S+?\.(xml|sdf|world)(:\d+)?: (not modelled: )?", "", message).partition(". Remove them")[0]
    return tuple(sorted({NUMBER.sub("#", QUOTED.sub("…", one)).strip()[:110] for one in text.split("; ")}))


def page(found: list[FileRecord]) -> list[str]:
    """Page of the results."""
    states = ("agreed", "opened", "nothing moves", "differs", "refused", "too slow", "crashed")
    apart = ("refused by MuJoCo", "flex or plugin")
    lines = [
        "# Model files of others",
        "",
        *(__doc__ or "").split("\n")[9:],
        f"gauss {gauss.__version__}, MuJoCo {mujoco.__version__}.",
        "",
    ]
    lines += [
        f"| source | files | {' | '.join((*states, *apart))} | of those that move, open |",
        "|---" * (3 + len(states + apart)) + "|",
    ]
    for source in [*dict.fromkeys(one.source for one in found), "all"]:
        own = [one for one in found if source in (one.source, "all")]
        count = Counter(one.status for one in own)
        opened = count["agreed"] + count["opened"] + count["differs"]
        moving = opened + count["refused"] + count["too slow"] + count["crashed"]
        share = f"{opened} of {moving}: {100 * opened / max(moving, 1):.0f} %"
        lines.append(f"| {source} | {len(own)} | {' | '.join(str(count[s]) for s in (*states, *apart))} | {share} |")
    worst = [one.deviation for one in found if one.status == "agreed" and not one.has_loops]
    lines += ["", f"Largest relative deviation of accelerations of the trees that agree: {max(worst, default=0.0):.1e}.", ""]
    lines += ["| refused for | files | alone |", "|---|---|---|"]
    refused = [one.reasons for one in found if one.status == "refused"]
    alone = Counter(one[0] for one in refused if len(one) == 1)
    for reason, number in Counter(reason for one in refused for reason in one).most_common():
        lines.append(f"| {reason.replace('|', '/')} | {number} | {alone[reason]} |")
    odd = [one for one in found if one.status in ("differs", "crashed", "too slow")]
    lines += ["", "| file | status | |", "|---|---|---|"] if odd else []
    lines += [f"| {one.source}/{one.path} | {one.status} | {one.deviation:.1e} {' '.join(one.reasons)} |" for one in odd]
    return [*lines, ""]


def _too_slow(*_):
    raise TimeoutError


def main():
    """Command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.foreign_files", description=(__doc__ or "").split("\n")[0])
    parser.add_argument("folders", nargs="+", type=Path, help="folders of public sources")
    parser.add_argument("--out", type=Path, default=RESULTS / "foreign_files.md", help="page that is written")
    parser.add_argument("--list", type=Path, help="file that gets a line for each model file")
    given = parser.parse_args()
    warnings.simplefilter("ignore")
    signal.signal(signal.SIGALRM, _too_slow)
    found = [one for folder in given.folders for one in records(folder.resolve())]
    if given.list:
        given.list.write_text("\n".join("\t".join(map(str, one)) for one in found))
    given.out.write_text("\n".join(page(found)), encoding="utf-8")
    print("\n".join(page(found)))


if __name__ == "__main__":
    main()
