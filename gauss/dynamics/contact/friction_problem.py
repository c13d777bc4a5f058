"""Contact problem of one step with friction, as solvers of such problems exchange it.

    u = W r + q,   K*_μ ∋ u + μ ‖u_T‖ n  ⊥  r ∈ K_μ,   K_μ = {r : ‖r_T‖ ≤ μ r_N}

with impulses r, per contact in the frame of its normal and two tangents (De Saxcé, Feng 1991; Acary, Brogliato, Numerical
Methods for Nonsmooth Dynamical Systems, 2008, 3.7). The rates u are those after the step, less the least that gaps may have;
W is the Delassus operator, which does not depend on the step but by stiff damping of joints.
"""

from collections.abc import Callable
from typing import NamedTuple, Protocol

import numpy as np

from gauss.dynamics.contact.contact_step import ContactLaws, ContactProblem
from gauss.dynamics.contact.convex_relaxation import on_cones
from gauss.errors import BackendError, SimulationError, did_you_mean, extra
from gauss.shapes import Shaped

OWN = "gauss"  # name of our solver
MOST_PROGRAMMES = 300  # of the fixed point
FIXED = 1e-10  # relative: change of the tangential rates that ends it
ACCURACY = 1e-12  # of a programme


class ConeSolver(Protocol):
    """Solver of one programme."""

    def __call__(self, W: np.ndarray, q: np.ndarray, mu: np.ndarray) -> np.ndarray:
        """Impulses (3 m,) that minimise ½ rᵀ W r + qᵀ r over the friction cones."""


class FrictionProblem(NamedTuple):
    """Contact problem of one step.

    Attributes
    ----------
    W : ndarray, shape (3 m, 3 m)
        Delassus operator [1/kg], rows of a contact: normal, two tangents.
    q : ndarray, shape (3 m,)
        Rates after the step without impulses, less the least that gaps may have [m/s, rad/s].
    mu : ndarray, shape (m,)
        Coefficients of friction.
    names : tuple of str
        Contact, stop or rope of each gap.
    """

    W: Shaped[np.ndarray, "3*m 3*m"]
    q: Shaped[np.ndarray, " 3*m"]
    mu: Shaped[np.ndarray, " m"]
    names: tuple[str, ...]

    def residual(self, r: np.ndarray) -> float:
        """Largest distance of impulses from their projection by the laws, as a rate [m/s].

        Parameters
        ----------
        r : ndarray, shape (3 m,)
            Impulses [N s].
        """
        r, u = r.reshape(-1, 3), (self.W @ r + self.q).reshape(-1, 3)
        size = np.maximum(self.W.diagonal().reshape(-1, 3).max(axis=1), np.finfo(float).tiny)[:, None]
        moved = r - u / size
        moved[:, 0] -= self.mu * np.hypot(*u[:, 1:].T) / size[:, 0]
        found = np.column_stack(on_cones(moved[:, 0], moved[:, 1:], self.mu))
        return float((size[:, 0] * np.linalg.norm(r - found, axis=1)).max(initial=0.0))

    def solve(self, solver: str | ConeSolver | Callable = OWN) -> Shaped[np.ndarray, " 3*m"]:
        """Impulses (3 m,) [N s].

        Parameters
        ----------
        solver : str or callable
            ``"gauss"``: Newton's method of time stepping; ``"clarabel"`` or ``"scs"``, or any function of (W, q, μ) that
            returns the minimiser of ½ rᵀ W r + qᵀ r over the friction cones: with it the fixed point q_N + μ ‖u_T‖ is
            found (Acary, Cadoux, Lemaréchal, Malick, ZAMM 91, 2011).

        Raises
        ------
        BackendError
            If there is no such solver.
        SimulationError
            If no impulses are found.
        """
        if solver == OWN:
            return self._by_newton()
        if isinstance(solver, str):
            if solver not in CONE_SOLVERS:
                raise BackendError(f"no solver {solver!r} of contact problems. {did_you_mean(solver, [OWN, *CONE_SOLVERS])}")
            solver = CONE_SOLVERS[solver]
        return coulomb_by_cones(self.W, self.q, self.mu, solver)

    def _by_newton(self) -> np.ndarray:
        m = self.mu.size
        rough = np.flatnonzero(self.mu)
        order = np.concatenate([3 * np.arange(m), (3 * rough[:, None] + [1, 2]).ravel()]).astype(int)
        across, nothing = m + np.arange(2 * rough.size).reshape(-1, 2), np.zeros(0)
        laws = ContactLaws(np.arange(m), across, rough, self.mu[rough], nothing.astype(int), nothing)
        found, error = ContactProblem(self.W[np.ix_(order, order)], self.q[order], laws).solve(np.zeros(order.size))
        if error is None:
            raise SimulationError("no impulses are found that obey Coulomb's law; those of its convex relaxation exist.")
        r = np.zeros(3 * m)
        r[order] = found
        return r


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
