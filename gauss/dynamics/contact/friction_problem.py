"""Contact problem of one step with friction, as solvers of such problems exchange it.

    u = W r + q,   K*_μ ∋ u + μ ‖u_T‖ n  ⊥  r ∈ K_μ,   K_μ = {r : ‖r_T‖ ≤ μ r_N}

with impulses r, per contact in the frame of its normal and two tangents (De Saxcé, Feng 1991; Acary, Brogliato, Numerical
Methods for Nonsmooth Dynamical Systems, 2008, 3.7). The rates u are those after the step, less the least that gaps may have;
W is the Delassus operator, which does not depend on the step but by stiff damping of joints.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from gauss.dynamics.contact.cone_solvers import CONE_SOLVERS, ConeSolver, coulomb_by_cones
from gauss.dynamics.contact.contact_step import ContactLaws, ContactProblem
from gauss.errors import BackendError, SimulationError, did_you_mean
from gauss.shapes import Shaped

OWN = "gauss"  # name of our solver


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
        u, worst = self.W @ r + self.q, 0.0
        for k, mu in enumerate(self.mu):
            mine = slice(3 * k, 3 * k + 3)
            size = max(self.W.diagonal()[mine].max(), np.finfo(float).tiny)
            moved = r[mine] - u[mine] / size
            moved[0] -= mu * np.hypot(*u[mine][1:]) / size
            worst = max(worst, size * float(np.linalg.norm(r[mine] - on_cone(moved, mu))))
        return worst

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


def on_cone(r: np.ndarray, mu: float) -> np.ndarray:
    """Projection of an impulse (3,) on its friction cone; without friction, on the normal."""
    size = float(np.hypot(r[1], r[2]))
    if r[0] >= 0.0 and size <= mu * r[0]:
        return r
    height = max(0.0, (r[0] + mu * size) / (1.0 + mu * mu))
    across = mu * height / size if size else 0.0
    return np.array([height, across * r[1], across * r[2]])
