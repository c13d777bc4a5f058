"""OSQP, called directly: one workspace for a whole motion, values updated, warm start from the last instant."""

import numpy as np
import osqp
from scipy import sparse

from gauss.backends.accuracy import accuracy
from gauss.backends.programme import Outcome, Programme, pattern

DEFAULTS = {"max_iter": 20_000, "verbose": False, "polishing": True}


class OSQP:
    """Operator splitting (Stellato et al. 2020).

    Keep the object from call to call to reuse its workspace: the pattern of the rows depends on the scene only.

    Parameters
    ----------
    **settings
        Any setting of OSQP; by default tolerances of 1e-9 and polishing.
    """

    name = "osqp"

    def __init__(self, **settings):
        self.settings = DEFAULTS | accuracy("osqp") | settings
        self._solver, self._pattern = None, None

    def __call__(self, programme: Programme) -> Outcome:
        """Solve."""
        rows = sparse.vstack([programme.C, programme.K], format="csc") if programme.k.size else programme.C
        lower = np.concatenate([programme.d, np.full(programme.k.size, -np.inf)])
        upper = np.concatenate([programme.d, programme.k])
        upper_H = sparse.triu(programme.H, format="csc")
        here = pattern(upper_H, rows)
        known, self._pattern = here == self._pattern, None  # a workspace that raises is not used again
        if known:
            self._solver.update(q=programme.c, l=lower, u=upper, Px=upper_H.data, Ax=rows.data)
        else:
            self._solver = osqp.OSQP()
            self._solver.setup(upper_H, programme.c, sparse.csc_matrix(rows), lower, upper, **self.settings)
        result = self._solver.solve(raise_error=False)
        m = programme.d.size
        found = result.info.status in ("solved", "solved inaccurate")
        x, y = np.asarray(result.x), np.asarray(result.y)
        self._pattern = here
        return Outcome(x, y[:m], y[m:], found, f"osqp: {result.info.status}", int(result.info.iter))
