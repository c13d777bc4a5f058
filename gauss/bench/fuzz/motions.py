"""``gauss bench fuzz-motions``: random scenes moved by independent routes, in a process that may die."""

from collections import Counter
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from tqdm import tqdm

from gauss import save
from gauss.bench.fuzz.routes import BAD, examine_motion
from gauss.bench.fuzz.scenes import moved_scene
from gauss.bench.markdown import head, table
from gauss.bench.table import Measurement, ResultTable
from gauss.bench.worker import Worker
from gauss.errors import GaussError

FUZZ_MOTIONS = Measurement(
    "fuzz_motions",
    ("seed", "number"),
    ("base", "elements", "integrator", "verdict", "off", "claim", "compared", "warned", "seconds", "why"),
    ("numpy", "scipy", "llvmlite"),
)
SCENE_TIME = 400.0  # [s] that a scene may take by the clock: four routes on a machine that others use
RENEWED = 200  # scenes after which a new process begins, for machine code stays in memory

ENVIRONMENT = {"GAUSS_TIER": "quick", "GAUSS_CACHE": ""}  # every scene is moved once: nothing is optimised or kept on disk

HOW = """Every scene is moved by machine code (the integrator of the scene, rtol 1e-7, an estimate of the global error) and
by the certified recursion in numpy, some by `rollout`, too. Phases between events are compiled at once; of every fourth
scene above the compile threshold only, as users get it. *Agree*: within a small multiple of the claimed error and the
tolerance, if need be with a tenth of the tolerance in the second route. *Told*: apart, and a warning or the estimate says
so. *Refused*: a `GaussError` by both, *refused once*: by one. *Sensitive*: a third route (dopri5, kkt) differs from both,
too. A second route that takes more than 2 s of processor time is compared up to the last sample that it reached; *compared*
is the least share of the duration that all routes reached. Bad are: *silent*: apart, and nothing says so; *raised*: an
exception that is no `GaussError`; *stray*: a warning that is none of gauss's; *timed out*: a route took more than 10 s of
processor time, or the second reached no sample; *crashed*: the process died or hung. A scene is made again by
`gauss.bench.fuzz.scenes.moved_scene(seed, number).scene`."""


def fuzz_motions(
    folder: Path, *, count: int = 10_000, seed: int = 0, first: int = 0, fresh: bool = False, progress: bool = True
) -> ResultTable:
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
    table = FUZZ_MOTIONS.table(folder, fresh)
    numbers = [number for number in range(first, first + count) if not table.has(seed=seed, number=number)]
    with Worker(ENVIRONMENT) as worker:
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
    reply = worker.call(examine_motion, seed, number, timeout=SCENE_TIME)
    if reply.outcome == "answered":
        return reply.value
    lost = (
        {"seed": seed, "number": number}
        | dict.fromkeys(FUZZ_MOTIONS.values, "")
        | dict.fromkeys(("off", "claim", "compared", "seconds"), np.nan)
    )
    return lost | {"verdict": "raised" if reply.outcome == "raised" else "crashed", "why": reply.reason}


def _keep(folder: Path, seed: int, number: int):
    """Write a scene with a bad verdict as a file, if one can hold it; its seed and number make it again in any case."""
    folder.mkdir(parents=True, exist_ok=True)
    try:
        save(moved_scene(seed, number).scene, folder / f"{seed}_{number}.toml")
    except GaussError:  # laws that are Python functions
        pass


def publish(folder: Path, path: Path) -> list[Path]:
    """Write ``fuzz_motions.md`` beside the table; return what was written."""
    return [FUZZ_MOTIONS.write_page(folder, path, markdown)]


def markdown(rows: list[dict], header: Iterable[str]) -> str:
    """The whole report."""
    counts = Counter(row["verdict"] for row in rows)
    order = [*(verdict for verdict, _ in counts.most_common() if verdict not in BAD), *BAD]
    lines = [*head("Motions of random scenes", header), HOW, "", "## Verdicts", "", f"{len(rows)} scenes.", ""]
    lines += table(["verdict", "scenes"], ([verdict, counts[verdict]] for verdict in order))
    for what in ("base", "integrator"):
        lines += ["", f"## By {what}", "", *_verdicts_by(what, rows, order)]
    lines += ["", "## Warnings", "", *table(["class", "scenes"], _warned(rows).most_common())]
    refusals = Counter(_class(row["why"]) for row in rows if str(row["verdict"]).startswith("refused"))
    lines += ["", "## Refusals", "", *table(["message", "scenes"], refusals.most_common())]
    lines += ["", "## Bad", "", _timed_out(rows), "", *_bad(rows)]
    return "\n".join(lines) + "\n"


def _verdicts_by(what: str, rows: list[dict], order: list[str]) -> list[str]:
    """Verdicts by the values of a column."""
    counts: dict[str, Counter] = {}
    for row in rows:
        counts.setdefault(str(row[what]), Counter())[row["verdict"]] += 1
    return table([what, *order], ([value or "–", *map(counts[value].__getitem__, order)] for value in sorted(counts)))


def _warned(rows: list[dict]) -> Counter:
    """Warnings of gauss by class."""
    kinds = (kind for row in rows for kind in str(row["warned"]).split("+"))
    return Counter(kind for kind in kinds if kind and not kind.startswith("!"))


def _timed_out(rows: list[dict]) -> str:
    """How many scenes timed out, and by which limit."""
    late = [str(row["why"]) for row in rows if row["verdict"] == "timed out"]
    first, second = (sum(why.startswith(f"{route}:") for why in late) for route in ("first", "second"))
    return (
        f"{len(late)} scenes timed out, so that nothing is said of them: in {first} the first route took more than 10 s of "
        f"processor time, in {second} the second reached no sample; the last column names the place where it was."
    )


def _bad(rows: list[dict]) -> list[str]:
    titles = ["seed, number", "verdict", "elements", "integrator", "off", "why"]
    return table(
        titles,
        (
            [f"{row['seed']:.0f}, {row['number']:.0f}", row["verdict"], row["elements"], row["integrator"]]
            + [f"{row['off']:.2g}", row["why"]]
            for row in rows
            if row["verdict"] in BAD
        ),
    )


def _class(why: str) -> str:
    """A message without its names and numbers."""
    words = str(why).replace("|", "/").split()
    plain = ["…" if any(letter.isdigit() or letter in "'\"" for letter in word) else word for word in words]
    return " ".join(word for k, word in enumerate(plain) if word != "…" or k and plain[k - 1] != "…")[:90]
