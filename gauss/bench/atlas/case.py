"""A case of the atlas, and the verdict on a method in it."""

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from gauss.bench.atlas.methods import Method
from gauss.errors import GaussError

PASSED, DEGRADED, HONEST, SILENT, SLOW = "passed", "degraded", "failed honestly", "failed silently", "timed out"
VERDICTS = (PASSED, DEGRADED, HONEST, SLOW, SILENT)


@dataclass(frozen=True)
class FailureCase:
    """Case in which a method may fail."""

    name: str  # its name
    criterion: str  # the physical figure by which methods are judged, in words
    # figure: ``figure(method, data)`` computes it; raises a GaussError if the method says that it fails
    figure: Callable[[Method, Any], float]
    prepare: Callable[[], Any] = lambda: None  # makes the data, once for all methods; it can be sent to another process
    # passes, fails: a figure up to the first passes, beyond the second it fails; between them it is degraded
    passes: float = 1e-9
    fails: float = 1e-3
    solvable: bool = True  # whether there is a solution; if not, a method passes by saying so


def judged(case: FailureCase, method: Method, data) -> dict:
    """Verdict on a method in a case, with the figure behind it and the method's own words."""
    figure, words = np.nan, ""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        try:
            with np.errstate(all="ignore"):
                figure = float(case.figure(method, data))
        except GaussError as error:
            words = str(error)
    heard = [w for w in said if w.category.__module__.startswith("gauss.")]
    words = words or "; ".join(str(warning.message) for warning in heard)
    return {"verdict": _verdict(case, figure, bool(words)), "figure": figure, "words": words[:300]}


def _verdict(case: FailureCase, figure: float, warned: bool) -> str:
    if not case.solvable:
        return PASSED if warned else SILENT
    if np.isnan(figure) and warned:
        return HONEST
    if figure <= case.passes:
        return PASSED
    if figure <= case.fails:
        return DEGRADED
    return HONEST if warned else SILENT
