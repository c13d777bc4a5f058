"""QP solvers that come with CasADi: qpOASES, and its own active-set method.

HPIPM and fatrop take problems with stages only, which those of one instant do not have; the interior-point method ipqp
returns nan, and calls it a success, where no row is an inequality.
"""

import contextlib
import os
import sys
from typing import Any

import numpy as np
from scipy import sparse

from gauss.backends.programme import Outcome, Programme
from gauss.bench.clocks import UNKNOWN, Times

SOLVERS: dict[str, dict[str, Any]] = {
    "qpoases": {"printLevel": "none"},
    "qrqp": {"print_iter": False, "print_header": False, "print_info": False},
}


def ready(solver: str, programme: Programme, settings: dict):
    """Call, reading, clock and surroundings of a solver; the call makes it anew, set-up included."""
    import casadi

    programme, m = programme.without_zeros(), programme.d.size
    H, rows = casadi.DM(programme.H), casadi.DM(sparse.csc_matrix(sparse.vstack([programme.C, programme.K])))
    lower = np.concatenate([programme.d, np.full(programme.k.size, -np.inf)])
    given: dict[str, Any] = {
        "h": H,
        "g": programme.c,
        "a": rows,
        "lba": lower,
        "uba": np.concatenate([programme.d, programme.k]),
    }
    pattern = {"h": H.sparsity(), "a": rows.sparsity()}
    options: dict[str, Any] = SOLVERS[solver] | settings | {"error_on_fail": False, "record_time": True}

    def call():
        made = casadi.conic("solver", solver, pattern, options)
        return made(**given), made.stats()

    def read(found) -> Outcome:
        result, said = found
        x, y = (np.asarray(result[name], dtype=float).ravel() for name in ("x", "lam_a"))
        words = said.get("return_status", said["unified_return_status"])
        return Outcome(x, y[:m], y[m:], said["success"], f"{solver}: {words}", max(int(said["iter_count"]), 0))

    def library(found) -> Times:
        return Times(UNKNOWN.setup, found[1].get("t_wall_solver", np.nan), UNKNOWN.total)

    return call, read, library, _quiet()


@contextlib.contextmanager
def _quiet():
    """Nothing is printed: qpOASES greets from C."""
    sys.stdout.flush()
    kept, nowhere = os.dup(1), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    try:
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)
        os.close(nowhere)
