"""Maros and Mészáros's problems as a control: does this comparison rank QP solvers as qpbenchmark has published it.

Run it with a copy of https://github.com/qpsolvers/maros_meszaros_qpbenchmark (Apache licence):

    python -m benchmarks.maros_meszaros FOLDER [--most 999] [--level high] [--work bench/maros]

It asks the solvers that are installed here and stand in ``results/qpbenchmark_results.csv`` of the copy for the problems of
``data/*.mat`` with at most so many variables, as ``gauss bench qp --problems FOLDER/data`` does: with qpbenchmark's settings
of "high_accuracy", "mid_accuracy" and "low_accuracy", one thread, within 1 s. An answer counts if it is claimed, and primal
and dual residual and duality gap are within the tolerance, for the published rows as for ours, which gives the published
ones the same 1 s. Means of times are shifted geometric means, a failure costs the limit. What is published comes from
another machine, and from other versions of the solvers. So qpsolvers asks the solvers of today once more, with the same
settings, for the problems in the published form: bounds as bounds, infinite ones among them, where this comparison makes
rows of the finite ones. If the verdict is then the published one, the form is the reason why ours differs, else the version
or the machine. CVXOPT gets tolerances of its duality gap here, which the published settings leave at their defaults; qpOASES
is called through CasADi, so that the published form cannot be asked of it.

Writes benchmarks/results/maros_meszaros.md and .csv; measurements in the work folder are not made again.
"""

import argparse
import csv
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import qpsolvers
from scipy import io, sparse
from scipy.stats import kendalltau
from tqdm import tqdm

from benchmarks.command import RESULTS
from gauss.backends.qpsolvers_ import surroundings
from gauss.bench.contestants import contestants
from gauss.bench.folders import of_folder
from gauss.bench.levels import LEVELS, LIMIT, settings
from gauss.bench.markdown import head, table
from gauss.bench.qp import CELL_TIME, compare
from gauss.bench.summary import is_kept, mean_time
from gauss.bench.table import header_of, read_table, write_table
from gauss.bench.worker import Worker

SOURCE = "https://github.com/qpsolvers/maros_meszaros_qpbenchmark"
SETTINGS = {level: f"{level}_accuracy" for level in ("high", "mid", "low")}  # what the levels are called there
RESIDUALS = {"primal": "primal_residual", "dual": "dual_residual", "gap": "duality_gap"}
CLOSE = 0.05  # of shares: three problems of seventy
FIGURES = ("claimed", "kept", "seconds", *RESIDUALS)


