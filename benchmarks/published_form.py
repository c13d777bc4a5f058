"""Maros and Mészáros's problems in the form that qpbenchmark has published them in, asked by qpsolvers alone.

It imports nothing of gauss, so that it runs beside the versions of solvers with which the published table was measured, in
an environment of their own; the settings are those that ``python -m benchmarks.maros_meszaros`` leaves in its work folder:

    pip install qpsolvers==4.3.3 clarabel==0.9.0 cvxopt==1.3.2 daqp==0.5.1 highspy==1.7.2 osqp==0.6.7.post0
    pip install piqp==0.4.1 proxsuite==0.6.6 qpalm==1.2.3 scs==3.2.6 quadprog==0.1.12 ecos==2.0.14 scipy==1.13.1
    python benchmarks/published_form.py FOLDER/data WORK/settings.json verdicts.csv
    python -m benchmarks.maros_meszaros FOLDER --then verdicts.csv

Times are CPU seconds of the process, which a busy machine does not change.
"""

import argparse
import csv
import json
import time
import warnings
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, TimeoutError
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import qpsolvers
from scipy import io, sparse

LIMIT = 1.0  # [CPU s] of one solve; a later answer is none
WALL_LIMIT = 60.0  # [s] of wall time after which the process of a solver is ended
RESIDUALS = ("primal", "dual", "gap")
COLUMNS = ("problem", "solver", "level", "claimed", "seconds", *RESIDUALS)


def main():
    """Ask every solver for every problem at every level, one process for all until it dies."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("data", type=Path, help="folder of the .mat files")
    parser.add_argument("settings", type=Path, help="settings by solver and level, and the names of the problems")
    parser.add_argument("verdicts", type=Path, help="table to write")
    given = parser.parse_args()
    asked = json.loads(given.settings.read_text(encoding="utf-8"))
    cells = [
        (problem, solver, level, settings)
        for problem in asked["problems"]
        for solver, levels in asked["settings"].items()
        for level, settings in levels.items()
        if solver in qpsolvers.available_solvers
    ]
    with open(given.verdicts, "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, COLUMNS)
        writer.writeheader()
        for (problem, solver, level, _), found in zip(cells, _answers(given.data, cells), strict=True):
            writer.writerow({"problem": problem, "solver": solver, "level": level} | found)
            file.flush()


def _answers(data: Path, cells):
    """What is found for each cell; a process that dies or hangs finds nothing, and another takes its place."""
    pool = None
    for problem, solver, _, settings in cells:
        pool = pool or ProcessPoolExecutor(1, get_context("spawn"))
        try:
            yield pool.submit(solved, data / f"{problem}.mat", solver, settings).result(WALL_LIMIT)
        except (BrokenProcessPool, TimeoutError):
            for process in list(pool._processes.values()):  # it offers no other way to end one that hangs
                process.kill()
            pool.shutdown(wait=False)
            pool = None
            yield nothing()
        except Exception:  # what a solver raises is no answer
            yield nothing()


def nothing(seconds: float = float("nan")) -> dict:
    """Row of no answer."""
    return {"claimed": False, "seconds": seconds} | dict.fromkeys(RESIDUALS, float("nan"))


def solved(path: Path, solver: str, settings: dict) -> dict:
    """Claim, CPU seconds and residuals of a solver for the problem of a file whose last n rows are bounds."""
    problem = published_form(path, sparse.csc_matrix if solver in qpsolvers.sparse_solvers else _dense)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        begin = time.process_time()
        found = qpsolvers.solve_problem(problem, solver, **settings)
        seconds = time.process_time() - begin
    if seconds > LIMIT or found.x is None:
        return nothing(seconds)
    residuals = found.primal_residual(), found.dual_residual(), found.duality_gap()
    return {"claimed": bool(found.found), "seconds": seconds} | dict(zip(RESIDUALS, map(float, residuals), strict=True))


def published_form(path: Path, take: Callable) -> qpsolvers.Problem:
    """Problem of a file: bounds as bounds, infinite ones among them; ``take`` makes its matrices."""
    data = io.loadmat(path)
    rows, (q, lower, upper) = sparse.csc_matrix(data["A"], dtype=float), (np.ravel(data[s]).astype(float) for s in "qlu")
    lower, upper = (np.where(abs(v) > 9e19, np.copysign(np.inf, v), v) for v in (lower, upper))
    m = lower.size - q.size
    held, sides = lower[:m] == upper[:m], ((1.0, upper[:m]), (-1.0, -lower[:m]))
    free = [(sign, bound, ~held & (bound < np.inf)) for sign, bound in sides]
    G = sparse.vstack([sign * rows[:m][here] for sign, _, here in free], format="csc")
    h = np.concatenate([bound[here] for _, bound, here in free])
    A, b = rows[:m][held], upper[:m][held]
    below = (take(G), h) if h.size else (None, None)
    equal = (take(A), b) if b.size else (None, None)
    return qpsolvers.Problem(take(data["P"].astype(float)), q, below[0], below[1], equal[0], equal[1], lower[m:], upper[m:])


def _dense(matrix) -> np.ndarray:
    return matrix.toarray()


if __name__ == "__main__":
    main()
