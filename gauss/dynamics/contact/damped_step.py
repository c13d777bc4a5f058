"""Stiff damping of joints, implicit in steps of a whole scene, by :mod:`gauss.dynamics.contact.implicit_damping`.

    (M + D) v̇' = M v̇ + d (v_later − v₀),   v̇'ₛ = D⁻¹ y,   v̇' = v̇ − Hₛᵀ y elsewhere,   y = P v̇ₛ

for the first term on the right, with P and H' of :class:`gauss.codegen.kernels.DampedCompliance`; the second one adds
H' d (v_later − v₀). The damping then acts at the rates before the step, with the inertias D.
"""

from typing import NamedTuple

import numpy as np

from gauss.codegen import Entry
from gauss.codegen.kernels import DampedCompliance
from gauss.dynamics.contact.force_responses import ForceResponses
from gauss.dynamics.contact.implicit_damping import ImplicitDamping
from gauss.dynamics.state_terms import StateTerms
from gauss.integrators import Rates
from gauss.system import State


class DampedStep(NamedTuple):
    """Damping of one step, in numbers or expressions.

    Attributes
    ----------
    places : ndarray of int, shape (s,)
        Damped coordinates.
    d, D : ndarray, shape (s,)
        Their damping where it is stiff, else zero; the inertias that it adds.
    P : ndarray, shape (s, s)
        Inverse of D⁻¹ + Hₛₛ; zero where it is not stiff.
    H, rows : ndarray, shape (s, n_v)
        Rows of H and of H' at these.
    stiff : float or Expression
        1 where it is stiff, else 0.
    """

    places: np.ndarray
    d: np.ndarray
    D: np.ndarray
    P: np.ndarray
    H: np.ndarray
    rows: np.ndarray
    stiff: Entry

    def acceleration(self, a) -> np.ndarray:
        """Accelerations (n_v,) with damping, from those with the damping as a load."""
        y = self.P @ a[self.places]
        found = a - y @ self.H
        found[self.places] = y / (self.D + (1.0 - self.stiff)) + (1.0 - self.stiff) * a[self.places]
        return found

    def later(self, found: Rates, v, later) -> Rates:
        """Accelerations and powers at later rates, of a step from rates v; the powers leave the damping out."""
        change, at = later[self.places] - v[self.places], later[self.places]
        acceleration = self.acceleration(found.acceleration) + (self.d * change) @ self.rows
        return Rates(acceleration, found.power - np.array([0.0, 0.0, self.d @ (at * at)]))

    def power_over(self, v, a, h) -> np.ndarray:
        """Mean powers (3,) of the damping over a step of length h from rates v with accelerations a [W]."""
        rates, own = v[self.places], a[self.places]
        return np.array([0.0, 0.0, (self.d * rates + self.D * own) @ (rates + 0.5 * h * own)])


def traced_damping(damping: ImplicitDamping, at: State, H: np.ndarray, h: Entry) -> tuple[np.ndarray, DampedStep | None]:
    """Compliance (n_v, n_v) of a step and its damping, of expressions; None without damping.

    Parameters
    ----------
    damping : ImplicitDamping
        Damping of the system.
    at : State
        Where forces are evaluated.
    H : ndarray, shape (n_v, n_v)
        Compliance without damping.
    h : Expression
        Length of the step [s].
    """
    places, n = damping.places, len(H)
    if not places.size:
        return H, None
    own, s = _inertias(damping, at), places.size
    found = DampedCompliance(n, places, damping.d[places])(np.concatenate([H.ravel(), own, [h]]))
    damped, P, D, stiff = found[: n * n].reshape(n, n), found[n * n : -s - 1].reshape(s, s), found[-s - 1 : -1], found[-1]
    return damped, DampedStep(places, stiff * damping.d[places], D, P, H[places], damped[places], stiff)


class DampedResponses:
    """Responses to forces in one step with damping, in numbers.

    Parameters
    ----------
    damping : ImplicitDamping
        Damping of the system.
    responses : ForceResponses
        Responses of the system without.
    at : State
        Where forces are evaluated.
    h : float
        Length of the step [s].

    Attributes
    ----------
    step : DampedStep or None
        None where it is not stiff.
    """

    def __init__(self, damping: ImplicitDamping, responses: ForceResponses, at: State, h: float):
        self.responses, self.at, self.step, places = responses, at, None, damping.places
        if not places.size:
            return
        self.H = responses.of(at, np.eye(damping.d.size)[places])
        inside = self.H[:, places]
        if not damping.is_stiff_by(inside.diagonal(), h):
            return
        D = damping.inertias(_inertias(damping, at).astype(float), h)
        P = np.linalg.inv(np.diag(1.0 / D) + inside)
        self.solved = P @ self.H
        self.step = DampedStep(places, damping.d[places], D, P, self.H, self.solved / D[:, None], 1.0)

    def of(self, forces: np.ndarray) -> np.ndarray:
        """Accelerations (k, n_v) that generalised forces (k, n_v) add, each by itself."""
        found = self.responses.of(self.at, forces)
        if self.step is None or not len(forces):
            return found
        damped = found - found[:, self.step.places] @ self.solved
        damped[:, self.step.places] = forces @ self.step.rows.T
        return damped


def _inertias(damping: ImplicitDamping, at: State) -> np.ndarray:
    """Entries (s,) of the mass matrix of the tree on its diagonal, of damped coordinates."""
    M = StateTerms(damping.smooth, at.q, at.v, at.t).tree_mass_matrix
    return M.diagonal()[damping.places]
