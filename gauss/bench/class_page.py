"""Report of one class of problems: leaderboard, what each solver is good for, and what it answered to each problem."""

import numpy as np

from gauss.bench.classes import problems_of, story_of
from gauss.bench.fronts import FrontPoint, beats, cells, error_of, front, fronts, is_answered, of_special_form, special_cells
from gauss.bench.levels import LEVELS, LIMIT, MAIN_LEVEL, OURS, OWN
from gauss.bench.markdown import count_of, head, number, share, table
from gauss.bench.measure import WRONG, middle
from gauss.bench.problems import SOLVABLE
from gauss.bench.qp import CLASS_LOCK
from gauss.bench.settings_report import compared_lines
from gauss.bench.structured import COULOMB
from gauss.bench.summary import (
    RIGHT,
    asked,
    backends,
    checksum,
    dual_error,
    is_broken,
    is_kept,
    is_lost,
    is_right,
    mean_time,
    not_asked,
)
from gauss.bench.verdicts import is_false, stated, truth

HOW = f"""One rule for all. **Right**: the largest error of an unknown, relative to those of its unit, or of the
acceleration of a body or joint, is at most {RIGHT:g}, that of multipliers at most {WRONG:g}; of a problem without a
solution, its proven verdict is stated. **Kept**: residuals and gap are within the tolerance asked for, whatever a solver
looks at. **Claimed, beyond**: success was claimed, and a residual that the solver promises is above its tolerance and
above rounding; what each promises stands below, with its settings. **False verdict**: a problem is called infeasible or
unbounded that is not; qpsolvers hands on no such words of CVXOPT, HiGHS, KVXOPT, qpmad and quadprog. Error of
multipliers: of the solver's own, row by row or constraint by constraint, without the directions that redundant rows leave
open; a solver that gives none is off by 1. Errors are medians over all problems.

Times are CPU times of calls from Python on a ready problem, set-up included, and a tenth of their wall times at least:
shifted geometric means over all problems, a problem that is not solved right within {LIMIT:g} s counting as {LIMIT:g} s,
relative to the least. Library: the share of a call that the library reports as its own set-up and solve. Bounds are given
as rows."""

WARM = """Warm starts begin at the solution of the step before, where qpsolvers hands it on, which is x alone; set-up is made
anew, so that what they spare is iterations. Medians over the steps that have one."""

OWN_TIMES = """Times of gauss's own methods include making their matrices in Python, and that of auto the certificate;
a method that was not asked all problems, as those for equality rows alone, has no line."""
NONE_OF_OURS = "Methods of gauss itself take the problem of an instant of a mechanism, not any programme: none is here."
BY_CLASS = {
    "cones": """Asked are the solvers here that take second-order cones. Residuals count what is outside of a cone, of the
answer and of its multipliers. ECOS has a linear objective, so that it gets the epigraph of the quadratic one, which is made
before the clock runs. MuJoCo's solvers take impulses of contacts with a positive definite matrix, which they regularise by
a part of its own diagonal, so that they are asked the very problem; making their arrays is not timed. Their tolerance is of
the decrease of the cost in an iteration, the square of that of the level.""",
    "coulomb": """The answer is judged by the law itself: the primal residual is friction beyond its limit, the dual one an
approaching velocity, the gap the sum of |u_n r_n| and of what sliding friction falls short of the most that it can
dissipate; multipliers are the velocities. newton is gauss's own solver of time stepping, in machine code, with a tolerance
of its own; the others are short references in Python, whose times are those of Python. MuJoCo's solvers are asked for
[cones](qp_cones.md): theirs is the convex step, which lifts bodies that slide.""",
    "mpc": """HPIPM gets stages, and bounds as such; those that are infinite are 1e6, for residuals round where they are
larger. CasADi analyses the structure of the problem anew in every call, which its library does not count: that is
HPIPM's solve alone. Fatrop, a solver of nonlinear programmes with stages, gets functions of cost and rows, which are made
before the clock runs; its tolerance is scaled, and its bounds are loose by about 1e-8.""",
}


