"""Maros and Mészáros's problems as a control: does this comparison rank QP solvers as qpbenchmark has published it.

Run it with a copy of https://github.com/qpsolvers/maros_meszaros_qpbenchmark (Apache licence):

    python -m benchmarks.maros_meszaros FOLDER [--most 999] [--level high] [--work bench/maros] [--then verdicts.csv]

It asks the solvers that are installed here and stand in ``results/qpbenchmark_results.csv`` of the copy for the
problems of ``data/*.mat`` with at most so many variables, as ``gauss bench qp --problems FOLDER/data`` does: with
qpbenchmark's settings of "high_accuracy", "mid_accuracy" and "low_accuracy", one thread, within 1 s. An answer counts
if it is claimed, and primal and dual residual and duality gap are within the tolerance, for the published rows as for
ours, which gives the published ones the same 1 s. Means of times are shifted geometric means, a failure costs the
limit. What is published comes from another machine, and from versions of the solvers of 2024. So qpsolvers asks the
solvers once more, with the same settings and 1 s of CPU time, for the problems in the published form: bounds as
bounds, infinite ones among them, where this comparison makes rows of the finite ones. If the verdict is then the
published one, the form is the reason why ours differs, else the version or the machine. Where ``--then`` gives
verdicts of the published versions, from an environment of their own (``benchmarks/published_form.py``), these stand
beside today's in the published form. CVXOPT gets tolerances of its duality gap here, which the published settings
leave at their defaults; qpOASES is called through CasADi, so that the published form cannot be asked of it.

Writes benchmarks/results/maros_meszaros.md and .csv; measurements in the work folder are not made again.
"""

import argparse
import csv
import hashlib
import json
import os
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.stats import kendalltau

from benchmarks import published_form, published_form_report
from benchmarks.agreement import agreement
from benchmarks.command import RESULTS
from gauss.bench.contestants import contestants
from gauss.bench.folders import of_folder
from gauss.bench.levels import LEVELS, LIMIT, as_qpbenchmark_sets
from gauss.bench.machine import header
from gauss.bench.markdown import head, share, table
from gauss.bench.qp import PACKAGES, compare
from gauss.bench.summary import asked, is_kept, mean_time
from gauss.bench.table import header_of, read_table, write_table
from gauss.bench.worker import ONE_THREAD

SOURCE = "https://github.com/qpsolvers/maros_meszaros_qpbenchmark"
SETTINGS = {level: f"{level}_accuracy" for level in ("high", "mid", "low")}  # what the levels are called there
RESIDUALS = {"primal": "primal_residual", "dual": "dual_residual", "gap": "duality_gap"}
CLOSE = 0.05  # of shares: three problems of seventy
FIGURES = ("claimed", "kept", "seconds", *RESIDUALS)
FORM = RESULTS / "maros_meszaros_form.csv"  # verdicts in the published form, of today's and of the published versions


