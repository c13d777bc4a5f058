"""Verdicts of solvers on programmes without a solution, read from their status texts, and whether they are true."""

import re

from gauss.bench.problems import INCONSISTENT, SOLVABLE, UNKNOWN
from gauss.bench.suite.instance import INFEASIBLE, UNBOUNDED

# A certificate of dual infeasibility is a ray of descent.
NO_MINIMUM = re.compile(r"dual[ _]?infeasib\w*|unbounded")
NO_POINT = re.compile(r"infeasib|inconsistent")
DOUBTFUL = re.compile(r"almost|inaccurate|close|max|limit|trouble")  # words by which a verdict is hedged: no claim


def said(reason: str) -> str:
    """Verdict by the status text of a solver: "infeasible", "unbounded", or "" where there is none or it may be either."""
    words = reason.lower()
    if DOUBTFUL.search(words):
        return ""
    no_minimum, no_point = NO_MINIMUM.search(words), NO_POINT.search(NO_MINIMUM.sub("", words))
    if no_minimum and no_point:
        return ""
    return UNBOUNDED if no_minimum else INFEASIBLE if no_point else ""


def stated(row) -> str:
    """Verdict that a row of the comparison states; "" where it states none, or claims a solution."""
    return "" if row["claimed"] else said(row["reason"])


def truth(row) -> str:
    """Verdict that is proven of the problem of a row: "solvable", "infeasible" or "unbounded"; "unknown" without a proof."""
    found = row.get("verdict", SOLVABLE)  # older tables have problems with solutions alone, and one class by its name
    return INFEASIBLE if INCONSISTENT in (found, row.get("group")) else found


def is_false(row) -> bool:
    """Whether a row states a verdict that is not true."""
    return truth(row) != UNKNOWN and stated(row) not in ("", truth(row))
