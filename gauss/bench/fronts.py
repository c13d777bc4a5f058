"""Error against time: which solvers no other beats in both, on one problem and over a class."""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from gauss.bench.instances import MAIN_FORM
from gauss.bench.levels import OURS, OWN
from gauss.bench.measure import middle
from gauss.bench.problems import SOLVABLE
from gauss.bench.summary import complete, is_without_multipliers, mean_time
from gauss.bench.verdicts import truth


class FrontPoint(NamedTuple):
    """Point of a solver: time over that of the fastest, and error."""

    ratio: float
    error: float


def cells(rows) -> dict[str, list[dict]]:
    """Cells of each solver that was asked all problems; named with its level if there are several."""
    problems = list(dict.fromkeys(row["problem"] for row in rows))
    found = complete(rows, problems, MAIN_FORM)
    several = len({level for _, level in found} - {OWN}) > 1
    return {f"{name} {level}" if several and level != OWN else name: mine for (name, level), mine in found.items()}


def of_special_form(rows, general: Iterable[str]) -> list[dict]:
    """Rows of the problems that solvers of a special form were asked, with those of all others."""
    problems = {row["problem"] for row in rows if row["backend"] not in (*OURS, *general)}
    return [row for row in rows if row["problem"] in problems]


def special_cells(special: list[dict], general: Iterable[str]) -> dict[str, list[dict]]:
    """Cells of the solvers of a special form, of the rows of the problems that they were asked."""
    general = set(general)
    return {name: found for name, found in cells(special).items() if name not in general}


def is_answered(row) -> bool:
    """Whether there is an answer, within the limit of time."""
    return row["outcome"] == "answered"


def error_of(row) -> float:
    """Error of an answer; nan where there is none, or one without its multipliers."""
    return row["error"] if is_answered(row) and not is_without_multipliers(row) else np.nan


def fronts(rows) -> tuple[list[str], dict[str, FrontPoint], dict[str, dict[str, FrontPoint]]]:
    """Names of the solvers, their points over all problems with a solution, and problem by problem.

    Times are relative to the least, of the means over all problems and of the answers to one. Errors over all problems are
    medians, where no answer is worse than any; who has none to half of the problems has no point. Solvers of a special form
    stand on the problems that they take.
    """
    rows = [row for row in rows if truth(row) == SOLVABLE]
    mine = cells(rows)
    means = {name: mean_time(found) for name, found in mine.items()}
    errors = {name: middle([error_of(row) for row in found]) for name, found in mine.items()}
    overall = _points({name: (means[name], errors[name]) for name in mine})
    everyone = mine if _several_levels(rows) else mine | special_cells(of_special_form(rows, mine), mine)
    return list(everyone), overall, _panels(everyone)


def _several_levels(rows) -> bool:
    return len({row["level"] for row in rows} - {OWN}) > 1


def _panels(found: dict[str, list[dict]]) -> dict[str, dict[str, FrontPoint]]:
    """Points of each problem, by the names of the solvers that answered it."""
    panels: dict[str, dict[str, tuple[float, float]]] = {}
    for name, rows in found.items():
        for row in rows:
            panels.setdefault(row["problem"], {})[name] = row["seconds"], error_of(row)
    return {problem: _points(points) for problem, points in panels.items()}


def _points(found: dict[str, tuple[float, float]]) -> dict[str, FrontPoint]:
    there = {name: values for name, values in found.items() if np.isfinite(values).all()}
    least = min((seconds for seconds, _ in there.values()), default=np.nan)
    return {name: FrontPoint(seconds / least, error) for name, (seconds, error) in there.items()}


def beats(one: FrontPoint, other: FrontPoint) -> bool:
    """Whether a point is no worse than another in time and error, and better in one of them."""
    return one.ratio <= other.ratio and one.error <= other.error and one != other


def front(points: dict[str, FrontPoint]) -> list[str]:
    """Names of the points that no other beats, the fastest first."""
    found = [name for name, point in points.items() if not any(beats(other, point) for other in points.values())]
    return sorted(found, key=lambda name: points[name])