def class_page(kind: str, rows, header: list[str], chart: str) -> str:
    """The page of a class: all of its main level, and a table by levels where there are others."""
    left, every = not_asked(at_main_level(rows)), asked(rows)
    rows = at_main_level(every)
    problems = list(dict.fromkeys(row["problem"] for row in rows))
    mine = ordered(cells(rows))
    solvable = any(truth(row) == SOLVABLE for row in rows)
    conditions = [*header, f"all packages: [{CLASS_LOCK}]({CLASS_LOCK})", checksum(rows)]
    lines = head(f"QP solvers on problems of class {kind}", conditions)
    lines += [f"{story_of(kind)} Asked: {len(problems)} of its {len(problems_of(kind))} problems.", "", HOW, ""]
    lines += [BY_CLASS[kind], ""] if kind in BY_CLASS else []
    lines += left
    lines += [f"![Error against time, all problems and each]({chart})", ""] if chart else []
    lines += _board("Leaderboard", mine, solvable) + _sentences(list(mine), mine, *fronts(rows)[1:])
    special = of_special_form(rows, mine)
    others = ordered(special_cells(special, mine))
    lines += _special_board(special, list(others), solvable)
    if set(OURS) & set(mine):
        lines += [OWN_TIMES, ""]
    elif kind != COULOMB:
        lines += [NONE_OF_OURS, ""]
    lines += _by_level(every, list(mine)) + _by_problem(problems, mine | others)
    return "\n".join(lines + compared_lines([name for name in backends(rows) if name not in OURS], MAIN_LEVEL)) + "\n"


def at_main_level(rows) -> list[dict]:
    """Rows of the level that a page is about, high or the only one, and those of methods without levels."""
    levels = {row["level"] for row in rows} - {OWN}
    main = MAIN_LEVEL if MAIN_LEVEL in levels else max(levels, key=list(LEVELS).index, default=OWN)
    return [row for row in rows if row["level"] in (main, OWN)]


def _by_level(rows, names: list[str]) -> list[str]:
    """Kept promises, right answers and times of each solver at every level, on the problems asked at all of them."""
    levels = [level for level in LEVELS if any(row["level"] == level for row in rows)]
    common = set.intersection(*({row["problem"] for row in rows if row["level"] == level} for level in levels or [OWN]))
    found = _lines_by_level(rows, names, levels, common)
    if len(levels) < 2 or not found:
        return []
    words = "; ".join(f"{level} {LEVELS[level]:g}" for level in levels)
    return [
        "## By level",
        "",
        f"Tolerances: {words}. Asked at each: {count_of(len(common), 'problem')}. Right, kept; claimed, beyond where that "
        "is not none. Then shifted geometric means of times in ms.",
        "",
        *table(["solver", *levels, *(f"{level} [ms]" for level in levels)], found),
        "",
    ]


def _lines_by_level(rows, names: list[str], levels: list[str], problems: set[str]) -> list[list]:
    """A line for each solver that was asked all of the problems at all levels."""
    cells_at: dict[tuple[str, str], list[dict]] = {}
    for row in rows:
        if row["problem"] in problems:
            cells_at.setdefault((row["backend"], row["level"]), []).append(row)
    found = {name: [cells_at.get((name, level), []) for level in levels] for name in names}
    complete = {name: mine for name, mine in found.items() if all(len(one) == len(problems) for one in mine)}
    return [[name, *map(_at_level, mine), *map(_mean, mine)] for name, mine in complete.items()]


def _at_level(found: list[dict]) -> str:
    broken = sum(map(is_broken, found))
    return f"{sum(map(is_right, found))}, {sum(map(is_kept, found))}{f'; {broken} beyond' if broken else ''}"


def _mean(found: list[dict]) -> str:
    return f"{1e3 * mean_time(found):.3g}"


def ordered(mine: dict[str, list[dict]]) -> dict[str, list[dict]]:
    """Solvers by rank: the share that is right, then the mean time."""
    return dict(sorted(mine.items(), key=lambda item: (-sum(map(is_right, item[1])), mean_time(item[1]))))


def _special_board(rows: list[dict], named: list[str], solvable: bool) -> list[str]:
    """Leaderboard of the problems that solvers of a special form take, and sentences about these; none without any."""
    if not rows:
        return []
    mine, overall, panels = ordered(cells(rows)), *fronts(rows)[1:]
    taken = count_of(len({row["problem"] for row in rows}), "problem")
    title = f"Leaderboard of the {taken} that solvers of a special form take"
    return _board(title, mine, solvable) + _sentences(named, mine, overall, panels)[2:]


def _board(title: str, mine: dict[str, list[dict]], solvable: bool) -> list[str]:
    warm = any(np.isfinite(row.get("warm", np.nan)) for found in mine.values() for row in found)
    titles = ["", "solver", "right", "false verdicts", "claimed, beyond"]
    titles += ["kept", "error", "error of multipliers"] if solvable else ["no verdict"]
    titles += ["crashed, timed out", "time", "library"] + (["warm / cold start"] if warm else [])
    least = min(map(mean_time, mine.values()), default=np.nan)
    body = []
    for rank, (name, found) in enumerate(mine.items(), start=1):
        texts = [rank, name, f"{sum(map(is_right, found))}/{len(found)}", sum(map(is_false, found))]
        texts += [sum(map(is_broken, found)), *(_accuracy(found) if solvable else [sum(not stated(row) for row in found)])]
        texts += [sum(map(is_lost, found)), _factor(mean_time(found) / least)]
        texts += [_in_library(found)]
        body.append(texts + ([_warm(found)] if warm else []))
    return [f"## {title}", "", *table(titles, body), *(["", WARM] if warm else []), ""]


