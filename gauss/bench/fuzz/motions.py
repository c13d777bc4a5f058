"""``gauss bench fuzz-motions``: random scenes moved by independent routes, in a process that may die."""

from collections import Counter
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from tqdm import tqdm

from gauss import save
from gauss.bench.fuzz.routes import BAD, examine_motion
from gauss.bench.fuzz.scenes import moved_scene
from gauss.bench.machine import header
from gauss.bench.table import Table, header_of, read_table
from gauss.bench.worker import Worker
from gauss.errors import GaussError

FILE = "fuzz_motions.csv"
PACKAGES = ("numpy", "scipy", "llvmlite")
KEYS = ("seed", "number")
VALUES = ("base", "elements", "integrator", "verdict", "off", "claim", "warned", "seconds", "why")
TIMEOUT = 400.0  # [s] that a scene may take by the clock: four routes on a machine that others use
RENEWED = 200  # scenes after which a new process begins, for machine code stays in memory

HOW = """Every scene is moved by what users get (compiled, the integrator of the scene, an estimate of the global error)
and by the certified recursion with a tenth of the tolerance, some by `rollout`, too. *Agree*: within a small multiple
of the claimed error and the tolerance. *Told*: apart, and a warning or the estimate says so. *Refused*: a `GaussError` by
both, *refused once*: by one. *Sensitive*: a third route (dopri5, kkt) differs from both, too. Bad are: *silent*: apart, and
nothing says so; *raised*: an exception that is no `GaussError`; *stray*: a warning that is none of gauss's; *timed out*: a
route took more than 20 s of processor time; *crashed*: the process died or hung. A scene is made again by
`gauss.bench.fuzz.scenes.moved_scene(seed, number).scene`."""


def fuzz_motions(
    folder: Path, *, count: int = 10_000, seed: int = 0, first: int = 0, fresh: bool = False, progress: bool = True
) -> Table:
    """Examine all scenes that are not examined yet, and return the table.

    Parameters
    ----------
    folder : Path
        Where ``fuzz_motions.csv`` is, or shall be; scenes with bad verdicts go into its ``fuzz_motions`` where a file can
        hold them.
    count, first : int
        How many scenes, and the number of the first.
    seed : int
        Another seed, other scenes.
    fresh : bool
        Examine again what has been examined.
    progress : bool
        Show a bar.
    """
    table = Table(Path(folder) / FILE, header(*PACKAGES), KEYS, VALUES, fresh)
    numbers = [number for number in range(first, first + count) if not table.has(seed=seed, number=number)]
    with Worker() as worker:
        for done, number in enumerate(tqdm(numbers, unit="scene", disable=not progress, desc="bench fuzz-motions")):
            if done % RENEWED == RENEWED - 1:
                worker.stop()
            row = _examined(worker, seed, number)
            if row["verdict"] in BAD:
                worker.stop()  # whatever state it left behind
                _keep(Path(folder) / "fuzz_motions", seed, number)
            table.add(row)
    return table


def _examined(worker: Worker, seed: int, number: int) -> dict:
    reply = worker.call(examine_motion, seed, number, timeout=TIMEOUT)
    if reply.outcome == "answered":
        return reply.value
    lost = {"seed": seed, "number": number} | dict.fromkeys(VALUES, "") | dict.fromkeys(("off", "claim", "seconds"), np.nan)
    return lost | {"verdict": "raised" if reply.outcome == "raised" else "crashed", "why": reply.reason}


def _keep(folder: Path, seed: int, number: int):
    """Write a scene with a bad verdict as a file, if one can hold it; its seed and number make it again in any case."""
    folder.mkdir(parents=True, exist_ok=True)
    try:
        save(moved_scene(seed, number).scene, folder / f"{seed}_{number}.toml")
    except GaussError:  # laws that are Python functions
        pass


def publish(folder: Path, table: Path) -> list[Path]:
    """Write ``fuzz_motions.md`` beside the table; return what was written."""
    report = folder / "fuzz_motions.md"
    report.write_text(markdown(read_table(table), header_of(table)), encoding="utf-8")
    return [report]


def markdown(rows: list[dict], header: Iterable[str]) -> str:
    """The whole report."""
    lines = ["# Motions of random scenes", "", *(f"- {line}" for line in header), "", HOW, "", "## Verdicts", ""]
    counts = Counter(row["verdict"] for row in rows)
    order = [*(verdict for verdict, _ in counts.most_common() if verdict not in BAD), *BAD]
    lines += [f"{len(rows)} scenes.", "", "| verdict | scenes |", "|---|---|"]
    lines += [f"| {verdict} | {counts[verdict]} |" for verdict in order]
    for what in ("base", "integrator"):
        lines += ["", f"## By {what}", "", "| | " + " | ".join(order) + " |", "|---" * (len(order) + 1) + "|"]
        for value in sorted({str(row[what]) for row in rows}):
            mine = Counter(row["verdict"] for row in rows if row[what] == value)
            lines.append(f"| {value or '–'} | " + " | ".join(str(mine[verdict]) for verdict in order) + " |")
    said = Counter(kind for row in rows for kind in str(row["warned"]).split("+") if kind and not kind.startswith("!"))
    lines += ["", "## Warnings", "", "| class | scenes |", "|---|---|", *(f"| {k} | {n} |" for k, n in said.most_common())]
    refusals = Counter(_class(row["why"]) for row in rows if str(row["verdict"]).startswith("refused"))
    lines += [
        "",
        "## Refusals",
        "",
        "| message | scenes |",
        "|---|---|",
        *(f"| {k} | {n} |" for k, n in refusals.most_common()),
    ]
    lines += [
        "",
        "## Bad",
        "",
        "| seed, number | verdict | elements | integrator | off | why |",
        "|---|---|---|---|---|---|",
    ]
    for row in (row for row in rows if row["verdict"] in BAD):
        cells = f"{row['elements']} | {row['integrator']} | {row['off']:.2g} | {row['why']}"
        lines.append(f"| {row['seed']:.0f}, {row['number']:.0f} | {row['verdict']} | {cells} |")
    return "\n".join(lines) + "\n"


def _class(why: str) -> str:
    """A message without its names and numbers."""
    words = str(why).replace("|", "/").split()
    plain = ["…" if any(letter.isdigit() or letter in "'\"" for letter in word) else word for word in words]
    return " ".join(word for k, word in enumerate(plain) if word != "…" or k and plain[k - 1] != "…")[:90]
