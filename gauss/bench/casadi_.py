"""QP solvers that come with CasADi: qpOASES, its own active-set method, and HPIPM for problems with stages.

Fatrop's interface to programmes fails on those with stages, on some with a wrong answer that is called a success; the
interior-point method ipqp returns nan, and calls it a success, where no row is an inequality.
"""

import contextlib
import os
import sys
from typing import Any

import numpy as np
from scipy import sparse

from gauss.backends.programme import Outcome, Programme
from gauss.bench.clocks import UNKNOWN, Times
from gauss.bench.structured import StructuredProgramme
from gauss.errors import BackendError

SOLVERS: dict[str, dict[str, Any]] = {
    "qpoases": {"printLevel": "none"},
    "qrqp": {"print_iter": False, "print_header": False, "print_info": False},
}
STAGEWISE = ("hpipm",)
FREE = 1e6  # bounds of this size stand for none: HPIPM's residuals round where they are as large as CasADi's 1e8


def ready(solver: str, programme: Programme, settings: dict):
    """Call, reading, clock and surroundings of a solver; the call makes it anew, set-up included."""
    import casadi

    if solver in STAGEWISE:
        return _stagewise(programme, settings)
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

    return call, read, _wall_time, _quiet()


def _stagewise(programme: Programme, settings: dict):
    """The same for HPIPM, which takes rows of the dynamics with their sign turned, and bounds as such."""
    import casadi

    if not isinstance(programme, StructuredProgramme):
        raise BackendError("hpipm takes programmes with stages only.")
    steps, n_x, n_u = programme.structure.stages
    n, K = programme.c.size, sparse.csr_matrix(programme.K)
    if (np.diff(K.indptr) != 1).any():
        raise BackendError("hpipm takes bounds, and no other inequality rows, here.")
    where, sign = K.indices, np.sign(K.data)
    bounds = programme.k / K.data
    lower, upper = np.full(n, -np.inf), np.full(n, np.inf)
    np.maximum.at(lower, where[sign < 0.0], bounds[sign < 0.0])
    np.minimum.at(upper, where[sign > 0.0], bounds[sign > 0.0])
    H, rows = casadi.DM(programme.H), casadi.DM(-programme.C)
    given: dict[str, Any] = {
        "h": H,
        "g": programme.c,
        "a": rows,
        "lba": -programme.d,
        "uba": -programme.d,
        "lbx": lower,
        "ubx": upper,
    }
    pattern = {"h": H.sparsity(), "a": rows.sparsity()}
    stages = {"N": steps, "nx": [0] + [n_x] * steps, "nu": [n_u] * steps + [0], "ng": [0] * (steps + 1)}
    options: dict[str, Any] = {"inf": FREE, "error_on_fail": False, "record_time": True, "hpipm": settings} | stages

    def call():
        made = casadi.conic("solver", "hpipm", pattern, options)
        return made(**given), made.stats()

    def read(found) -> Outcome:
        result, said = found
        x, y, box = (np.asarray(result[name], dtype=float).ravel() for name in ("x", "lam_a", "lam_x"))
        z = np.maximum(sign * box[where], 0.0) / np.abs(K.data)
        message = f"hpipm: {'solved' if said['success'] else 'return status {}'.format(said['return_status'])}"
        return Outcome(x, -y, z, said["success"], message, max(int(said["iter_count"]), 0))

    return call, read, _wall_time, _quiet()


def _wall_time(found) -> Times:
    """Time that CasADi has clocked around the solver."""
    return Times(UNKNOWN.setup, found[1].get("t_wall_solver", np.nan), UNKNOWN.total)


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
