"""``gauss bench fuzz``: random problems by the thousand, block by block, on all processors, in processes that may die."""

import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import CancelledError, ThreadPoolExecutor, as_completed
from pathlib import Path
from queue import SimpleQueue
from threading import Event

import numpy as np
from tqdm import tqdm

from gauss.backends import available
from gauss.bench.fuzz.examine import COUNTS, TYPICAL, WORST, examine, lost, together
from gauss.bench.fuzz.problems import KINDS
from gauss.bench.levels import AUTO, OURS
from gauss.bench.markdown import head, table
from gauss.bench.measure import WRONG
from gauss.bench.qp import PACKAGES
from gauss.bench.table import Measurement, ResultTable, chosen
from gauss.bench.worker import Worker

FUZZ = Measurement("fuzz", ("seed", "kind", "first", "size", "backend"), (*COUNTS, *WORST, *TYPICAL), PACKAGES)
BLOCK = 50  # problems of one kind that make a row
SHARE = 20  # QP solvers get every so many-th block: some take half a second for a problem
PROBLEM_TIME = 10.0  # [s] that a problem may take
BLOCK_TIME = 300.0  # [s] that a block may take before its problems are tried one by one
HOW = f"""Every answer is certified as users get it, and compared with a reference whose residuals have 50 digits, body
by body and joint by joint. *Certified*: the certificate confirms the answer to 1e-6. *Flagged*: it does not, and says so.
*Refused*: no finite answer. *Claims, wrong*: the backend says that it has solved the problem, and is off by more than
{WRONG:g}; the certificate is what catches that. *Silent*: certified, yet off by more than 1e-6. *Understated*: the error is
above what the certificate says. *Error / certificate*: the largest found. Medians are those of certified answers. Where an
answer hinges on which rows count as redundant, the certificate holds for the choice that gauss's recursion makes. *No
reference*: rows contradict each other, or are so close to dependent that refinement does not converge; nothing is compared.
Blocks of problems are solved in processes of their own, so that a crash is counted and costs nothing else. QP solvers are
asked for 1e-9, on form F2s."""


def fuzz(
    folder: Path,
    *,
    count: int = 10_000,
    seed: int = 0,
    backends: Iterable[str] | None = None,
    share: int = SHARE,
    fresh: bool = False,
    progress: bool = True,
) -> ResultTable:
    """Examine all blocks that are not examined yet, and return the table.

    BackendError if there is no such backend.

    Parameters
    ----------
    folder : Path
        Where ``fuzz.csv`` is, or shall be.
    count : int
        Problems; as many more as fill the last blocks.
    seed : int
        Another seed, other problems.
    backends : sequence of str, optional
        All that there are when not given.
    share : int
        Backends that are not gauss's own get one block out of so many; none at 0.
    fresh : bool
        Examine again what has been examined.
    progress : bool
        Show a bar.
    """
    names = chosen(backends, dict.fromkeys((*OURS, *available())), "backend")
    table = FUZZ.table(folder, fresh)
    tasks = list(_tasks(table, seed, names, share, _blocks(count, BLOCK)))
    lanes: SimpleQueue = SimpleQueue()
    workers = [Worker() for _ in range(os.cpu_count() or 1)]
    for worker in workers:
        lanes.put(worker)

    ended = Event()  # an interruption ends the threads, too

    def run(task):
        worker = lanes.get()

        def call(*arguments, timeout):
            if ended.is_set():
                raise CancelledError
            return worker.call(*arguments, timeout=timeout)

        try:
            return task, _block(call, seed, *task)
        finally:
            if task[1][0] not in OURS:
                worker.stop()  # some QP solvers keep what they compiled for each size
            lanes.put(worker)

    pool = ThreadPoolExecutor(len(workers))
    bar = tqdm(total=sum(len(numbers) for numbers, _ in tasks), unit="problem", disable=not progress, desc="bench fuzz")
    try:
        for done in as_completed([pool.submit(run, task) for task in tasks]):
            (numbers, _), rows = done.result()
            for row in rows:
                table.add(_key(seed, numbers) | row)
            bar.update(len(numbers))
    finally:
        ended.set()
        pool.shutdown(wait=False, cancel_futures=True)
        for worker in workers:
            worker.stop()
        bar.close()
    return table


