"""``gauss bench stability``: every method in every case, each in a process that may die."""

import resource
import time
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from tqdm import tqdm

from gauss.bench.atlas import CASES
from gauss.bench.atlas.case import DEGRADED, HONEST, PASSED, SILENT, SLOW, VERDICTS, judged
from gauss.bench.atlas.methods import DEFAULT, METHODS, Method
from gauss.bench.contest import with_time
from gauss.bench.levels import AUTO
from gauss.bench.markdown import head, table, when_and_where
from gauss.bench.table import Measurement, ResultTable, chosen, header_of, read_table
from gauss.bench.worker import Reply, Workers

CELL_TIME = 10.0  # [s] that a cell may take
MEMORY = 8 * 2**30  # [bytes] of one process
STABILITY = Measurement(
    "stability",
    ("case", "method"),
    ("verdict", "figure", "seconds", "words"),
    ("numpy", "scipy", "llvmlite", "clarabel", "daqp", "highspy", "osqp", "piqp", "proxsuite", "qpalm", "quadprog"),
)
MARKS = {PASSED: "✓", DEGRADED: "~", HONEST: "✗", SILENT: "**silent**", SLOW: "slow"}

HOW = """A cell is a method in a case: passed, degraded (~), failed and said so (✗), timed out (slow), or failed silently,
with numbers that are wrong and no word about it. The figure behind it is the criterion of the case. Every backend is
judged twice, methods of gauss and QP solvers alike: certified at every evaluation (slow path), as users get it, and
believed as it claims. QP solvers are called as gauss calls them for a user, at a tolerance of 1e-9."""


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


def publish(folder: Path, path: Path) -> list[Path]:
    """Write ``stability.md`` and the heat map beside the table; return what was written."""
    rows, header = read_table(path), header_of(path)
    return [STABILITY.write_page(folder, path, markdown), _map(folder / "stability.png", rows, header)]


def markdown(rows, header) -> str:
    """The whole report."""
    cells = {(row["case"], row["method"]): row for row in rows}
    cases, methods = (list(dict.fromkeys(row[key] for row in rows)) for key in ("case", "method"))
    lines = [*head("Where methods fail", header), HOW, "", "![The atlas](stability.png)", ""]
    lines += _summary(rows) + ["## Cases", ""]
    lines += [f"* **{name}**: {CASES[name].criterion}{_limits(name)}." for name in cases]
    body = ([case, *(_verdict_cell(cells.get((case, method))) for method in methods)] for case in cases)
    lines += ["", "## Cells", "", *table(["case", *methods], body), "", "## What was said", ""]
    lines += [f"* {row['case']}; {row['method']}: {row['words']}" for row in rows if row["words"]]
    return "\n".join(lines) + "\n"


def _summary(rows) -> list[str]:
    """Counts of verdicts; backends side by side with the same form, integrator and stabilisation."""
    plain = Method()
    usual = plain.form, plain.integrator, plain.stabilisation
    kinds: dict[str, list] = {"auto with its defaults": [row for row in rows if row["method"] == DEFAULT.name]}
    for row in rows:
        m = METHODS[row["method"]]
        if m.backend != AUTO and (m.form, m.integrator, m.stabilisation) == usual:
            name = f"{'methods of gauss' if m.ours else 'QP solvers'}, {'certified' if m.certified else 'believed'}"
            kinds.setdefault(name, []).append(row)
    lines = []
    for name, group in kinds.items():
        counts = Counter(row["verdict"] for row in group)
        said = ", ".join(f"{counts[verdict]} {verdict}" for verdict in VERDICTS if counts[verdict])
        lines.append(f"* {name}: {said} of {len(group)} cells.")
    return [*lines, ""]


def _limits(name: str) -> str:
    case = CASES[name]
    return f"; passes to {case.passes:g}, fails from {case.fails:g}" if case.solvable else "; a method passes by saying so"


def _verdict_cell(row) -> str:
    if row is None:
        return ""
    figure = "" if np.isnan(row["figure"]) or np.isinf(row["figure"]) else f" {row['figure']:.0e}"
    return MARKS[row["verdict"]] + figure


def _map(path: Path, rows, header) -> Path:
    from gauss.view.backends import plot_atlas  # the library of figures is optional and takes long to import

    cases, methods = (list(dict.fromkeys(row[key] for row in rows)) for key in ("case", "method"))
    cells = {(row["case"], row["method"]): row for row in rows}
    verdicts = [[cells[c, m]["verdict"] if (c, m) in cells else "" for c in cases] for m in methods]
    figures = np.array([[cells[c, m]["figure"] if (c, m) in cells else np.nan for c in cases] for m in methods])
    plot_atlas(methods, cases, verdicts, figures, VERDICTS, path, when_and_where(header))
    return path
