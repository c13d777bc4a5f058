"""Why there is no motion: conditions on the ends may be missed, and the least sum of what they miss names them.

With the equations of motion and the limits as they are, Σ |missed| is least (the elastic mode of Gill, Murray and Saunders,
SNOPT, SIAM Review 47, 2005): its ℓ1 norm leaves most conditions met, and those that cannot be met stand out.
"""

import numpy as np

from gauss.analysis.optimal.transcription import MotionProblem, MotionValues, Solved, Transcription
from gauss.errors import SimulationError

MISSED = 1e-4  # share of the unit, above which a condition counts as missed
AT_LIMIT = 1e-3  # share of the range of an input, within which it is at its limit
MOST_OF_THE_TIME = 0.5  # share of the mesh at the limit, from which it is named


def refuse(problem: MotionProblem, mesh: np.ndarray, rows: list[int], guess: MotionValues, solved: Solved):
    """Raise an error that says what stands against a motion.

    Raises
    ------
    SimulationError
        Always.
    """
    nearest = Transcription(problem, mesh, rows, relaxed=True).solve(guess)
    units = problem.units
    missed = []
    for (kind, one), share in zip(problem.conditions, nearest.misses, strict=True):
        if abs(share) > MISSED:
            wanted = f"{one.low:.6g}" if one.is_fixed else f"{one.low:.6g} to {one.high:.6g}"
            missed.append(f"{kind}: {one.name!r} misses {wanted} by {abs(share) * units[one.place]:.3g}")
    if nearest.is_optimal and missed:
        low, high = problem.duration
        span = f"{low:.6g} s" if low == high else f"{low:.6g} to {high:.6g} s"
        raise SimulationError(
            f"optimal motion: no motion of {span} within the limits was found. The nearest one: {'; '.join(missed)}."
            f"{_at_limits(problem, nearest.values)} Give more time, wider limits, or guess=."
        )
    raise SimulationError(
        f"optimal motion: IPOPT did not converge ({solved.status} after {solved.iterations} iterations, residual "
        f"{solved.residual:.1e}){'; the conditions can be met' if nearest.is_optimal else ''}. "
        "Give guess= (a motion), another number of intervals=, or more iterations=."
    )


def _at_limits(problem: MotionProblem, values: MotionValues) -> str:
    """Sentence on the limits that most of a motion is at."""
    equations, (lowest, highest, low, high) = problem.equations, problem.bounds
    names = {place: name for name, place in _names(problem).items()}
    found = []
    of = [(values.u[0] * equations.input_units[:, None], low, high, dict(enumerate(equations.names)))]
    of.append((values.x[:, 1:-1] * equations.units[:, None], lowest, highest, names))
    for rows, least, largest, called in of:
        room = AT_LIMIT * np.where(np.isfinite(largest - least), largest - least, 0.0)
        at = (rows <= (least + room)[:, None]) | (rows >= (largest - room)[:, None])
        found += [called[int(k)] for k in np.flatnonzero(at.mean(axis=1) > MOST_OF_THE_TIME) if int(k) in called]
    return f" At its limit most of the time: {', '.join(map(repr, found))}." if found else ""


def _names(problem: MotionProblem) -> dict[str, int]:
    from gauss.analysis.optimal.conditions import entries

    return entries(problem.equations.system)