def _blocks(count: int, size: int) -> list[list[int]]:
    """Numbers of at least so many problems, each list of one kind."""
    kinds, rounds = len(KINDS), -(-count // len(KINDS))
    size = min(size, rounds)
    starts = [kind + kinds * first for first in range(0, rounds, size) for kind in range(kinds)]
    return [list(range(start, start + kinds * size, kinds)) for start in starts]


def _tasks(
    table: ResultTable, seed: int, names, share: int, blocks: list[list[int]]
) -> Iterator[tuple[list[int], list[str]]]:
    """Blocks with the backends that are still to be examined: gauss's own together, each QP solver alone."""
    ours = sorted((name for name in names if name in OURS), key=lambda name: name == AUTO)  # the last one takes every kind
    groups = [(ours, blocks)] if ours else []
    sampled = blocks[: -(-len(blocks) // share)] if share else []
    groups += [([name], sampled) for name in names if name not in ours]
    for group, part in groups:
        for numbers in part:
            if not table.has(**_key(seed, numbers), backend=group[-1]):
                yield numbers, group


def _key(seed: int, numbers: list[int]) -> dict:
    return {"seed": seed, "kind": list(KINDS)[numbers[0] % len(KINDS)], "first": numbers[0], "size": len(numbers)}


def _block(call: Callable, seed: int, numbers: list[int], backends: list[str]) -> list[dict]:
    """Rows of a block; where its process dies or hangs, its problems and backends are tried one by one."""
    reply = call(examine, seed, numbers, backends, timeout=BLOCK_TIME)
    if reply.outcome == "answered":
        return reply.value
    if reply.outcome == "raised":
        raise RuntimeError(reply.reason)
    rows = []
    for backend in backends:
        cells: list = []
        for number in numbers:
            reply = call(examine, seed, [number], [backend], timeout=PROBLEM_TIME)
            outcome = {"crashed": "crashed", "timed out": "timed_out"}.get(reply.outcome)
            cells += [lost(number, outcome)] if outcome else reply.value
        rows += [{"backend": backend} | together(cells)] if cells else []
    return rows


def publish(folder: Path, path: Path) -> list[Path]:
    """Write ``fuzz.md`` beside the table; return what was written."""
    return [FUZZ.write_page(folder, path, markdown)]


def markdown(rows: list[dict], header: Iterable[str]) -> str:
    """The whole report."""
    names = list(dict.fromkeys(row["backend"] for row in rows))
    names.sort(key=lambda name: (name not in OURS, name != AUTO))
    seeds = ", ".join(f"{seed:g}" for seed in sorted({row["seed"] for row in rows}))
    lines = [*head("Random problems", [*header, f"seeds: {seeds}"]), HOW, "", "## Verdict", ""]
    lines += _verdict("gauss's methods", [row for row in rows if row["backend"] in OURS])
    lines += _verdict("QP solvers", [row for row in rows if row["backend"] not in OURS])
    lines += ["", "## Backends", "", *_table("backend", names, rows)]
    lines += ["", "## Kinds of problems, gauss's `auto`", ""]
    lines += _table("kind", KINDS, [row for row in rows if row["backend"] == AUTO])
    lines += ["", *(f"* **{kind}**: {_note(function)}" for kind, function in KINDS.items())]
    return "\n".join(lines) + "\n"


def _verdict(what: str, rows: list[dict]) -> list[str]:
    if not rows:
        return []
    whole = together(rows)
    return [
        f"* {what}: {whole['problems']:.0f} answers asked for; certified and wrong {whole['silent']:.0f}; "
        f"worse than the certificate says {whole['understated']:.0f}; crashes {whole['crashed']:.0f}."
    ]


COLUMNS = {  # titles and templates of the counts and figures of together()
    "problems": "{problems:.0f}",
    "certified": "{certified:.0f}",
    "flagged": "{flagged:.0f}",
    "refused": "{refused:.0f}",
    "claims, wrong": "{liar:.0f}",
    "silent": "{silent:.0f}",
    "understated": "{understated:.0f}",
    "crashed": "{crashed:.0f}",
    "timed out": "{timed_out:.0f}",
    "no reference": "{unknown:.0f}",
}
TYPICAL_COLUMNS = ("error / certificate", "median error", "median certificate", "median time")


def _table(what: str, names: Iterable[str], rows: list[dict]) -> list[str]:
    groups = ((name, [row for row in rows if row[what] == name]) for name in names)
    return table([what, *COLUMNS, *TYPICAL_COLUMNS], (_line(name, together(found)) for name, found in groups if found))


def _line(name: str, row: dict) -> list[str]:
    counts = [cell.format(**row) for cell in COLUMNS.values()]
    figures = [_figure(row["ratio"], ".3f"), _figure(row["error"], ".0e"), _figure(row["certificate"], ".0e")]
    return [name, *counts, *figures, _figure(1e3 * row["seconds"], ".2g") + " ms"]


def _figure(value: float, form: str) -> str:
    return "–" if np.isnan(value) else f"{value:{form}}"


def _note(function) -> str:
    return function.__doc__.strip()
