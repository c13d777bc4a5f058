"""Clarabel, called directly: one workspace for a whole motion, values updated."""

import clarabel
import numpy as np
from scipy import sparse

from gauss.backends.accuracy import accuracy
from gauss.backends.programme import Outcome, Programme, apply_settings, pattern


class Clarabel:
    """Interior point (Goulart and Chen 2024).

    Keep the object from call to call to reuse its workspace: the pattern of the rows depends on the scene only.

    Parameters
    ----------
    **settings
        Any setting of Clarabel; by default tolerances of 1e-9.

    Raises
    ------
    BackendError
        If there is no such setting.
    """

    name = "clarabel"

    def __init__(self, **settings):
        self.settings = clarabel.DefaultSettings()
        self.settings.verbose = False
        self.settings.presolve_enable = False  # presolved problems take no updates
        apply_settings(self.settings, accuracy("clarabel") | settings, self.name)
        self._solver, self._pattern = None, None

    def __call__(self, programme: Programme) -> Outcome:
        """Solve."""
        rows = sparse.vstack([programme.C, programme.K], format="csc") if programme.k.size else programme.C
        right = np.concatenate([programme.d, programme.k])
        upper_H, m = sparse.triu(programme.H, format="csc"), programme.d.size
        here = pattern(upper_H, rows)
        known, self._pattern = here == self._pattern, None  # a workspace that raises is not used again
        if known:
            self._solver.update(P=upper_H.data, q=programme.c, A=rows.data, b=right)
        else:
            cones = [clarabel.ZeroConeT(m)] if m else []
            cones += [clarabel.NonnegativeConeT(programme.k.size)] if programme.k.size else []
            self._solver = clarabel.DefaultSolver(
                sparse.csc_matrix(upper_H), programme.c, sparse.csc_matrix(rows), right, cones, self.settings
            )
        result = self._solver.solve()
        found = result.status == clarabel.SolverStatus.Solved
        x, y = np.array(result.x), np.array(result.z)
        self._pattern = here
        return Outcome(x, y[:m], y[m:], found, f"clarabel: {result.status}", int(result.iterations))