def _accuracy(found: list[dict]) -> list[str]:
    """Share of kept promises, and median errors."""
    kept = share(sum(map(is_kept, found)) / len(found)) if found[0]["level"] != OWN else ""
    errors = [dual_error(row) if is_answered(row) else np.nan for row in found]
    return [kept, number(middle(list(map(error_of, found)))), number(middle(errors))]


def _in_library(found: list[dict]) -> str:
    """Median share of the times of right answers that the library itself reports: of set-up and solve, or of solve alone."""
    times = [(row["seconds"], row["library"], row.get("solve", np.nan)) for row in found if is_right(row)]
    shares = [(whole if np.isfinite(whole) else solve) / call for call, whole, solve in times]
    return f"{np.nanmedian(shares):.0%}" if np.isfinite(shares).any() else "–"


def _factor(value: float) -> str:
    return f"{value:.0f}" if value >= 100.0 else f"{value:.2g}"


def _warm(found: list[dict]) -> str:
    """Median share of the time of a cold start that a warm one takes."""
    shares = [row["warm"] / row["seconds"] for row in found if np.isfinite(row["warm"])]
    return f"{np.median(shares):.2g}" if shares else "takes no start"


def _sentences(
    names: list[str], mine: dict[str, list[dict]], overall: dict[str, FrontPoint], panels: dict[str, dict]
) -> list[str]:
    lines = ["## What each is good for", ""]
    lines += [f"* **{name}** {sentence(name, mine, overall, panels)}" for name in names]
    return [*lines, ""]


def sentence(name: str, mine: dict[str, list[dict]], overall: dict[str, FrontPoint], panels: dict[str, dict]) -> str:
    """Sentence on a solver, from its numbers."""
    found = mine[name]
    count, right = len(found), sum(map(is_right, found))
    if not right:
        return f"is right on none of {count}{_lies(found)}."
    share_of = "on all" if right == count else f"on {right} of"
    ahead = sum(name in front(points) for points in panels.values())
    text = f"is right {share_of} {count}{f' and on the front of {ahead}' if ahead else ''}{_lies(found)}"
    if not overall:
        return f"{text}, in {_place(mean_time(found) / min(map(mean_time, mine.values())))}."
    if name not in overall:
        return f"{text}, and gives no answer to half of them or more."
    if name in front(overall):
        place, error = _place(overall[name].ratio), number(overall[name].error)
        return f"{text}; no other is both faster and more accurate ({place}, median error {error})."
    better = [other for other in front(overall) if beats(overall[other], overall[name])]
    best = min(better, key=lambda other: overall[other].ratio)
    factor = overall[name].ratio / overall[best].ratio
    errors = number(overall[best].error), number(overall[name].error)
    return f"{text}; {best} is {_factor(factor)} × as fast, its median error {errors[0]} beside {errors[1]}."


def _place(ratio: float) -> str:
    return "the least mean time" if ratio == 1.0 else f"{_factor(ratio)} × the least mean time"


def _lies(found: list[dict]) -> str:
    false, broken = sum(map(is_false, found)), sum(map(is_broken, found))
    words = [f"states {false} false verdict{'s' if false > 1 else ''}"] if false else []
    words += [f"claims {broken} beyond its tolerance"] if broken else []
    return "".join(f", {part}" for part in words)


def _by_problem(problems: list[str], mine: dict[str, list[dict]]) -> list[str]:
    at = {(name, row["problem"]): row for name, found in mine.items() for row in found}
    return [
        "## Problem by problem",
        "",
        "Error, and in brackets that of the multipliers; the verdict where one is stated. Bold: claimed, beyond, or a false "
        "verdict. –: no answer.",
        "",
        *table(["problem", *mine], ([problem, *(_cell(at.get((name, problem))) for name in mine)] for problem in problems)),
        "",
    ]


def _cell(row) -> str:
    if row is None:  # not asked
        return ""
    if is_lost(row):
        return row["outcome"]
    verdict = stated(row)
    if verdict:
        return f"**{verdict}**" if is_false(row) else verdict
    if np.isfinite(row["error"]):
        text = f"{number(row['error'])} ({number(dual_error(row))})"
    else:
        text = "solved" if row["claimed"] else "–"
    return f"**{text}**" if is_broken(row) else text
