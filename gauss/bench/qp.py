"""``gauss bench qp``: every backend on every problem, in every form, at every level."""

from collections.abc import Iterable, Iterator
from contextlib import ExitStack
from pathlib import Path

import numpy as np
from tqdm import tqdm

from gauss.backends import available
from gauss.bench import compiled
from gauss.bench.choice import chosen
from gauss.bench.levels import LEVELS, OWN
from gauss.bench.machine import header
from gauss.bench.measure import AUTO, OURS, forms_of, measure
from gauss.bench.problems import SELECTION, Problem, make_problem
from gauss.bench.reference import Reference, reference
from gauss.bench.table import Table
from gauss.bench.worker import Reply, Worker

FILE = "qp.csv"
KEYS = ("problem", "form", "backend", "level")
VALUES = (
    *("outcome", "seconds", "error", "primal", "dual", "gap", "claimed", "certified", "certificate", "iterations"),
    *("inequalities", "reason"),
)
FORMS = ("F2", "F2s")
TIMEOUT = 10.0  # [s] for all solves of a cell together
PACKAGES = ("numpy", "scipy", "qpsolvers", *sorted(("clarabel", "cvxopt", "daqp", "ecos", "highspy", "osqp", "piqp")))
PACKAGES += ("proxsuite", "qpalm", "qpax", "quadprog", "scs")


def compare(
    folder: Path,
    *,
    backends: Iterable[str] | None = None,
    problems: Iterable[str] | None = None,
    forms: Iterable[str] = FORMS,
    levels: Iterable[str] | None = None,
    fresh: bool = False,
    progress: bool = True,
) -> Table:
    """Measure all cells that are not measured yet, and return the table.

    Parameters
    ----------
    folder : Path
        Where ``qp.csv`` is, or shall be.
    backends, problems, forms, levels : sequence of str, optional
        What is measured; all that there are when not given.
    fresh : bool
        Measure again what has been measured.
    progress : bool
        Show a bar.

    Raises
    ------
    BackendError
        If there is no such backend, problem or level.
    """
    backends = chosen(backends, (AUTO, *available()), "backend")
    problems = chosen(problems, SELECTION, "problem")
    levels = chosen(levels, LEVELS, "level")
    table = Table(Path(folder) / FILE, header(*PACKAGES), KEYS, VALUES, fresh)
    cells = [
        (problem, backend, form, level)
        for problem in problems
        for backend in backends
        for form in forms_of(backend, forms)
        for level in ((OWN,) if backend in OURS else levels)
    ]
    cells += [(problem, compiled.NAME, OWN, OWN) for problem in problems]
    missing = [c for c in cells if not table.has(problem=c[0], backend=c[1], form=c[2], level=c[3])]
    with ExitStack() as stack:
        workers: dict[str, Worker] = {}
        for problem, expected, backend, form, level in tqdm(
            _with_problems(missing), total=len(missing), unit="cell", disable=not progress, desc="bench qp"
        ):
            if backend == compiled.NAME:
                row = compiled.compiled(problem, expected)
            else:
                # methods of gauss share a worker; a foreign solver gets one for itself, which it may kill
                place = "gauss" if backend in OURS else backend
                worker = workers.setdefault(place, Worker())
                if worker.process is None:
                    stack.callback(worker.stop)
                row = _row(worker.call(measure, problem.compulsion, expected, backend, form, level, timeout=TIMEOUT))
            if row is not None:
                key = {"problem": problem.name, "form": form, "backend": backend, "level": level}
                table.add(key | {"inequalities": bool(problem.compulsion.h.size)} | row)
    return table


def _with_problems(cells) -> Iterator[tuple[Problem, Reference, str, str, str]]:
    """Cells with their problem and its reference, each made once."""
    problem = expected = None
    for name, backend, form, level in cells:
        if problem is None or problem.name != name:
            problem = make_problem(name)
            expected = reference(problem.compulsion)
        yield problem, expected, backend, form, level


def _row(reply: Reply) -> dict:
    """What a worker measured, or what became of it."""
    if reply.outcome == "answered":
        return reply.value
    nothing = dict.fromkeys(("seconds", "error", "primal", "dual", "gap", "certificate"), np.nan)
    outcome = "refused" if reply.outcome == "raised" else reply.outcome
    claims = {"claimed": False, "certified": False, "iterations": 0}
    return nothing | claims | {"outcome": outcome, "reason": reply.reason}
