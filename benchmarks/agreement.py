"""How well two judges agree on who solves what: equal verdicts, and Kendall's τ of the rankings by share solved.

M. Kendall, *A new measure of rank correlation*, Biometrika 30, 1938; ties as in τ-b.
"""

from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np
from scipy.stats import kendalltau


class Agreement(NamedTuple):
    """Agreement of verdicts."""

    # same, count: equal verdicts, and all
    same: int
    count: int  # type: ignore[assignment]  # the method of tuples of that name is not called
    tau: float  # Kendall's τ of the solvers by share of problems solved; nan of a single solver
    shares: Mapping[str, tuple[float, float]]  # shares solved by both judges, by solver


def agreement(verdicts: Iterable[tuple[str, bool, bool]]) -> Agreement:
    """Agreement of verdicts (solver, solved by one judge, solved by the other)."""
    by_solver: dict[str, list[tuple[bool, bool]]] = {}
    for solver, one, other in verdicts:
        by_solver.setdefault(solver, []).append((one, other))
    shares = {solver: _shares(pairs) for solver, pairs in by_solver.items()}
    every = [pair for pairs in by_solver.values() for pair in pairs]
    tau = float(kendalltau(*zip(*shares.values(), strict=True)).statistic) if len(shares) > 1 else float("nan")
    return Agreement(sum(one == other for one, other in every), len(every), tau, shares)


def _shares(pairs: list[tuple[bool, bool]]) -> tuple[float, float]:
    """Shares of problems solved by both judges."""
    one, other = np.mean(pairs, axis=0)
    return float(one), float(other)
