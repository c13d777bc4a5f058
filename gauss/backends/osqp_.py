"""OSQP, called directly: one workspace for a whole motion, values updated, warm start from the last instant."""

import numpy as np
import osqp
from scipy import sparse

from gauss.compulsion import Answer, Compulsion
from gauss.compulsion.forms import scaled

DEFAULTS = {"eps_abs": 1e-9, "eps_rel": 1e-9, "max_iter": 20_000, "verbose": False, "polishing": True}


class OSQP:
    """Operator splitting (Stellato et al. 2020) on F2s.

    Keep the object from call to call to reuse its workspace: the pattern of the rows depends on the scene only.

    Parameters
    ----------
    **settings
        Any setting of OSQP; by default tolerances of 1e-9 and polishing.
    """

    name = "osqp"

    def __init__(self, **settings):
        self.settings = DEFAULTS | settings
        self._solver, self._pattern = None, None

    def __call__(self, compulsion: Compulsion) -> Answer:
        """Solve."""
        form = scaled(compulsion)
        if not form.d.size and not form.k.size:
            return form.answer(form.x_free, np.zeros(0))  # nothing binds the bodies: nothing to ask for
        rows = sparse.vstack([form.C, sparse.csc_array(form.K)], format="csc") if form.k.size else form.C
        lower = np.concatenate([form.d, np.full(form.k.size, -np.inf)])
        upper = np.concatenate([form.d, form.k])
        pattern = (rows.shape, rows.indptr.tobytes(), rows.indices.tobytes())
        if pattern == self._pattern:
            self._solver.update(q=-form.x_free, l=lower, u=upper, Ax=rows.data)
        else:
            self._solver, self._pattern = osqp.OSQP(), pattern
            one = sparse.csc_matrix(sparse.eye_array(form.x_free.size))
            self._solver.setup(one, -form.x_free, sparse.csc_matrix(rows), lower, upper, **self.settings)
        result = self._solver.solve(raise_error=False)
        m = form.d.size
        found = result.info.status in ("solved", "solved inaccurate")
        outcome = {"found": found, "message": f"osqp: {result.info.status}", "iterations": int(result.info.iter)}
        return form.answer(np.asarray(result.x), np.asarray(result.y[:m]), np.asarray(result.y[m:]), **outcome)
