"""Reactions without digits are refused: that the accelerations of an instant are certified says nothing of them."""

import numpy as np

from gauss.backends.solution import Solution
from gauss.errors import SimulationError


def refuse_doubtful(solution: Solution, places, name: str, t: float):
    """Raise a SimulationError if some multipliers of a solution are not certified.

    Parameters
    ----------
    solution : Solution
        Of one instant.
    places : int or array of int
        Constraints, then inequality rows, of which the multipliers are asked.
    name : str
        To whom they belong.
    t : float
        Time of the instant [s].
    """
    error = float(np.max(solution.certificate.dual.errors[places], initial=0.0))
    if error <= solution.status.tolerance:
        return
    raise SimulationError(
        f"t = {t:.6g} s, backend {solution.backend!r}: the forces of {name!r} are not certified, though accelerations are: "
        f"estimated relative error {error:.1e}, expected at most {solution.status.tolerance:.0e}. Next to a singular "
        "configuration forces lose their digits; ask for samples that are further from it (times= of simulate)."
    )
