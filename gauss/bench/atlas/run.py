"""``gauss bench stability``: every method in every case, each in a process that may die."""

import resource
import time
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from tqdm import tqdm

from gauss.bench.atlas import CASES
from gauss.bench.atlas.case import HONEST, SILENT, SLOW, judged
from gauss.bench.atlas.methods import METHODS
from gauss.bench.contest import with_time
from gauss.bench.measurement import Measurement, chosen
from gauss.bench.table import ResultTable
from gauss.bench.worker import Reply, Workers

CELL_TIME = 10.0  # [s] that a cell may take
MEMORY = 8 * 2**30  # [bytes] of one process
STABILITY = Measurement(
    "stability",
    ("case", "method"),
    ("verdict", "figure", "seconds", "words"),
    ("numpy", "scipy", "llvmlite", "clarabel", "daqp", "highspy", "osqp", "piqp", "proxsuite", "qpalm", "quadprog"),
)


def explore(
    folder: Path,
    *,
    cases: Iterable[str] | None = None,
    methods: Iterable[str] | None = None,
    fresh: bool = False,
    progress: bool = True,
) -> ResultTable:
    """Examine all cells that have no verdict yet, and return the table.

    BackendError if there is no such case or method.

    Parameters
    ----------
    folder : Path
        Where ``stability.csv`` is, or shall be.
    cases, methods : sequence of str, optional
        What is examined; all that there are when not given.
    fresh : bool
        Examine again what has a verdict.
    progress : bool
        Show a bar.
    """
    cases, methods = chosen(cases, CASES, "case"), chosen(methods, METHODS, "method")
    table = STABILITY.table(folder, fresh)
    missing = [(case, method) for case in cases for method in methods if not table.has(case=case, method=method)]
    name = data = None
    with Workers() as workers:
        for case, method in tqdm(missing, unit="cell", disable=not progress, desc="bench stability"):
            if case != name:
                name, data = case, CASES[case].prepare()
            place = "gauss" if METHODS[method].ours else METHODS[method].backend
            reply = workers[place].call(_cell, case, method, data, timeout=CELL_TIME)
            table.add({"case": case, "method": method} | _row(reply))
    return table


def _cell(case: str, method: str, data) -> dict:
    """One cell, in a worker."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    verdict, seconds = with_time(lambda: judged(CASES[case], METHODS[method], data), time.perf_counter)
    return verdict | {"seconds": seconds}


def _row(reply: Reply) -> dict:
    if reply.outcome == "answered":
        return reply.value
    # an exception that is no GaussError reports the failure, too, though not in words for users
    verdict = {"timed out": SLOW, "raised": HONEST, "crashed": SILENT}[reply.outcome]
    return {"verdict": verdict, "figure": np.nan, "seconds": np.nan, "words": reply.reason}
