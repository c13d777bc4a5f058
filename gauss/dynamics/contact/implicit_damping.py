"""Stiff damping of joints in a step of time stepping, implicit: no step is too long for it.

    −d (v₀ + θ h v̇),   θ = max(½, 1 − M/(h d)),   so that (M + θ h d) v̇ = τ − d v₀,   M + θ h d = max(M + ½ h d, h d)

θ = ½ is the midpoint rule, of order 2; where the rate would change its sign by damping alone, θ is as large as lets it stop.
Inertias M are the diagonal entries of the mass matrix. Damping that is not stiff is a load as others are.
"""

import numpy as np

from gauss.codegen.kernels import STIFF_DAMPING, implicit_inertia
from gauss.dynamics.contact.mechanism_kernels import MechanismTerms
from gauss.scene import JointSpring
from gauss.system import System


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
