"""Stiff damping of joints in a step of time stepping, implicit: no step is too long for it.

    −d (v₀ + θ h v̇),   θ = max(½, 1 − M/(h d)),   so that (M + θ h d) v̇ = τ − d v₀,   M + θ h d = max(M + ½ h d, h d)

θ = ½ is the midpoint rule, of order 2; where the rate would change its sign by damping alone, θ is as large as lets it stop.
Inertias M are the diagonal entries of the mass matrix. Damping that is not stiff is a load as others are.

In steps of a whole scene, the accelerations v̇ with the damping as a load become

    (M + D) v̇' = M v̇ + d (v_later − v₀),   v̇'ₛ = D⁻¹ y,   v̇' = v̇ − Hₛᵀ y elsewhere,   y = P v̇ₛ

for the first term on the right, with P and H' of :class:`gauss.codegen.kernels.DampedCompliance`; the second one adds
H' d (v_later − v₀). The damping then acts at the rates before the step, with the inertias D.
"""

from typing import NamedTuple

import numpy as np

from gauss.codegen import Entry
from gauss.codegen.kernels import STIFF_DAMPING, DampedCompliance, implicit_inertia
from gauss.dynamics.contact.force_responses import ForceResponses
from gauss.dynamics.contact.mechanism_kernels import MechanismTerms
from gauss.dynamics.state_terms import StateTerms
from gauss.integrators import Rates
from gauss.scene import JointSpring
from gauss.system import State, System


def damping_of_joints(smooth: System) -> np.ndarray:
    """Damping d (n_v,) of the joints of the spanning tree by springs of joints [N m s/rad, N s/m]."""
    found, in_tree = np.zeros(smooth.n_v), {edge.constraint for edge in smooth.structure.tree}
    columns = [column for k in in_tree for column in range(smooth.joints[k].v.start, smooth.joints[k].v.stop)]
    for load in smooth.scene.loads.values():
        if isinstance(load, JointSpring) and smooth.column(load.joint) in columns:
            found[smooth.column(load.joint)] += load.damping
    return found


class ImplicitDamping:
    """Implicit damping of one system.

    Parameters
    ----------
    smooth : System
        The system without unilateral and set-valued elements.
    """

    def __init__(self, smooth: System):
        self.smooth, self.d = smooth, damping_of_joints(smooth)
        self.places = np.flatnonzero(self.d)

    def is_stiff(self, H: np.ndarray, h: float) -> bool:
        """Whether a step of length h makes it implicit, by the compliance without it."""
        return self.is_stiff_by(H.diagonal()[self.places], h)

    def is_stiff_by(self, own: np.ndarray, h: float) -> bool:
        """The same by the entries (s,) of the compliance on its diagonal, of damped coordinates."""
        return bool(h * (self.d[self.places] @ own) > STIFF_DAMPING)

    def inertias(self, own: np.ndarray, h: float) -> np.ndarray:
        """Inertias θ h d (s,) that a step adds to those of the damped coordinates, from these."""
        damped = h * self.d[self.places]
        return np.array([implicit_inertia(M, hd, max) - M for M, hd in zip(own, damped, strict=True)])

    def added(self, terms: MechanismTerms, h: float) -> np.ndarray:
        """Inertias θ h d (n_v,) that a step adds to those of the mechanism."""
        found = np.zeros(self.d.size)
        found[self.places] = self.inertias(terms.M.diagonal()[self.places], h)
        return found

    def power_at(self, v: np.ndarray) -> np.ndarray:
        """Powers (3,) as of :attr:`MechanismTerms.power` of the damping at rates v [W]."""
        return np.array([0.0, 0.0, self.d @ (v * v)])

    def power_over(self, v: np.ndarray, added: np.ndarray, acceleration: np.ndarray, h: float) -> np.ndarray:
        """Mean powers (3,) of the damping over a step of length h from rates v [W]: its force acts along the mean rates."""
        force, middle = self.d * v + added * acceleration, v + 0.5 * h * acceleration
        return np.array([0.0, 0.0, force @ middle])


class DampedStep(NamedTuple):
    """Damping of one step, in numbers or expressions."""

    places: np.ndarray  # (s,) damped coordinates
    d: np.ndarray  # (s,) their damping where it is stiff, else zero
    D: np.ndarray  # (s,) inertias that it adds
    P: np.ndarray  # (s, s) inverse of D⁻¹ + Hₛₛ; zero where it is not stiff
    H: np.ndarray  # (s, n_v) rows of H at these
    rows: np.ndarray  # (s, n_v) rows of H' at these
    stiff: Entry  # 1 where it is stiff, else 0

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
