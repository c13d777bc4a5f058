"""PIQP, called directly: one workspace for a whole motion, values updated."""

from typing import Any

import numpy as np
import piqp

from gauss.backends.programme import Outcome, Programme, apply_settings
from gauss.backends.workspace import SparsityLayout


class PIQP:
    """Proximal interior point (Schwan, Jiang, Kuhn, Jones 2023), its sparse variant.

    Keep the object from call to call to reuse its workspace: the pattern of the rows depends on the scene only.

    Parameters
    ----------
    **settings
        Any setting of PIQP.

    Raises
    ------
    BackendError
        If there is no such setting.
    """

    name = "piqp"

    def __init__(self, **settings):
        self.settings = settings
        apply_settings(piqp.SparseSolver().settings, self.settings, self.name)
        self._solver: Any = None
        self._layout: SparsityLayout | None = None
        self._hessian = b""

    def __call__(self, programme: Programme) -> Outcome:
        """Solve."""
        layout, self._layout = self._layout, None  # a workspace that raises is not used again
        known = None if layout is None else layout.matrices(programme)
        if layout is None or known is None:
            layout = SparsityLayout(programme, layout)
        C, K = known or layout.own_matrices
        data = programme.c, C, programme.d, K, None, programme.k
        if known:
            same = programme.H.data.tobytes() == self._hessian
            self._solver.update(None if same else programme.H, *data)
        else:
            self._solver = piqp.SparseSolver()
            apply_settings(self._solver.settings, self.settings, self.name)
            self._solver.setup(programme.H, *data)
        status = self._solver.solve()
        result = self._solver.result
        x, y, z = (np.array(part) for part in (result.x, result.y, result.z_u))
        self._layout, self._hessian = layout, programme.H.data.tobytes()
        return Outcome(x, y, z, status == piqp.PIQP_SOLVED, f"piqp: {status.name}", int(result.info.iter))
