"""Limits between the points of a mesh: by how much the states, gaps and forces of a found motion are beyond them.

Collocation asks for limits at its points only. Here they are looked at in all parts into which the check of the mesh error
divides the intervals, along the motion by steps of gauss.
"""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gauss.analysis.optimal.conditions import entries
from gauss.analysis.optimal.problem import MotionProblem
from gauss.errors import LimitWarning, user_level


@dataclass(frozen=True)
class LimitExcess:
    """What a motion is beyond its limits by."""

    of_intervals: np.ndarray  # (n,) the largest of each interval, in shares of the units; 0 within the limits
    where: str  # what is beyond its limit most, by how much, and when; empty within the limits

    @property
    def largest(self) -> float:
        """The largest, in shares of the units."""
        return float(self.of_intervals.max(initial=0.0))


def limit_excess(problem: MotionProblem, t: np.ndarray, moved: np.ndarray, u: np.ndarray) -> LimitExcess:
    """Excess of one phase.

    Parameters
    ----------
    t : ndarray, shape (n + 1,)
        Mesh points [s].
    moved : ndarray, shape (n, m + 1, n_q + n_v)
        States at the start and after each of m equal parts of the intervals.
    u : ndarray, shape (n, 2, n_u)
        Inputs at the ends of the intervals.
    """
    share = np.linspace(0.0, 1.0, moved.shape[1])[:, None]
    times = t[:-1, None] + share[:, 0] * np.diff(t)[:, None]
    inputs = (1.0 - share) * u[:, None, 0] + share * u[:, None, 1]
    names, units, rows = zip(*_rows(problem, times.ravel(), _columns(moved), _columns(inputs)), strict=True)
    beyond = np.maximum(np.array(rows).reshape(len(rows), *times.shape), 0.0)
    row, k, part = np.unravel_index(int(beyond.argmax()), beyond.shape)
    size = beyond[row, k, part] * units[row]
    where = f"{names[row]} by {size:.3g} at t = {times[k, part]:.6g} s" if size > 0.0 else ""
    return LimitExcess(beyond.max(axis=(0, 2)), where)


def warn_of_excess(found: Sequence[LimitExcess], accepted: float):
    """Warn of phases that are beyond their limits by more than is accepted, in shares of the units.

    Warns
    -----
    LimitWarning
        Names what exceeds its limit most.
    """
    worst = max(found, key=lambda one: one.largest)
    if worst.largest > accepted:
        warnings.warn(
            f"optimal motion: between the points of the mesh beyond its limit: {worst.where}. Give more intervals=, more "
            "refinements=, or narrower limits.",
            LimitWarning,
            stacklevel=user_level(),
        )


def _columns(values: np.ndarray) -> np.ndarray:
    """Values (n, m + 1, k) of all parts, (k, n (m + 1))."""
    return values.reshape(-1, values.shape[-1]).T


def _rows(problem: MotionProblem, t: np.ndarray, x: np.ndarray, u: np.ndarray):
    """Name, unit, and what is positive beyond a limit, in shares of the unit, of each limit."""
    equations, (lowest, highest, *_) = problem.equations, problem.bounds
    names = {place: name for name, place in entries(problem.system).items()}
    for place, unit in enumerate(equations.units):
        beyond = np.maximum(lowest[place] - x[place], x[place] - highest[place]) / unit
        yield repr(names.get(place, "")), unit, beyond
    given = t[None], x / equations.units[:, None], u / equations.input_units[:, None]
    for function, labels in ((problem.gaps, problem.gap_labels), (problem.forces, problem.force_labels)):
        if function is not None:
            values = np.array(function.map(t.size)(*given))
            yield from ((name, unit, -row) for (name, unit), row in zip(labels, values, strict=True))
