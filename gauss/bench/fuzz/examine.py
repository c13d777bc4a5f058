"""Backends on random problems: how often they answer, whether the answer is right, and whether they report failures.

Called in a worker. Every answer is certified as users get it, and then compared with a reference of 50 digits.
"""

import math
import time
import warnings
from statistics import median

import numpy as np

from gauss.backends import BACKENDS, solve
from gauss.backends.active_set import active_set
from gauss.backends.certificate import TOLERANCE
from gauss.backends.compulsion import Compulsion
from gauss.backends.solution import Solution
from gauss.bench.fuzz.problems import fuzzed
from gauss.bench.levels import OURS, settings
from gauss.bench.measure import WRONG
from gauss.bench.reference import ReferenceSolution, reference
from gauss.errors import BackendError

LEVEL = "high"  # of QP solvers
COUNTS = ("problems", "certified", "flagged", "refused", "crashed", "timed_out", "unknown", "liar", "silent", "understated")
WORST = ("ratio", "number")
TYPICAL = ("error", "certificate", "seconds")


def examine(seed: int, numbers: list[int], backends: list[str]) -> list[dict]:
    """Counts of what each backend does with the problems of these numbers, one row each.

    * certified, flagged, refused: answers that the certificate confirms, that it does not, no finite answer;
    * unknown: no reference was found, nothing is compared;
    * liar: the backend claims success and is wrong by more than 1e-3, or not finite;
    * silent: certified, and off by more than the tolerance; understated: the error is above what the certificate says;
    * ratio: the largest of error over certificate, and the number of this problem, or of one that ended the process;
    * error, certificate: medians over certified answers; seconds: median of solving and certifying.
    """
    found: dict[str, list] = {backend: [] for backend in backends}
    for number in numbers:
        _, compulsion = fuzzed(seed, number)
        try:
            expected = reference(compulsion)
        except (BackendError, np.linalg.LinAlgError):
            expected = None
        for backend in backends:
            if not (compulsion.h.size and backend in BACKENDS):  # these take no inequality rows
                found[backend].append(_one(number, compulsion, expected, backend))
    return [{"backend": backend} | together(cells) for backend, cells in found.items() if cells]


def lost(number: int, outcome: str) -> dict:
    """Cell of a problem that ended the process that tried to solve it, or kept it too long."""
    nothing = dict.fromkeys(("ratio", "error", "certificate", "seconds"), math.nan)
    return dict.fromkeys(COUNTS, 0) | nothing | {"number": number, "problems": 1, outcome: 1}


def together(cells: list[dict]) -> dict:
    """One row of many cells, or of many rows."""
    row = {count: sum(cell[count] for cell in cells) for count in COUNTS}
    worst = _worst(cells)
    row |= {key: worst[key] if worst else math.nan for key in WORST}
    return row | {key: _median([cell[key] for cell in cells]) for key in TYPICAL}


def _worst(cells: list[dict]) -> dict | None:
    """Cell of a process that ended, or of the largest ratio; None where none was compared."""
    gone = next((cell for cell in cells if cell["crashed"] or cell["timed_out"]), None)
    compared = [cell for cell in cells if not math.isnan(cell["ratio"])]
    return gone or max(compared, key=lambda cell: cell["ratio"], default=None)


def _median(values: list[float]) -> float:
    known = [value for value in values if not math.isnan(value)]
    return median(known) if known else math.nan


def _one(number: int, compulsion: Compulsion, expected: ReferenceSolution | None, backend: str) -> dict:
    chosen = {} if backend in OURS else settings(backend, LEVEL)
    begin = time.perf_counter()
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        solution = solve(compulsion, backend, **chosen)
    cell = dict.fromkeys(COUNTS, 0) | dict.fromkeys((*WORST, *TYPICAL), math.nan)
    cell |= {"problems": 1, "number": number, "seconds": time.perf_counter() - begin}
    certified, claimed, certificate = solution.status.certified, solution.status.found, solution.certificate.error
    if math.isnan(certificate):  # some number of the answer is not finite
        return cell | {"refused": 1, "liar": int(claimed)}
    cell |= {"certified": int(certified), "flagged": int(not certified)}
    if expected is None:
        return cell | {"unknown": 1}
    error = _error(compulsion, expected, solution)
    cell |= {"liar": int(claimed and error > WRONG), "silent": int(certified and error > TOLERANCE)}
    cell |= {"understated": int(not error <= certificate), "ratio": error / certificate}
    return cell | ({"error": error, "certificate": certificate} if certified else {})


def _error(compulsion: Compulsion, expected: ReferenceSolution, solution: Solution) -> float:
    """Error of the accelerations, beside the same sizes as in the certificate."""
    return expected.error(compulsion, active_set(compulsion, solution.answer)[1])