def main():
    """Measure what is not measured yet, and write."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.maros_meszaros", description=__doc__.split("\n")[0])
    parser.add_argument("folder", type=Path, help="copy of the published test set")
    parser.add_argument("--most", type=int, default=999, help="variables of the largest problem")
    parser.add_argument("--level", action="append", choices=list(SETTINGS), help="may be repeated; high if not given")
    parser.add_argument("--work", type=Path, default=Path("bench/maros"), help="folder of the measurements")
    given = parser.parse_args()
    theirs = published(given.folder / "results" / "qpbenchmark_results.csv")
    solvers = sorted(set(contestants()) & {solver for solver, *_ in theirs})
    small = [one for one in of_folder(given.folder / "data") if one.matrices.q.size <= given.most]
    for level in given.level or ["high"]:
        measured = compare(given.work, backends=solvers, levels=[level], instances=small)
    rows = explained(pairs(read_table(measured.path), theirs), given.folder / "data")
    write(rows, header_of(measured.path), len(small), given.most)


def published(path: Path) -> dict[tuple[str, str, str], dict]:
    """Rows of the published table by solver, level and problem, in the form of ours."""
    levels = {setting: level for level, setting in SETTINGS.items()}
    found = {}
    with open(path, newline="", encoding="utf-8") as file:
        for row in csv.DictReader(file):
            if (level := levels.get(row["settings"])) is not None:
                figures = {name: float(row[column]) for name, column in RESIDUALS.items()}
                late = float(row["runtime"]) > LIMIT
                claimed = row["found"] == "True" and not late
                found[row["solver"], level, row["problem"]] = figures | {
                    "level": level,
                    "outcome": "timed out" if late else "answered",
                    "error": np.nan,
                    "claimed": claimed,
                    "seconds": float(row["runtime"]),
                }
    return found


def pairs(ours: Iterable[dict], theirs: dict) -> list[tuple[dict, dict]]:
    """Rows of ours beside those that are published, where both are; what is not claimed is not kept."""
    found = []
    for row in ours:
        other = theirs.get((row["backend"], row["level"], row["problem"]))
        if other is not None:
            found.append((_judged(row), _judged(other)))
    return found


def explained(rows: list[tuple[dict, dict]], data: Path) -> list[tuple[dict, dict]]:
    """The same rows; where qpsolvers has the solver, ours tells the verdict on the published form."""
    with Worker() as worker:
        for ours, _ in tqdm(rows, unit="problem", desc="published form"):
            if ours["backend"] in qpsolvers.available_solvers:
                where = data / f"{ours['problem']}.mat", ours["backend"], ours["level"]
                reply = worker.call(solved_as_published, *where, timeout=CELL_TIME)
                ours["as_published"] = reply.outcome == "answered" and _judged(ours | reply.value)["kept"]
    return rows


def solved_as_published(path: Path, solver: str, level: str) -> dict:
    """What a solver finds for a problem whose last n rows are bounds, with its claim, its residuals, and its time [s]."""
    problem = _published_form(path, sparse.csc_matrix if solver in qpsolvers.sparse_solvers else _dense)
    with surroundings(solver):
        begin = time.perf_counter()
        found = qpsolvers.solve_problem(problem, solver, **settings(solver, level))
        seconds = time.perf_counter() - begin
    late = seconds > LIMIT or found.x is None
    residuals = (np.nan,) * 3 if late else (found.primal_residual(), found.dual_residual(), found.duality_gap())
    outcome = {"outcome": "timed out" if late else "answered", "claimed": bool(found.found) and not late, "seconds": seconds}
    return outcome | dict(zip(RESIDUALS, map(float, residuals), strict=True))


def _published_form(path: Path, take: Callable) -> qpsolvers.Problem:
    """Problem of a file whose last n rows are bounds; ``take`` makes its matrices."""
    data = io.loadmat(path)
    rows, (q, lower, upper) = sparse.csc_matrix(data["A"], dtype=float), (np.ravel(data[s]).astype(float) for s in "qlu")
    lower, upper = (np.where(abs(v) > 9e19, np.copysign(np.inf, v), v) for v in (lower, upper))
    m = lower.size - q.size
    held, sides = lower[:m] == upper[:m], ((1.0, upper[:m]), (-1.0, -lower[:m]))
    free = [(sign, bound, ~held & (bound < np.inf)) for sign, bound in sides]
    G = sparse.vstack([sign * rows[:m][here] for sign, _, here in free], format="csc")
    h = np.concatenate([bound[here] for _, bound, here in free])
    A, b = rows[:m][held], upper[:m][held]
    inequalities = (take(G), h) if h.size else (None, None)
    equalities = (take(A), b) if b.size else (None, None)
    return qpsolvers.Problem(take(data["P"].astype(float)), q, *inequalities, *equalities, lower[m:], upper[m:])


def _dense(matrix) -> np.ndarray:
    return matrix.toarray()


def _judged(row: dict) -> dict:
    outcome = row["outcome"] if row["claimed"] else "refused"
    row = row | {"outcome": outcome}
    return row | {"kept": is_kept(row)}


def write(rows: list[tuple[dict, dict]], conditions: list[str], count: int, most: int):
    """Table and report."""
    lines = [*conditions, f"published: {SOURCE}, results/qpbenchmark_results.csv"]
    write_table(RESULTS / "maros_meszaros.csv", lines, [_figures(*row) for row in rows])
    text = [
        *head(
            "Maros and Mészáros's problems: a control",
            [*conditions, f"published: {SOURCE}, qpbenchmark 2.3.0, 2024-09-07"],
        ),
        __doc__.split("\n\n")[3].replace("\n", " "),
        f"{count} problems have at most {most} variables. Before a stroke is what was measured here, after it",
        "what is published.",
        "",
    ]
    for level in SETTINGS:
        chosen = [(ours, theirs) for ours, theirs in rows if ours["level"] == level]
        text += _level(level, chosen) if chosen else []
    (RESULTS / "maros_meszaros.md").write_text("\n".join(text) + "\n", encoding="utf-8")


def _figures(ours: dict, theirs: dict) -> dict:
    """Row of the table."""
    named = {"problem": ours["problem"], "solver": ours["backend"], "level": ours["level"]}
    figures = {f"{side}{name}": one[name] for side, one in (("", ours), ("published_", theirs)) for name in FIGURES}
    short = {name: f"{x:.4g}" if isinstance(x, float) else x for name, x in figures.items()}
    return named | short | {"kept_as_published": ours.get("as_published", "")}


class SolverRecord(NamedTuple):
    """One solver at one level: its pairs of rows, ours and the published one."""

    solver: str
    pairs: list[tuple[dict, dict]]

    @property
    def shares(self) -> tuple[float, float]:
        """Shares of problems solved, here and as published."""
        return float(np.mean([ours["kept"] for ours, _ in self.pairs])), float(np.mean([b["kept"] for _, b in self.pairs]))

    @property
    def means(self) -> tuple[float, float]:
        """Mean times [s], here and as published."""
        return mean_time([ours for ours, _ in self.pairs]), mean_time([theirs for _, theirs in self.pairs])

    @property
    def same(self) -> int:
        """Number of equal verdicts."""
        return sum(ours["kept"] == theirs["kept"] for ours, theirs in self.pairs)

    @property
    def has_published(self) -> bool:
        """Whether the verdicts on the published form are known."""
        return "as_published" in self.pairs[0][0]

    @property
    def shares_as_published(self) -> tuple[float, float]:
        """Shares of problems solved in the published form, here and as published."""
        return float(np.mean([ours["as_published"] for ours, _ in self.pairs])), self.shares[1]

    def cells(self) -> list:
        """Line of the table."""
        shares, means = self.shares, self.means
        only = [sum(pair[a]["kept"] and not pair[1 - a]["kept"] for pair in self.pairs) for a in (0, 1)]
        solved = f"{shares[0]:.0%} / {_again(self.pairs)} / {shares[1]:.0%}"
        times = f"{1e3 * means[0]:.3g} / {1e3 * means[1]:.3g}"
        return [self.solver, len(self.pairs), solved, times, self.same, *only, *_reasons(self.pairs)]


TITLES = ("solver", "problems", "solved here / here in the published form / published")
TITLES += ("mean time here / published [ms]", "same verdict", "only here", "only published")
TITLES += ("differ by form", "by version or machine")


def _level(level: str, rows) -> list[str]:
    """Section of one level: shares and ranks by solver, how well they agree, and where they do not."""
    solvers = dict.fromkeys(ours["backend"] for ours, _ in rows)
    records = [SolverRecord(name, [pair for pair in rows if pair[0]["backend"] == name]) for name in solvers]
    records.sort(key=lambda record: -record.shares[0])
    share = kendalltau(*zip(*(record.shares for record in records), strict=True)).statistic
    speed = kendalltau(*zip(*(record.means for record in records), strict=True)).statistic
    return [
        f"## {SETTINGS[level]}: tolerance {LEVELS[level]:g}",
        "",
        f"{sum(record.same for record in records)} of {len(rows)} verdicts are the same. Kendall's τ of the rankings by "
        f"share of problems solved: {share:.2f}; by mean time: {speed:.2f}. {_control(records)}",
        "",
        *table(TITLES, (record.cells() for record in records)),
        "",
        "Where verdicts differ, with the largest residual of each over the tolerance:",
        "",
        *(_differing(record) for record in records if record.same < len(record.pairs)),
        "",
    ]


def _differing(record: SolverRecord) -> str:
    other = [(ours, theirs) for ours, theirs in record.pairs if ours["kept"] != theirs["kept"]]
    named = "; ".join(f"{ours['problem']} {_over(ours)} / {_over(theirs)}" for ours, theirs in other)
    return f"* {record.solver}: {named}."


def _control(records: list[SolverRecord]) -> str:
    """How well verdicts and ranking agree with what is published, once the problems have the published form."""
    published = [record for record in records if record.has_published]
    cells = [pair for record in published for pair in record.pairs]
    same = sum(a["as_published"] == b["kept"] for a, b in cells)
    shares = {record.solver: record.shares_as_published for record in published}
    rank = kendalltau(*np.transpose(list(shares.values()))).statistic
    close = [solver for solver, (again, once) in shares.items() if abs(again - once) <= CLOSE]
    far = [solver for solver in shares if solver not in close]
    return (
        f"In the published form {same} of {len(cells)} verdicts are the same, τ by share is {rank:.2f}; shares are within "
        f"{CLOSE:.0%} of the published ones for {', '.join(close)}, and not for {', '.join(far) or 'none'}."
    )


def _again(cells) -> str:
    agreed = [a["as_published"] for a, _ in cells if "as_published" in a]
    return f"{np.mean(agreed):.0%}" if agreed else "–"


def _reasons(cells) -> list[str]:
    """How many verdicts differ by the form of the problem, and how many do not; – where that cannot be told."""
    if not any("as_published" in a for a, _ in cells):
        return ["–", "–"]
    agreed = [a["as_published"] == b["kept"] for a, b in cells if a["kept"] != b["kept"]]
    return [str(sum(agreed)), str(len(agreed) - sum(agreed))]


def _over(row: dict) -> str:
    """How often the largest residual is the tolerance, or that there is no answer."""
    worst = max(row[name] for name in RESIDUALS)
    if row["outcome"] == "answered" and np.isfinite(worst):
        return f"{worst / LEVELS[row['level']]:.1g}"
    return row["outcome"] if row["outcome"] != "refused" else "none"


if __name__ == "__main__":
    main()
