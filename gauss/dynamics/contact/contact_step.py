"""Forces of contacts and grips over a step: what pushes, rubs and holds, so that the rates after the step obey every law.

Rates after the step are u = W f + b with the forces f of the step, where W = h J M⁻¹ Jᵀ, and b are the rates without them:

    a gap           f ≥ 0,      u ≥ 0,  f u = 0;
    with friction   the same along the normal, and across it |f_t| ≤ μ f_n, f_t = −μ f_n u_t/|u_t| while it slides;
    a grip          |f| ≤ limit,  f = −limit · sign u while it slips.

Each law says that a force is the projection of f − u/w on what it may be; friction is projected on a disc of the radius
μ (f_n − u_n/w_n)⁺. Newton's method solves these equations (Alart, Curnier, Comput. Methods Appl. Mech. Eng. 92, 1991), and
sweeps of single contacts (Jourdan, Alart, Jean 1998) bring it near where it does not get there by itself; both are machine
code, the laws and their slopes are traced. Coulomb's law is
the minimum of no function and may have no answer. Then the convex step is taken (Anitescu 2006), which is the minimum of
½ fᵀ W f + bᵀ f over the cones of friction: it always has one, but its contacts open a little while they slide.
"""

from dataclasses import dataclass
from functools import cache, cached_property
from typing import NamedTuple

import numpy as np

from gauss import math
from gauss.codegen import Function, jacobian, write
from gauss.codegen.kernels import ContactSolver, Solve
from gauss.errors import SimulationError

SETTLED = 1e-10  # relative to the scale of the scene, times 1 + the largest rate: error of the laws that is aimed at
ACCEPTED = 1e-7  # the same: error that is taken where many contacts of one body share its forces
SWEEPS = (0, 30, 30, 100, 300, 1000)  # of single contacts, before each round of Newton steps
NEWTON = 15  # steps in a round
DESCENTS, CONVEX = 20_000, 1e-6  # of the convex step, and its error, as ACCEPTED
FLAT = 1e-14  # of the largest diagonal: a row of W that is smaller is no row


class ContactLaws(NamedTuple):
    """Which entries of the forces obey which law.

    Attributes
    ----------
    normal : ndarray of int, shape (m,)
        Forces along normals.
    across : ndarray of int, shape (k, 2)
        Forces of friction, along two directions.
    under : ndarray of int, shape (k,)
        Force along the normal that each of these goes with.
    friction : ndarray, shape (k,)
        Coefficients of friction.
    grip : ndarray of int, shape (g,)
        Forces of grips.
    limit : ndarray, shape (g,)
        Their limits [N m, N].
    """

    normal: np.ndarray
    across: np.ndarray
    under: np.ndarray
    friction: np.ndarray
    grip: np.ndarray
    limit: np.ndarray


