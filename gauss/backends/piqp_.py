"""PIQP, called directly: one workspace for a whole motion, values updated."""

import numpy as np
import piqp

from gauss.backends.accuracy import accuracy
from gauss.backends.programme import Outcome, Programme, apply_settings, pattern


class PIQP:
    """Proximal interior point (Schwan, Jiang, Kuhn, Jones 2023), its sparse variant.

    Keep the object from call to call to reuse its workspace: the pattern of the rows depends on the scene only.

    Parameters
    ----------
    **settings
        Any setting of PIQP; by default tolerances of 1e-9.

    Raises
    ------
    BackendError
        If there is no such setting.
    """

    name = "piqp"

    def __init__(self, **settings):
        self.settings = accuracy("piqp") | settings
        apply_settings(piqp.SparseSolver().settings, self.settings, self.name)
        self._solver, self._pattern = None, None

    def __call__(self, programme: Programme) -> Outcome:
        """Solve."""
        here = pattern(programme.H, programme.C, programme.K)
        data = programme.H, programme.c, programme.C, programme.d, programme.K, None, programme.k
        known, self._pattern = here == self._pattern, None  # a workspace that raises is not used again
        if known:
            self._solver.update(*data)
        else:
            self._solver = piqp.SparseSolver()
            apply_settings(self._solver.settings, self.settings, self.name)
            self._solver.setup(*data)
        status = self._solver.solve()
        result = self._solver.result
        found = status == piqp.PIQP_SOLVED
        x, y, z = (np.array(part) for part in (result.x, result.y, result.z_u))
        self._pattern = here
        return Outcome(x, y, z, found, f"piqp: {status.name}", int(result.info.iter))