def main():
    """Measure what is not measured yet, and write."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.maros_meszaros", description=__doc__.split("\n")[0])
    parser.add_argument("folder", type=Path, help="copy of the published test set")
    parser.add_argument("--most", type=int, default=999, help="variables of the largest problem")
    parser.add_argument("--level", action="append", choices=list(SETTINGS), help="may be repeated; high if not given")
    parser.add_argument("--work", type=Path, default=Path("bench/maros"), help="folder of the measurements")
    parser.add_argument("--then", type=Path, help="verdicts of benchmarks/published_form.py with the published versions")
    parser.add_argument("--report", action="store_true", help="write the page from the table that there is")
    given = parser.parse_args()
    if given.report:
        path = RESULTS / "maros_meszaros.csv"
        write_page(read_pairs(path), header_of(path), given.most)
        return
    theirs = published(given.folder / "results" / "qpbenchmark_results.csv")
    solvers = sorted(set(contestants()) & {solver for solver, *_ in theirs})
    small = [
        one for one in of_folder(given.folder / "data") if one.matrices is not None and one.matrices.q.size <= given.most
    ]
    levels = given.level or ["high"]
    for level in levels:
        measured = compare(given.work, backends=solvers, levels=[level], instances=small)
    rows = pairs(asked(read_table(measured.path)), theirs)
    now = verdicts(in_published_form(given.folder / "data", given.work, solvers, [one.name for one in small]))
    as_published = {(row["backend"], row["level"], row["problem"]): row["kept"] for row in now}
    for ours, _ in rows:
        ours["as_published"] = as_published.get((ours["backend"], ours["level"], ours["problem"]), "")
    conditions = [*header_of(measured.path), f"published: {SOURCE}, results/qpbenchmark_results.csv"]
    write_table(RESULTS / "maros_meszaros.csv", conditions, [figures(*row) for row in rows])
    if given.then:
        compared = published_form_report.rows(now, verdicts(given.then), {key: _judged(row) for key, row in theirs.items()})
        write_table(FORM, conditions, compared)
    write_page(rows, conditions, given.most)


def in_published_form(data: Path, work: Path, solvers: list[str], problems: list[str]) -> Path:
    """Ask the solvers of today for the published form, unless the work folder has their verdicts; return these.

    Verdicts are kept under a digest of the problems, settings and versions that they are of, and when they are complete.
    """
    by_solver = {s: {level: as_qpbenchmark_sets(s, level) for level in SETTINGS} for s in solvers}
    text = json.dumps({"problems": problems, "settings": by_solver}, indent=1)
    digest = hashlib.sha256("\n".join([text, *header(*PACKAGES)[2:3]]).encode()).hexdigest()[:12]
    verdicts, asked = work / f"published_form_{digest}.csv", work / "settings.json"
    asked.write_text(text, encoding="utf-8")
    if not verdicts.exists():
        begun = verdicts.with_suffix(".begun")
        command = [sys.executable, published_form.__file__, *map(str, (data, asked, begun))]
        subprocess.run(command, check=True, env=os.environ | ONE_THREAD)
        begun.rename(verdicts)
    return verdicts


def verdicts(path: Path) -> list[dict]:
    """Rows of a table of verdicts, judged."""
    return [_judged(row | {"outcome": "answered", "error": np.nan, "backend": row["solver"]}) for row in read_table(path)]


def read_pairs(path: Path) -> list[tuple[dict, dict]]:
    """Rows of the table that was written, ours beside the published ones."""
    rows = []
    for row in read_table(path):
        named = {"problem": row["problem"], "backend": row["solver"], "level": row["level"], "error": np.nan}
        ours, theirs = (
            _judged(named | {"outcome": "answered"} | {name: row[side + name] for name in FIGURES})
            for side in ("", "published_")
        )
        rows.append((ours | {"as_published": row["kept_as_published"]}, theirs))
    return rows


def published(path: Path) -> dict[tuple[str, str, str], dict]:
    """Rows of the published table by solver, level and problem, in the form of ours."""
    levels = {setting: level for level, setting in SETTINGS.items()}
    found = {}
    with open(path, newline="", encoding="utf-8") as file:
        for row in csv.DictReader(file):
            if (level := levels.get(row["settings"])) is not None:
                figures = {name: float(row[column] or "nan") for name, column in RESIDUALS.items()}
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


def _judged(row: dict) -> dict:
    outcome = row["outcome"] if row["claimed"] else "refused"
    row = row | {"outcome": outcome}
    return row | {"kept": is_kept(row)}


def write_page(rows: list[tuple[dict, dict]], conditions: list[str], most: int):
    """Write the page."""
    count = len({ours["problem"] for ours, _ in rows})
    text = [
        *head("Maros and Mészáros's problems: a control", conditions),
        __doc__.split("\n\n")[3].replace("\n", " "),
        "",
        f"{count} problems have at most {most} variables. Before a stroke is what was measured here, after it",
        "what is published.",
        "",
    ]
    for level in SETTINGS:
        chosen = [(ours, theirs) for ours, theirs in rows if ours["level"] == level]
        text += _level(level, chosen) if chosen else []
    text += published_form_report.lines(FORM, SETTINGS) if FORM.exists() else []
    (RESULTS / "maros_meszaros.md").write_text("\n".join(text) + "\n", encoding="utf-8")


def figures(ours: dict, theirs: dict) -> dict:
    """Row of the table."""
    named = {"problem": ours["problem"], "solver": ours["backend"], "level": ours["level"]}
    values = {f"{side}{name}": one[name] for side, one in (("", ours), ("published_", theirs)) for name in FIGURES}
    short = {name: f"{x:.4g}" if isinstance(x, float) else x for name, x in values.items()}
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
    def as_published(self) -> float:
        """Share of problems solved in the published form; nan where that was not asked of all."""
        found = [ours.get("as_published", "") for ours, _ in self.pairs]
        return float(np.mean(found)) if "" not in found else np.nan

    @property
    def differing(self) -> str:
        """Problems whose verdicts differ, with the largest residual of each over the tolerance."""
        other = [(ours, theirs) for ours, theirs in self.pairs if ours["kept"] != theirs["kept"]]
        return "; ".join(f"{ours['problem']} {over(ours)} / {over(theirs)}" for ours, theirs in other)

    def cells(self) -> list:
        """Line of the table."""
        (ours, theirs), means = self.shares, self.means
        shares = (ours, self.as_published, theirs)
        times = f"{1e3 * means[0]:.3g} / {1e3 * means[1]:.3g}"
        only = [sum(pair[a]["kept"] and not pair[1 - a]["kept"] for pair in self.pairs) for a in (0, 1)]
        solved = [share(x) or "–" for x in shares]
        return [self.solver, len(self.pairs), *solved, times, self.same, *only, *_reasons(self.pairs)]


TITLES: tuple[str, ...] = (
    "solver",
    "problems",
    "solved here",
    "here in the published form",
    "published",
    "mean time here / published [ms]",
)
TITLES += ("same verdict", "only here", "only published", "differ by form", "by version or machine")


def _level(level: str, rows) -> list[str]:
    """Section of one level: shares and ranks by solver, how well they agree, and where they do not."""
    solvers = dict.fromkeys(ours["backend"] for ours, _ in rows)
    records = [SolverRecord(name, [pair for pair in rows if pair[0]["backend"] == name]) for name in solvers]
    records.sort(key=lambda record: -record.shares[0])
    found = agreement((ours["backend"], ours["kept"], theirs["kept"]) for ours, theirs in rows)
    speed = kendalltau(*zip(*(record.means for record in records), strict=True)).statistic
    return [
        f"## {SETTINGS[level]}: tolerance {LEVELS[level]:g}",
        "",
        f"{found.same} of {found.count} verdicts are the same. Kendall's τ of the rankings by "
        f"share of problems solved: {found.tau:.2f}; by mean time: {speed:.2f}. "
        f"{_control(records)}",
        "",
        *table(TITLES, (record.cells() for record in records)),
        "",
        "Where verdicts differ, with the largest residual of each over the tolerance:",
        "",
        *(f"* {record.solver}: {record.differing}." for record in records if record.same < len(record.pairs)),
        "",
    ]


def _control(records: list[SolverRecord]) -> str:
    """How well verdicts and ranking agree with what is published, once the problems have the published form."""
    asked = [record for record in records if np.isfinite(record.as_published)]
    if not asked:
        return ""
    pairs = (pair for record in asked for pair in record.pairs)
    found = agreement((ours["backend"], ours["as_published"], theirs["kept"]) for ours, theirs in pairs)
    far = [record.solver for record in asked if abs(record.as_published - record.shares[1]) > CLOSE]
    apart = f"but for {', '.join(far)}" if far else "for all"
    return (
        f"In the published form {found.same} of {found.count} verdicts are the same, τ by share is {found.tau:.2f}; shares "
        f"are within {CLOSE:.0%} of the published ones {apart}."
    )


def _reasons(cells) -> list[str]:
    """How many verdicts differ by the form of the problem, and how many do not; – where that is unknown."""
    if any(ours.get("as_published", "") == "" for ours, _ in cells):
        return ["–", "–"]
    agreed = [ours["as_published"] == theirs["kept"] for ours, theirs in cells if ours["kept"] != theirs["kept"]]
    return [str(sum(agreed)), str(len(agreed) - sum(agreed))]


def over(row: dict) -> str:
    """How often the largest residual is the tolerance, or that there is no answer."""
    worst = max(row[name] for name in RESIDUALS)
    if row["outcome"] == "answered" and np.isfinite(worst):
        return f"{worst / LEVELS[row['level']]:.1g}"
    return row["outcome"] if row["outcome"] != "refused" else "none"


if __name__ == "__main__":
    main()
