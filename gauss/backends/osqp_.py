"""OSQP, called directly: one workspace for a whole motion, values updated, warm start from the last instant."""

from collections.abc import Collection
from typing import Any

import numpy as np

from gauss.backends.programme import Outcome, Programme
from gauss.backends.workspace import SparsityLayout
from gauss.errors import extra

with extra():
    import osqp


class OSQP:
    """Operator splitting (Stellato et al. 2020).

    Keep the object from call to call to reuse its workspace: the pattern of the rows depends on the scene only.

    Parameters
    ----------
    scaled_forms : collection of str
        Forms of programmes that are scaled already; OSQP does not scale them again.
    **settings
        Any setting of OSQP.
    """

    name = "osqp"

    def __init__(self, scaled_forms: Collection[str] = (), **settings):
        self.scaled_forms, self.settings = scaled_forms, settings
        self._solver: Any = None
        self._layout: SparsityLayout | None = None
        self._hessian = b""

    def __call__(self, programme: Programme) -> Outcome:
        """Solve."""
        layout, self._layout = self._layout, None  # a workspace that raises is not used again
        lower = np.concatenate([programme.d, np.full(programme.k.size, -np.inf)])
        upper = np.concatenate([programme.d, programme.k])
        rows = None if layout is None else layout.row_entries(programme)
        if layout is not None and rows is not None:
            hessian = layout.hessian(programme)
            changed = {} if hessian.tobytes() == self._hessian else {"Px": hessian}
            self._solver.update(q=programme.c, l=lower, u=upper, Ax=rows, **changed)
        else:
            layout, self._solver = SparsityLayout(programme, layout), osqp.OSQP()
            hessian = layout.upper.data
            rows = layout.rows.copy()  # OSQP keeps the matrix, and writes later values into it
            scaling = {"scaling": 0} if programme.form in self.scaled_forms else {}
            settings = {"verbose": False} | scaling | self.settings
            self._solver.setup(layout.upper.copy(), programme.c, rows, lower, upper, **settings)
        result = self._solver.solve(raise_error=False)
        m = programme.d.size
        found = result.info.status == "solved"  # "solved inaccurate" is no claim
        x, y = np.asarray(result.x), np.asarray(result.y)
        self._layout, self._hessian = layout, hessian.tobytes()
        return Outcome(x, y[:m], y[m:], found, f"osqp: {result.info.status}", int(result.info.iter))
