"""Accuracy of reactions: near singular configurations multipliers lose digits although accelerations are certified."""

import numpy as np

from gauss.backends.solution import Solution
from gauss.codegen import Scalar
from gauss.errors import SimulationError


def refuse_doubtful(solution: Solution, places, name: str, t: Scalar):
    """Raise a SimulationError if some multipliers of a solution are not certified.

    Parameters
    ----------
    solution : Solution
        Solution of a sample.
    places : int or array of int
        Indices of constraints, then of inequality rows.
    name : str
        Name of the joint or constraint.
    t : float
        Time of the sample [s].
    """
    error = float(np.max(solution.certificate.dual.errors[places], initial=0.0))
    if error <= solution.status.tolerance:
        return
    raise SimulationError(
        f"t = {t:.6g} s, backend {solution.backend!r}: the forces of {name!r} are not certified, though accelerations are: "
        f"estimated relative error {error:.1e}, expected at most {solution.status.tolerance:.0e}. Near a singular "
        "configuration forces lose digits; take samples farther from it (times= of simulate)."
    )
