"""DAQP, called directly: a dual active-set method on dense matrices; each call starts anew.

The call is that of qpsolvers, which imports every solver that is installed: a quarter of a second, for one of a millisecond.
"""

import daqp
import numpy as np

from gauss.backends.programme import Outcome, Programme

UNBOUNDED = -1e30  # lower bound of an inequality row, which DAQP takes for none
EQUALITY = 5  # bits of a row that is active and stays so


class DAQP:
    """Dual active set (Arnström, Bemporad, Axehill 2022).

    Parameters
    ----------
    **settings
        Any setting of DAQP.
    """

    name = "daqp"
    dense = True

    def __init__(self, **settings):
        self.settings = settings

    def __call__(self, programme: Programme) -> Outcome:
        """Solve."""
        m, s = programme.d.size, programme.k.size
        H, C, K = map(_array, (programme.H, programme.C, programme.K))
        upper = np.concatenate([programme.k, programme.d])
        sense = np.zeros(s + m, dtype=np.intc)
        sense[s:] = EQUALITY
        lower = np.full(s + m, UNBOUNDED)
        x, _, flag, info = daqp.solve(H, programme.c, np.concatenate([K, C]), upper, lower, sense, **self.settings)
        if not flag > 0:
            return Outcome(None, None, None, False, "daqp: found no solution")
        return Outcome(np.asarray(x), info["lam"][s:], info["lam"][:s], True, "daqp: solved")


def _array(matrix) -> np.ndarray:
    """Dense array of a matrix, which programmes made elsewhere keep sparse."""
    return matrix if isinstance(matrix, np.ndarray) else matrix.toarray()
