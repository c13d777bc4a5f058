"""Summary of the rows of the comparison: shares and means over equal sets of problems, and the fastest solvers.

One rule for all backends, gauss's own among them: an answer is right if its error beside the reference is at most
1e-6, that of its multipliers at most 1e-3, and in time. A solver that was asked for a tolerance is judged by residuals,
too: it has kept the tolerance if primal and dual residual and duality gap are within it, as qpbenchmark judges, whatever
the solver itself looks at; and it claims beyond its promise if a residual that its tolerance is of is above it
(gauss.bench.levels.promise). Certificates are no part of either. Problems that a solver does not take are no failures of it.
"""

import hashlib
from collections.abc import Iterable
from operator import itemgetter

import numpy as np

from gauss.bench import compiled
from gauss.bench.instances import FILE
from gauss.bench.levels import LEVELS, LIMIT, OURS, OWN
from gauss.bench.markdown import count_of
from gauss.bench.measure import NOT_ASKED, WRONG, middle
from gauss.bench.problems import SOLVABLE, UNKNOWN
from gauss.bench.suite.instance import INFEASIBLE
from gauss.bench.verdicts import said, stated, truth

RIGHT = 1e-6  # relative error of a right answer, the tolerance of certificates
SHIFT, PENALTY = 1e-3, 1.0  # [s] of the shifted geometric mean, about the time of one solve; limits that a failure costs
SHIFTS, PENALTIES = (1e-4, 1e-3, 1e-2), (1.0, 10.0)  # among which ranks are compared
COMPARABLE_ERRORS = 10.0  # an answer is as accurate as another if its error is no more than so many times as large ...
NEGLIGIBLE_ERROR = 1e-12  # ... or below this


def shifted_mean(seconds: Iterable[float], shift: float = SHIFT) -> float:
    """Shifted geometric mean of times [s], exp(mean ln(t + s)) − s."""
    times = np.fromiter(seconds, dtype=float)
    return float(np.exp(np.log(times + shift).mean()) - shift) if times.size else np.nan


def backends(rows) -> list[str]:
    """Backends in the order of the table: QP solvers, then methods of gauss."""
    found = dict.fromkeys(row["backend"] for row in rows)
    foreign = [name for name in found if name not in OURS and name != compiled.NAME]
    return [*foreign, *(name for name in found if name not in foreign)]


def groups(rows) -> dict[str, list[str]]:
    """Problems of each class, in the order of the table."""
    found: dict[str, list[str]] = {}
    for row in rows:
        names = found.setdefault(row["group"], [])
        if row["problem"] not in names:
            names.append(row["problem"])
    return found


def is_right(row) -> bool:
    """Whether an answer is within 1e-6 of the reference, with multipliers, and in time; whether kept, if none is known.

    Of a problem that has no solution, whether its verdict is stated.
    """
    if truth(row) not in (SOLVABLE, UNKNOWN):
        return row["outcome"] != "timed out" and stated(row) == truth(row)
    if truth(row) == UNKNOWN or np.isnan(row["error"]):
        return is_kept(row)
    return row["outcome"] == "answered" and bool(row["error"] <= RIGHT) and not is_without_multipliers(row)


def is_without_multipliers(row) -> bool:
    """Whether an answer is right but for its multipliers: forces that are wrong for any purpose."""
    return bool(row["error"] <= RIGHT and dual_error(row) > WRONG)


def is_kept(row) -> bool:
    """Whether residuals and gap are within the tolerance that was asked for."""
    worst = np.max([row["primal"], row["dual"], row["gap"]])  # nan if one is
    return row["outcome"] == "answered" and bool(worst <= LEVELS.get(row["level"], -1.0))


def is_broken(row) -> bool:
    """Whether a solver claims success with residuals above what it promises and above rounding, or with nan."""
    return bool(row["claimed"]) and row["level"] in LEVELS and not row["excess"] <= 1.0


def is_wrong(row) -> bool:
    """Whether success is claimed with an error beyond any purpose, or with numbers that are not finite."""
    return bool(row["claimed"]) and (row["error"] > WRONG or row["outcome"] == "not finite")


def is_lost(row) -> bool:
    """Whether the process of a solver died, or its time was over."""
    return row["outcome"] in ("crashed", "timed out")


def asked(rows) -> list[dict]:
    """Rows of the problems that solvers take."""
    return [row for row in rows if row["outcome"] != NOT_ASKED]


def checksum(rows) -> str:
    """Condition of a page: SHA-256 of those of the numbers of its problems, in the order of the names."""
    data = sorted({(row["problem"], row.get("data", "")) for row in rows})
    whole = hashlib.sha256("".join(f"{one}\n" for _, one in data).encode()).hexdigest()
    return f"data of its {len(data)} problems: checksum {whole[:12]}"


def not_asked(rows) -> list[str]:
    """Lines of Markdown on solvers that take not all of the problems, with reasons; none where all do."""
    count: dict[tuple[str, str], set[str]] = {}
    for row in rows:
        if row["outcome"] == NOT_ASKED:
            count.setdefault((row["reason"], row["backend"]), set()).add(row["problem"])
    solvers: dict[tuple[str, int], list[str]] = {}
    for (reason, solver), problems in count.items():
        solvers.setdefault((reason, len(problems)), []).append(solver)
    found = [f"* {', '.join(names)}, {count_of(many, 'problem')}: {reason}." for (reason, many), names in solvers.items()]
    return ["Not asked:", "", *found, ""] if found else []


