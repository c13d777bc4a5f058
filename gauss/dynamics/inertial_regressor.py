"""Inertial regressor Y(q, v, q̈): inverse dynamics of the bodies as Y π, linear in ten standard parameters π of each body.

With mass m, first moments h = m c and inertia I about the origin of the body frame, in its axes, a body with angular
velocity ω, angular acceleration α and acceleration a of this origin, less gravity, takes the wrench

    moment = h × a + I α + ω × I ω,    force = m a + α × h + ω × (ω × h),

which the transposed Jacobian of the body frame carries to the rates (Atkeson, An, Hollerbach, Estimation of inertial
parameters of manipulator loads and links, IJRR 5(3), 1986). With the Jacobian of independent rates, J N, it is projected on
the constraints: the forces of loops drop out.
"""

import numpy as np

from gauss.dynamics.rnea import square
from gauss.dynamics.state_terms import StateTerms
from gauss.rotations import cross, skew

STANDARD = ("mass", "mx", "my", "mz", "Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz")


def inertial_regressor(terms: StateTerms, acceleration) -> np.ndarray:
    """Y (k, 10 n) for n bodies, over symbols.

    ``terms``: terms of a state; for independent coordinates, Y is projected on them. ``acceleration`` (n_v,): accelerations
    of all joints; for independent coordinates the others are replaced by those of the constraints.
    """
    tree, system = terms.tree, terms.system
    links = tree.accelerations(terms.allowed_acceleration(acceleration))
    columns = []
    for body, name in enumerate(system.structure.bodies):
        R, p = terms.in_link_frame(system.frame(name))
        omega, (alpha, linear) = tree.omegas[body], np.split(links[body], 2)
        at_origin = linear + cross(alpha, p) + square(omega) @ p
        columns.append(terms.jacobian(name, "local").T @ _wrenches(R.T @ omega, R.T @ alpha, R.T @ at_origin))
    return np.concatenate(columns, axis=1)


def _wrenches(omega, alpha, linear) -> np.ndarray:
    """Wrenches (6, 10), moment and force, of a unit of each parameter of a body, in its axes."""
    found = np.zeros((6, len(STANDARD)), dtype=object)
    found[3:, 0] = linear
    found[:3, 1:4], found[3:, 1:4] = -skew(linear), skew(alpha) + square(omega)
    found[:3, 4:] = _turning(alpha) + skew(omega) @ _turning(omega)
    return found


def _turning(omega) -> np.ndarray:
    """Matrix (3, 6) of the product I ω as a function of (Ixx, Iyy, Izz, Ixy, Ixz, Iyz)."""
    x, y, z = omega
    return np.array([[x, 0.0, 0.0, y, z, 0.0], [0.0, y, 0.0, x, 0.0, z], [0.0, 0.0, z, 0.0, x, y]], dtype=object)