@dataclass(frozen=True)
class ContactProblem:
    """Problem of one step.

    Parameters
    ----------
    W, b : ndarray
        Slopes (n, n) and values (n,) of the rates after the step.
    laws : ContactLaws
        What the forces obey.
    """

    W: np.ndarray
    b: np.ndarray
    laws: ContactLaws

    def solve(self, start: np.ndarray) -> tuple[np.ndarray, float | None]:
        """Forces (n,) that obey the laws, and their error, relative as b is; None: they are those of the convex step.

        Raises
        ------
        SimulationError
            If neither is found.
        """
        if not start.size:
            return start, 0.0
        laws = self.laws
        if laws.normal.size and not (laws.normal == np.arange(laws.normal.size)).all():
            raise ValueError("rows of normals come first.")
        f, left = _solver()(self.W, self.b, laws.under, laws.friction, laws.limit, start)
        return (f, left) if left >= 0.0 else (self._convex(start), None)

    @cached_property
    def sizes(self) -> np.ndarray:
        """Diagonal of W, one number for both directions of a contact (n,)."""
        w = self.W.diagonal().copy()
        w[self.laws.across] = w[self.laws.across].max(axis=1, keepdims=True, initial=0.0)
        return np.maximum(w, FLAT * w.max(initial=1e-300))

    def _convex(self, start: np.ndarray) -> np.ndarray:
        """Forces of the convex step, by descent with momentum (Nesterov 1983; O'Donoghue, Candès 2015)."""
        goal, size = CONVEX * (1.0 + np.abs(self.b).max()), np.linalg.eigvalsh(self.W)[-1]
        f = ahead = self._allowed(start)
        momentum = 1.0
        for _ in range(DESCENTS):
            new = self._allowed(ahead - (self.W @ ahead + self.b) / size)
            if np.abs(self._allowed(new - (self.W @ new + self.b) / size) - new).max() * size <= goal:
                return new
            if (ahead - new) @ (new - f) > 0.0:
                momentum = 1.0
            after = 0.5 * (1.0 + np.sqrt(1.0 + 4.0 * momentum * momentum))
            ahead = new + (momentum - 1.0) / after * (new - f)
            f, momentum = new, after
        raise SimulationError("no forces of contacts and grips were found that obey their laws; shorten the step.")

    def _allowed(self, f: np.ndarray) -> np.ndarray:
        """Nearest forces within the cones of friction and the limits of grips."""
        laws, f = self.laws, f.copy()
        smooth = np.setdiff1d(laws.normal, laws.under)
        f[smooth] = np.maximum(f[smooth], 0.0)
        for t, n, mu in zip(laws.across, laws.under, laws.friction, strict=True):
            size = np.hypot(*f[t])
            if size > mu * f[n]:  # outside of the cone: on its surface, or at its tip
                height = max(0.0, (f[n] + mu * size) / (1.0 + mu * mu))
                f[t] = mu * height / size * f[t]
                f[n] = height
        f[laws.grip] = np.clip(f[laws.grip], -laws.limit, laws.limit)
        return f


def pushing(f):
    """Force nearest to f that pushes."""
    return math.maximum(f, 0.0)


def rubbing(across, radius) -> np.ndarray:
    """Forces (2,) nearest to those across that are no larger than a radius."""
    size = math.sqrt(across[0] * across[0] + across[1] * across[1])
    return np.array([math.where(radius > 0.0, math.where(size > radius, radius / size * x, x), 0.0) for x in across])


def holding(f, limit):
    """Force nearest to f within a limit."""
    return math.clip(f, -limit, limit)


@cache
def settle() -> ContactSolver:
    """Machine code of the laws: what they leave is the distance of forces from the projections that they should be."""

    def normal(f, u, w):
        return [f - pushing(f - u / w)]

    def rough(f1, f2, u1, u2, w, f, u, v, friction):
        pushed, radius = np.array([f1 - u1 / w, f2 - u2 / w]), friction * pushing(f - u / v)
        return np.array([f1, f2]) - rubbing(pushed, radius)

    def grip(f, u, w, limit):
        return [f - holding(f - u / w, limit)]

    return ContactSolver(
        _with_slopes(normal, 3, (0, 1)),
        _with_slopes(rough, 9, (0, 1, 5, 2, 3, 6)),
        _with_slopes(grip, 4, (0, 1)),
        write(lambda x: [pushing(x[0])], 1, name="pushing"),
        write(lambda x: rubbing(x[:2], x[2]), 3, name="rubbing"),
        write(lambda x: [holding(*x)], 2, name="holding"),
        SWEEPS,
        NEWTON,
        SETTLED,
        ACCEPTED,
        FLAT,
    )


def _with_slopes(law, size: int, over) -> Function:
    """Function of a vector: what a law leaves, and its slopes over some of what it is given."""

    def both(x):
        errors = law(*x)
        return errors, jacobian(errors, x[list(over)])

    return write(both, size, name=law.__name__)


@cache
def _solver() -> Solve:
    return Solve(settle())