def complete(rows, problems: list[str], form: str) -> dict[tuple[str, str], list[dict]]:
    """Cells of each backend and level that was measured on all the problems, so that shares and means compare."""
    found: dict[tuple[str, str], list[dict]] = {}
    for backend in backends(rows):
        mine = [r for r in rows if r["backend"] == backend and r["form"] in (form, FILE, OWN) and r["problem"] in problems]
        for level in dict.fromkeys(r["level"] for r in mine):
            cells = [r for r in mine if r["level"] == level]
            if len(cells) == len(problems) and backend != compiled.NAME:
                found[backend, level] = cells
    return found


def totals(rows, problems: list[str], form: str) -> list[dict]:
    """One line for each backend and level: what it promised and kept, what is right, and what became of the rest."""
    lines = []
    for (backend, level), cells in complete(rows, problems, form).items():
        foreign = level in LEVELS
        lines.append(
            {
                "backend": backend,
                "level": level,
                "kept": sum(map(is_kept, cells)) / len(cells) if foreign else np.nan,
                "broken": sum(map(is_broken, cells)) if foreign else np.nan,
                "right": sum(map(is_right, cells)) / len(cells),
                "error": middle([r["error"] for r in cells]),
                "dual_error": middle([dual_error(r) for r in cells]),
                "wrong": sum(map(is_wrong, cells)),
                "refused": sum(r["outcome"] in ("refused", "not finite") for r in cells),
                "lost": sum(map(is_lost, cells)),
                "mean": mean_time(cells),
            }
        )
    return lines


def dual_error(row) -> float:
    """Relative error of the multipliers that a solver gave; nan in tables of older versions."""
    return row.get("dual_error", np.nan)


def mean_time(cells, shift: float = SHIFT, penalty: float = PENALTY) -> float:
    """Shifted geometric mean of the times of calls [s]; what is not right costs so many time limits."""
    return shifted_mean((r["seconds"] if is_right(r) else penalty * LIMIT for r in cells), shift)


def sensitivity(rows, problems: list[str], form: str, level: str) -> dict[str, list[tuple[float, int]]]:
    """Mean time and rank of each backend by all shifts and penalties."""
    chosen = _at_level(rows, problems, form, level)
    found: dict[str, list[tuple[float, int]]] = {backend: [] for backend in chosen}
    for shift in SHIFTS:
        for penalty in PENALTIES:
            means = {backend: mean_time(cells, shift, penalty) for backend, cells in chosen.items()}
            for backend, mean in means.items():
                found[backend].append((mean, 1 + sum(other < mean for other in means.values())))
    return found


def _at_level(rows, problems: list[str], form: str, level: str) -> dict[str, list[dict]]:
    """Cells of each backend at a level; of gauss's own methods, which have none, all."""
    return {b: cells for (b, its_level), cells in complete(rows, problems, form).items() if its_level in (level, OWN)}


def _time_to(row, accuracy: float) -> float:
    """Time [s] of an answer that is as accurate; infinite for others."""
    return row["seconds"] if row["outcome"] == "answered" and row["error"] <= accuracy else np.inf


def clocks(rows, problems: list[str], form: str, level: str) -> list[dict]:
    """Per solver, medians over its right answers: cold over warm call, spread, share of the library, and of its set-up."""
    lines = []
    for (backend, its_level), cells in complete(rows, problems, form).items():
        right = [r for r in cells if is_right(r)]
        if its_level == level and right:
            lines.append(
                {
                    "backend": backend,
                    "right": len(right),
                    "cold": middle([r["cold"] / r["seconds"] for r in right]),
                    "spread": middle([(r["upper"] - r["lower"]) / r["seconds"] for r in right]),
                    "library": float(np.median([r["library"] / r["seconds"] for r in right])),
                    "setup": float(np.median([r["setup"] / r["library"] for r in right])),
                }
            )
    return lines


def against_compiled(rows) -> list[dict]:
    """Per problem: the compiled dynamics of gauss beside the fastest QP solver as accurate, by call and by its library."""
    lines = []
    for row in rows:
        if row["backend"] != compiled.NAME:
            continue
        goal = max(COMPARABLE_ERRORS * row["error"], NEGLIGIBLE_ERROR) if np.isfinite(row["error"]) else np.nan
        line = {"problem": row["problem"], "seconds": row["seconds"], "error": row["error"]}
        for clock in ("seconds", "library"):
            peers = [
                r
                for r in rows
                if r["problem"] == row["problem"] and r["level"] in LEVELS and r["error"] <= goal and np.isfinite(r[clock])
            ]
            line[clock + " peer"] = min(peers, key=itemgetter(clock)) if peers else None
        lines.append(line)
    return lines


def profile(rows, problems: list[str], form: str, level: str, accuracy: float, ratios: np.ndarray) -> dict[str, np.ndarray]:
    """Performance profiles (Dolan and Moré 2002): share of problems solved to an accuracy within ratios of the best time."""
    chosen = _at_level(rows, problems, form, level)
    times = {(b, r["problem"]): _time_to(r, accuracy) for b, cells in chosen.items() for r in cells}
    best = {p: min((times[b, p] for b in chosen), default=np.inf) for p in problems}
    shares = {}
    for backend in chosen:
        own = np.array([times[backend, p] / best[p] if np.isfinite(best[p]) else np.inf for p in problems])
        shares[backend] = np.array([(own <= ratio).mean() for ratio in ratios])
    return shares


def verdict(row) -> str:
    """Verdict of a backend on an inconsistent problem: reported, given up, or claimed solved, within tolerance or not."""
    if row["claimed"] and row["level"] in LEVELS:
        return "broken" if is_broken(row) else "within"
    if row["claimed"]:
        return "claimed"
    return "said" if said(row["reason"]) == INFEASIBLE else "no answer"
