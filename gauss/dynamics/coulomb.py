"""Forces of contacts and grips over a step: what pushes, rubs and holds, so that the rates after the step obey every law.

Rates after the step are u = W f + b with the forces f of the step, where W = h J M⁻¹ Jᵀ, and b are the rates without them:

    a gap           f ≥ 0,      u ≥ 0,  f u = 0;
    with friction   the same along the normal, and across it |f_t| ≤ μ f_n, f_t = −μ f_n u_t/|u_t| while it slides;
    a grip          |f| ≤ limit,  f = −limit · sign u while it slips.

Each law says that a force is the projection of f − u/w on what it may be; friction is projected on a disc of the radius
μ (f_n − u_n/w_n)⁺. Newton's method solves these equations (Alart, Curnier, Comput. Methods Appl. Mech. Eng. 92, 1991), and
sweeps of single contacts (Jourdan, Alart, Jean 1998) bring it near where it does not get there by itself. Coulomb's law is
the minimum of no function and may have no answer. Then the convex step is taken (Anitescu 2006), which is the minimum of
½ fᵀ W f + bᵀ f over the cones of friction: it always has one, but its contacts open a little while they slide.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from gauss.errors import SimulationError

SETTLED = 1e-10  # m/s, rad/s, times 1 + the largest rate: error of the laws that is aimed at
ACCEPTED = 1e-7  # the same: error that is taken where many contacts of one body share its forces
SWEEPS = (0, 30, 30, 100, 300, 1000)  # of single contacts, before each round of Newton steps
NEWTON = 15  # steps in a round
DESCENTS, CONVEX = 20_000, 1e-6  # of the convex step, and its error, as ACCEPTED
FLAT = 1e-14  # of the largest diagonal: a row of W that is smaller is no row


class Laws(NamedTuple):
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
class Settling:
    """Problem of one step.

    Parameters
    ----------
    W, b : ndarray
        Slopes (n, n) and values (n,) of the rates after the step.
    laws : Laws
        What the forces obey.
    """

    W: np.ndarray
    b: np.ndarray
    laws: Laws

    def solve(self, start: np.ndarray) -> tuple[np.ndarray, float | None]:
        """Forces (n,) that obey the laws, and their error [m/s, rad/s]; None: they are those of the convex step.

        Raises
        ------
        SimulationError
            If neither is found.
        """
        if not start.size:
            return start, 0.0
        scale = 1.0 + np.abs(self.b).max()
        f, best, least = start, start, np.inf
        for sweeps in SWEEPS:
            f = self._swept(best, sweeps)
            for _ in range(NEWTON):
                error, slope = self._errors(f)
                off = np.abs(error * self.sizes).max()
                best, least = (f, off) if off < least else (best, least)
                if least <= SETTLED * scale:
                    return best, least
                f = f + np.linalg.lstsq(slope, -error, rcond=None)[0]
        return (best, least) if least <= ACCEPTED * scale else (self._convex(start), None)

    @cached_property
    def sizes(self) -> np.ndarray:
        """Diagonal of W, one number for both directions of a contact (n,)."""
        w = self.W.diagonal().copy()
        w[self.laws.across] = w[self.laws.across].max(axis=1, keepdims=True, initial=0.0)
        return np.maximum(w, FLAT * w.max(initial=1e-300))

    def _errors(self, f):
        """What the laws leave (n,), as forces, and its slopes (n, n)."""
        W, laws, w, one = self.W, self.laws, self.sizes, np.eye(f.size)
        u = W @ f + self.b
        pushed, V = f - u / w, W / w[:, None]
        error, slope = u / w, V.copy()
        apart = laws.normal[pushed[laws.normal] <= 0.0]
        error[apart], slope[apart] = f[apart], one[apart]
        for (i, j), n, mu in zip(laws.across, laws.under, laws.friction, strict=True):
            t, radius = [i, j], mu * max(pushed[n], 0.0)
            size = np.hypot(*pushed[t])
            if not radius:
                error[t], slope[t] = f[t], one[t]
            elif size > radius:
                along = pushed[t] / size
                error[t] = f[t] - radius * along
                turning = radius / size * (np.eye(2) - np.outer(along, along)) @ (one[t] - V[t])
                slope[t] = one[t] - turning - mu * np.outer(along, one[n] - V[n])
        slips = laws.grip[np.abs(pushed[laws.grip]) > laws.limit]
        limits = laws.limit[np.isin(laws.grip, slips)]
        error[slips], slope[slips] = f[slips] - np.sign(pushed[slips]) * limits, one[slips]
        return error, slope

    def _swept(self, f: np.ndarray, times: int) -> np.ndarray:
        """Forces after sweeps in which each contact and grip in turn obeys its law, the others given."""
        f, W, laws, w = f.copy(), self.W, self.laws, self.sizes
        for _ in range(times):
            for n in laws.normal:
                f[n] = max(0.0, f[n] - (W[n] @ f + self.b[n]) / w[n])
            for t, n, mu in zip(laws.across, laws.under, laws.friction, strict=True):
                f[t] = _in_disc(f[t] - (W[t] @ f + self.b[t]) / w[t], mu * f[n])
            for g, limit in zip(laws.grip, laws.limit, strict=True):
                f[g] = np.clip(f[g] - (W[g] @ f + self.b[g]) / w[g], -limit, limit)
        return f

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


def _in_disc(x: np.ndarray, radius: float) -> np.ndarray:
    size = np.hypot(*x)
    return x if size <= radius else radius / size * x
