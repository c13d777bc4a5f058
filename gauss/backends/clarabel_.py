"""Clarabel, called directly: one workspace for a whole motion, values updated."""

from typing import Any

import clarabel
import numpy as np

from gauss.backends.programme import Outcome, Programme, apply_settings
from gauss.backends.workspace import SparsityLayout


class Clarabel:
    """Interior point (Goulart and Chen 2024).

    Keep the object from call to call to reuse its workspace: the pattern of the rows depends on the scene only.

    Parameters
    ----------
    **settings
        Any setting of Clarabel; without ``presolve_enable=False`` a workspace takes no updates.

    Raises
    ------
    BackendError
        If there is no such setting.
    """

    name = "clarabel"

    def __init__(self, **settings):
        self.settings = clarabel.DefaultSettings()
        self.settings.verbose = False
        apply_settings(self.settings, settings, self.name)
        self._solver: Any = None
        self._layout: SparsityLayout | None = None
        self._hessian, self._linear = b"", b""

    def __call__(self, programme: Programme) -> Outcome:
        """Solve."""
        layout, self._layout = self._layout, None  # a workspace that raises is not used again
        right, m = np.concatenate([programme.d, programme.k]) if programme.k.size else programme.d, programme.d.size
        rows = None if layout is None else layout.row_entries(programme)
        if layout is not None and rows is not None:
            changed = {} if programme.H.data.tobytes() == self._hessian else {"P": layout.hessian(programme).tolist()}
            changed |= {} if programme.c.tobytes() == self._linear else {"q": programme.c.tolist()}
            self._solver.update(A=rows.tolist(), b=right.tolist(), **changed)  # lists are read twice as fast as arrays
        else:
            layout = SparsityLayout(programme, layout)
            cones = [clarabel.ZeroConeT(m)] if m else []
            cones += [clarabel.NonnegativeConeT(programme.k.size)] if programme.k.size else []
            self._solver = clarabel.DefaultSolver(layout.upper, programme.c, layout.rows, right, cones, self.settings)
        self._hessian, self._linear = programme.H.data.tobytes(), programme.c.tobytes()
        result = self._solver.solve()
        found = result.status == clarabel.SolverStatus.Solved
        x, y = np.array(result.x), np.array(result.z)
        self._layout = layout
        return Outcome(x, y[:m], y[m:], found, f"clarabel: {result.status}", int(result.iterations))
