"""Coulomb's law by solvers of cone programmes: minimise ½ rᵀ W r + qᵀ r over the friction cones ‖r_T‖ ≤ μ r_N."""

from collections.abc import Callable
from typing import Protocol

import numpy as np

from gauss.errors import SimulationError, extra

MOST_PROGRAMMES = 300  # of the fixed point
FIXED = 1e-10  # relative: change of the tangential rates that ends it
ACCURACY = 1e-12  # of a programme


class ConeSolver(Protocol):
    """Solver of one programme."""

    def __call__(self, W: np.ndarray, q: np.ndarray, mu: np.ndarray) -> np.ndarray:
        """Impulses (3 m,) that minimise ½ rᵀ W r + qᵀ r over the friction cones."""


def coulomb_by_cones(W: np.ndarray, q: np.ndarray, mu: np.ndarray, solver: ConeSolver) -> np.ndarray:
    """Impulses (3 m,) by Coulomb's law: the fixed point of programmes whose normal rates are raised by μ ‖u_T‖.

    SimulationError if it is not found.
    """
    raised, size = np.zeros(mu.size), 1.0 + np.abs(q).max(initial=0.0)
    for _ in range(MOST_PROGRAMMES):
        given = q.copy()
        given[::3] += raised
        r = np.asarray(solver(W, given, mu), dtype=float)
        u = (W @ r + q).reshape(-1, 3)
        before, raised = raised, mu * np.hypot(u[:, 1], u[:, 2])
        if np.abs(raised - before).max(initial=0.0) <= FIXED * size:
            return r
    raise SimulationError(f"{MOST_PROGRAMMES} cone programmes do not lead to a fixed point of Coulomb's law.")


def _cones(mu: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rows of r ≥ 0 of normals, and of (μ r_N, r_T) of contacts."""
    normals = -np.eye(3 * mu.size)[::3]
    return normals, -np.diag(np.stack([mu, np.ones_like(mu), np.ones_like(mu)], axis=1).ravel())


def _clarabel(W: np.ndarray, q: np.ndarray, mu: np.ndarray) -> np.ndarray:
    with extra():
        import clarabel
    from scipy.sparse import csc_matrix, triu

    normals, cones = _cones(mu)
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = ACCURACY
    kinds = [clarabel.NonnegativeConeT(mu.size), *[clarabel.SecondOrderConeT(3)] * mu.size]
    rows = csc_matrix(np.concatenate([normals, cones]))
    found = clarabel.DefaultSolver(
        triu(csc_matrix(W), format="csc"), q, rows, np.zeros(4 * mu.size), kinds, settings
    ).solve()
    if found.status not in (clarabel.SolverStatus.Solved, clarabel.SolverStatus.AlmostSolved):
        raise SimulationError(f"clarabel: {found.status}.")
    return np.array(found.x)


def _scs(W: np.ndarray, q: np.ndarray, mu: np.ndarray) -> np.ndarray:
    with extra():
        import scs
    from scipy.sparse import csc_matrix, triu

    normals, cones = _cones(mu)
    data = {
        "P": triu(csc_matrix(W), format="csc"),
        "A": csc_matrix(np.concatenate([normals, cones])),
        "b": np.zeros(4 * mu.size),
        "c": q,
    }
    kinds = {"l": mu.size, "q": [3] * mu.size}
    found = scs.SCS(data, kinds, verbose=False, eps_abs=ACCURACY, eps_rel=ACCURACY).solve()
    if found["info"]["status"] not in ("solved", "solved (inaccurate - reached max_iters)"):
        raise SimulationError(f"scs: {found['info']['status']}.")
    return found["x"]


CONE_SOLVERS: dict[str, Callable] = {"clarabel": _clarabel, "scs": _scs}
