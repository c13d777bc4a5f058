"""What the rows of the comparison say together: means, shares, and who is fastest at equal accuracy."""

from collections.abc import Iterable

import numpy as np

from gauss.bench import compiled
from gauss.bench.levels import LEVELS, LIMIT, OWN
from gauss.bench.measure import AUTO, OURS, WRONG

SHIFT = 1e-3  # [s] of the shifted geometric mean, about the time of one solve
EQUAL = 10.0  # an answer is as accurate as another if its error is no more than so many times as large ...
ROUNDING = 1e-12  # ... or below this


def shifted_mean(seconds: Iterable[float]) -> float:
    """Shifted geometric mean of times [s], exp(mean ln(t + s)) − s."""
    times = np.fromiter(seconds, dtype=float)
    return float(np.exp(np.log(times + SHIFT).mean()) - SHIFT) if times.size else np.nan


def backends(rows) -> list[str]:
    """Backends in the order of the table: QP solvers, then methods of gauss."""
    found = dict.fromkeys(row["backend"] for row in rows)
    foreign = [name for name in found if name not in OURS and name != compiled.NAME]
    return [*foreign, *(name for name in found if name not in foreign)]


def totals(rows, form: str) -> list[dict]:
    """One line for each backend and level in a form: success, correctness, claims, mean time.

    Success is that of qpbenchmark: residuals and gap within the tolerance of the level. An answer is right if its error is
    below the tolerance of certificates. A problem that is not solved right costs the time limit.
    """
    lines = []
    for backend in backends(rows):
        mine = [r for r in rows if r["backend"] == backend and r["form"] in (form, OWN)]
        for level in dict.fromkeys(r["level"] for r in mine):
            cells = [r for r in mine if r["level"] == level and not _out_of_scope(r)]
            right = [r for r in cells if _certified(r)]
            goal = LEVELS.get(level, np.nan)
            lines.append(
                {
                    "backend": backend,
                    "level": level,
                    "cells": len(cells),
                    "success": _share(cells, lambda r, goal=goal: max(r["primal"], r["dual"], r["gap"]) <= goal),
                    "right": len(right) / len(cells),
                    "median_error": float(np.median([r["error"] for r in right])) if right else np.nan,
                    "claims_wrong": sum(r["claimed"] and not r["error"] <= WRONG for r in cells),
                    "doubts_right": sum(not r["claimed"] and _certified(r) for r in cells),
                    "refused": sum(r["outcome"] == "refused" for r in cells),
                    "lost": sum(r["outcome"] in ("crashed", "timed out") for r in cells),
                    "mean": shifted_mean(r["seconds"] if _certified(r) else LIMIT for r in cells),
                }
            )
    return lines


def against_compiled(rows) -> list[dict]:
    """Per problem: the compiled dynamics of gauss beside the fastest QP solver whose answer is as accurate."""
    lines = []
    for row in rows:
        if row["backend"] != compiled.NAME:
            continue
        line = {"problem": row["problem"], "seconds": row["seconds"], "error": row["error"], "peer": "", "theirs": np.nan}
        goal = max(EQUAL * row["error"], ROUNDING) if np.isfinite(row["error"]) else np.nan
        peers = [
            r
            for r in rows
            if r["problem"] == row["problem"] and r["level"] in LEVELS and r["error"] <= goal and np.isfinite(r["seconds"])
        ]
        if peers:
            best = min(peers, key=lambda r: r["seconds"])
            line |= {"peer": f"{best['backend']} ({best['form']}, {best['level']})", "theirs": best["seconds"]}
            line["their_error"] = best["error"]
        lines.append(line)
    return lines


def profile(rows, form: str, level: str, accuracy: float, ratios: np.ndarray) -> dict[str, np.ndarray]:
    """Performance profiles (Dolan and Moré 2002): share of problems solved to an accuracy within ratios of the best time."""
    cells = [r for r in rows if (r["form"], r["level"]) in ((form, level), (OWN, OWN)) and r["backend"] != compiled.NAME]
    problems = list(dict.fromkeys(r["problem"] for r in cells))
    times = {(r["backend"], r["problem"]): r["seconds"] for r in cells if r["error"] <= accuracy}
    best = {p: min((t for (_, q), t in times.items() if q == p), default=np.nan) for p in problems}
    found = {}
    for backend in backends(cells):
        own = np.array([times.get((backend, p), np.inf) / best[p] for p in problems])
        found[backend] = np.array([(own <= ratio).mean() for ratio in ratios])
    return found


def _out_of_scope(row) -> bool:
    """Methods for equality rows are not judged by problems with inequality rows."""
    return row["inequalities"] and row["backend"] in OURS and row["backend"] != AUTO


def _certified(row) -> bool:
    """Right to the tolerance of certificates; the compiled dynamics carry none of their own."""
    return row["certified"] or (row["backend"] == compiled.NAME and row["error"] <= 1e-6)


def _share(cells, condition) -> float:
    judged = [row for row in cells if np.isfinite(row["primal"]) or row["level"] in LEVELS]
    return sum(bool(condition(row)) for row in judged) / len(judged) if judged else np.nan
