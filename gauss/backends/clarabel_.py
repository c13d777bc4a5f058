"""Clarabel, called directly: one workspace for a whole motion, values updated."""

import clarabel
import numpy as np

from gauss.backends.accuracy import accuracy
from gauss.backends.programme import Outcome, Programme, apply_settings
from gauss.backends.workspace import Layout


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
        self._solver, self._layout, self._hessian = None, None, None

    def __call__(self, programme: Programme) -> Outcome:
        """Solve."""
        layout, self._layout = self._layout, None  # a workspace that raises is not used again
        right, m = np.concatenate([programme.d, programme.k]), programme.d.size
        if layout is not None and layout.fits(programme):
            hessian = layout.hessian(programme)
            changed = {} if hessian.tobytes() == self._hessian else {"P": hessian.tolist()}
            rows = layout.row_entries(programme).tolist()  # Clarabel reads lists twice as fast as arrays
            self._solver.update(q=programme.c.tolist(), A=rows, b=right.tolist(), **changed)
        else:
            layout = Layout(programme)
            hessian = layout.upper.data
            cones = [clarabel.ZeroConeT(m)] if m else []
            cones += [clarabel.NonnegativeConeT(programme.k.size)] if programme.k.size else []
            self._solver = clarabel.DefaultSolver(layout.upper, programme.c, layout.rows, right, cones, self.settings)
        result = self._solver.solve()
        found = result.status == clarabel.SolverStatus.Solved
        x, y = np.array(result.x), np.array(result.z)
        self._layout, self._hessian = layout, hessian.tobytes()
        return Outcome(x, y[:m], y[m:], found, f"clarabel: {result.status}", int(result.iterations))
