"""Why there is no motion: conditions on the ends may be missed, and the least sum of what they miss names them.

With the equations of motion and the limits as they are, Σ |missed| is least (the elastic mode of Gill, Murray and Saunders,
SNOPT, SIAM Review 47, 2005): its ℓ1 norm leaves most conditions met, and those that cannot be met stand out.
"""

from collections.abc import Sequence

import numpy as np

from gauss.analysis.optimal.problem import MotionProblem, MotionValues, Solved
from gauss.analysis.optimal.programme import CollocationProgramme
from gauss.errors import SimulationError

MISSED = 1e-4  # share of the unit, above which a condition counts as missed
AT_LIMIT = 1e-3  # share of the range of an input, within which it is at its limit
MOST_OF_THE_TIME = 0.5  # share of the mesh at the limit, from which it is named


def refuse(problems: Sequence[MotionProblem], rows: list[list[int]], guesses: Sequence[MotionValues], solved: Solved):
    """Raise an error that says what stands against a motion.

    Raises
    ------
    SimulationError
        Always.
    """
    nearest = CollocationProgramme(problems, [guess.mesh for guess in guesses], rows, relaxed=True).solve(guesses)
    missed = []
    for phase, problem in enumerate(problems):
        for (kind, one), share in zip(problem.conditions, nearest.misses[phase], strict=True):
            if abs(share) > MISSED:
                wanted = f"{one.low:.6g}" if one.is_fixed else f"{one.low:.6g} to {one.high:.6g}"
                short = abs(share) * problem.units[one.place]
                missed.append(f"{_of_phase(problems, phase)}{kind}: {one.name!r} misses {wanted} by {short:.3g}")
    if nearest.is_optimal and missed:
        low, high = map(sum, zip(*(problem.duration for problem in problems), strict=True))
        span = f"{low:.6g} s" if low == high else f"{low:.6g} to {high:.6g} s"
        at_limits = "".join(_at_limits(*pair) for pair in zip(problems, nearest.values, strict=True))
        raise SimulationError(
            f"optimal motion: no motion of {span} within the limits was found. The nearest one: {'; '.join(missed)}."
            f"{at_limits} Give more time, wider limits, or guess=."
        )
    raise SimulationError(
        f"optimal motion: IPOPT did not converge ({solved.status} after {solved.iterations} iterations, residual "
        f"{solved.residual:.1e}){'; the conditions can be met' if nearest.is_optimal else ''}. "
        "Give guess= (a motion), another number of intervals=, or more iterations=."
    )


def _of_phase(problems: Sequence[MotionProblem], phase: int) -> str:
    return f"phase {phase + 1}: " if len(problems) > 1 else ""


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
