"""QP solvers that come with CasADi: qpOASES, its own active-set method, and HPIPM and Fatrop for problems with stages.

Fatrop is called through CasADi's interface to nonlinear programmes: that to quadratic ones fails on those with stages, on
some with a wrong answer that is called a success. The interior-point method ipqp returns nan, and calls it a success, where
no row is an inequality.
"""

import contextlib
import os
import sys
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from scipy import sparse

from gauss.backends.programme import Outcome, Programme
from gauss.bench.clocks import UNKNOWN, Times
from gauss.bench.ready import Ready
from gauss.bench.structured import StructuredProgramme
from gauss.errors import BackendError

SOLVERS: dict[str, dict[str, Any]] = {
    "qpoases": {"printLevel": "none"},
    "qrqp": {"print_iter": False, "print_header": False, "print_info": False},
}
FREE = 1e6  # bounds of this size stand for none: HPIPM's residuals round where they are as large as CasADi's 1e8


def ready(solver: str, programme: Programme, settings: dict) -> Ready:
    """A solver with its problem; the call makes it anew, set-up included."""
    import casadi

    if solver in STAGEWISE:
        return _stagewise(solver, programme, settings)
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

    return Ready(call, read, _wall_time, _quiet())


def _stagewise(solver: str, programme: Programme, settings: dict) -> Ready:
    """The same for solvers that take stages, and bounds as such."""
    if not isinstance(programme, StructuredProgramme):
        raise BackendError(f"{solver} takes programmes with stages only.")
    K = sparse.csr_matrix(programme.K)
    if (np.diff(K.indptr) != 1).any():
        raise BackendError(f"{solver} takes bounds, and no other inequality rows, here.")
    return STAGEWISE[solver](programme, Bounds.of_rows(K, programme.k), settings)


class Bounds(NamedTuple):
    """Inequality rows of one entry each as bounds of the unknowns: their places, signs and sizes, and the bounds (n,)."""

    places: np.ndarray
    signs: np.ndarray
    sizes: np.ndarray
    lower: np.ndarray
    upper: np.ndarray

    @classmethod
    def of_rows(cls, K: sparse.csr_matrix, k: np.ndarray) -> "Bounds":
        """Bounds of K x ≤ k."""
        places, signs, bounds = K.indices, np.sign(K.data), k / K.data
        lower, upper = np.full(K.shape[1], -np.inf), np.full(K.shape[1], np.inf)
        np.maximum.at(lower, places[signs < 0.0], bounds[signs < 0.0])
        np.minimum.at(upper, places[signs > 0.0], bounds[signs > 0.0])
        return cls(places, signs, np.abs(K.data), lower, upper)

    def multipliers(self, box: np.ndarray) -> np.ndarray:
        """Multipliers of the rows by those of the bounds (n,), which are negative at lower ones."""
        return np.maximum(self.signs * box[self.places], 0.0) / self.sizes


def _hpipm(programme: StructuredProgramme, bounds: Bounds, settings: dict) -> Ready:
    """HPIPM takes rows of the dynamics with their sign turned."""
    import casadi

    H, rows = casadi.DM(programme.H), casadi.DM(-programme.C)
    given: dict[str, Any] = {"h": H, "g": programme.c, "a": rows, "lba": -programme.d, "uba": -programme.d}
    given |= {"lbx": bounds.lower, "ubx": bounds.upper}
    pattern = {"h": H.sparsity(), "a": rows.sparsity()}
    options: dict[str, Any] = {"inf": FREE, "error_on_fail": False, "record_time": True, "hpipm": settings}
    options |= _stages(programme)

    def call():
        made = casadi.conic("solver", "hpipm", pattern, options)
        return made(**given), made.stats()

    def read(found) -> Outcome:
        result, said = found
        x, y, box = (np.asarray(result[name], dtype=float).ravel() for name in ("x", "lam_a", "lam_x"))
        return Outcome(x, -y, bounds.multipliers(box), *_claim("hpipm", said))

    return Ready(call, read, _wall_time, _quiet())


def _fatrop(programme: StructuredProgramme, bounds: Bounds, settings: dict) -> Ready:
    """Fatrop as the solver of nonlinear programmes that it is; the functions that it evaluates are made beforehand."""
    import casadi

    x = casadi.MX.sym("x", programme.c.size)
    rows = casadi.mtimes(casadi.DM(programme.C), x)
    cost = 0.5 * casadi.bilin(casadi.DM(programme.H), x, x) + casadi.dot(casadi.DM(programme.c), x)
    options: dict[str, Any] = {"expand": True, "print_time": False, "record_time": True, "error_on_fail": False}
    options |= {"structure_detection": "manual", "equality": [True] * programme.d.size}
    options |= _stages(programme)
    options["fatrop"] = {"print_level": 0} | settings
    made = casadi.nlpsol("solver", "fatrop", {"x": x, "f": cost, "g": rows}, options)
    given: dict[str, Any] = {"lbg": programme.d, "ubg": programme.d, "lbx": bounds.lower, "ubx": bounds.upper}

    def call():
        return made(**given), made.stats()

    def read(found) -> Outcome:
        result, said = found
        x, y, box = (np.asarray(result[name], dtype=float).ravel() for name in ("x", "lam_g", "lam_x"))
        return Outcome(x, y, bounds.multipliers(box), *_claim("fatrop", said))

    return Ready(call, read, _wall_time, _quiet())


def _stages(programme: StructuredProgramme) -> dict[str, Any]:
    """Options that give CasADi the stages of a programme; the initial state is no unknown."""
    steps, n_x, n_u = programme.structure.stages
    return {"N": steps, "nx": [0] + [n_x] * steps, "nu": [n_u] * steps + [0], "ng": [0] * (steps + 1)}


def _claim(solver: str, said: dict[str, Any]) -> tuple[bool, str, int]:
    """Claim, message and iterations of a solver of stages."""
    words = "solved" if said["success"] else f"return status {said['return_status']}"
    return said["success"], f"{solver}: {words}", max(int(said["iter_count"]), 0)


STAGEWISE: dict[str, Callable[[StructuredProgramme, Bounds, dict], Ready]] = {"fatrop": _fatrop, "hpipm": _hpipm}


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
