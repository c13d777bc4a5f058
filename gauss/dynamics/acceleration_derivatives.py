"""Derivatives of accelerations and of inverse dynamics: ∂q̈ = M⁻¹ (∂r + …) on the constraints, by residuals at fixed q̈ and λ.

With the equations of motion r(q, v, q̈, λ) = 0 and the constraints g(q, v, q̈) = 0, a small change of q or v leaves a
residual at fixed q̈ and λ; the change of q̈ that removes it is the derivative (Carpentier and Mansard, Analytical derivatives
of rigid body dynamics algorithms, RSS 2018). Residuals are differentiated on the traced graph, without finite differences.
"""

import numpy as np

from gauss.codegen import Scalar, forward, write
from gauss.dynamics.mechanism import Mechanism, inverse_dynamics
from gauss.dynamics.traced_system import applied_loads
from gauss.system import State, System, coordinate_rates


class LoadedMechanism:
    """A system in one state under its loads, over symbols.

    Parameters
    ----------
    system : System
        The system.
    loads : sequence of BoundLoad
        Its loads, with traced laws.
    t : Expression or float
        Time [s].
    q, v, load : ndarray, shape (n_q,), (n_v,), (n_v,)
        Coordinates, rates, generalised forces added to the loads.
    """

    def __init__(self, system: System, loads, t: Scalar, q, v, load):
        own, self.forces, _ = applied_loads(system, loads, State(t, q, v))
        self.system, self.q, self.v, self.effort = system, q, v, own + load
        self.mechanism = Mechanism(system, q, v, t)

    def motion(self) -> tuple[np.ndarray, np.ndarray]:
        """Accelerations (n_v,) and multipliers (m,)."""
        return self.mechanism.motion(self.effort, self.forces)

    def changes(self, rates, multipliers, directions) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """Changes along directions, at fixed accelerations and multipliers, symbols or numbers.

        Parameters
        ----------
        rates, multipliers : ndarray, shape (n_v,), (m,)
            Accelerations and multipliers.
        directions : sequence of (ndarray, ndarray)
            Displacements along the rates (n_v,), and changes of the rates (n_v,).

        Returns
        -------
        list of tuple of ndarray
            For each direction the change of the residual of the equations of motion (n_v,), of the loop constraints (m,),
            and of dependent accelerations (n_v,).
        """
        motion, violation = self.mechanism.residual(rates, multipliers, self.effort, self.forces)
        parts = motion, violation, self.mechanism.dependent_accelerations(rates)
        moving = np.concatenate([self.q, self.v])
        along = [np.concatenate([coordinate_rates(self.system, self.q, dq), dv]) for dq, dv in directions]
        outputs, ends = np.concatenate(parts), np.cumsum([part.size for part in parts])[:-1]
        changes = (np.split(forward(outputs, moving, direction), ends) for direction in along)
        return [(force, rows, following) for force, rows, following in changes]


def acceleration_derivatives(system: System, loads, t: Scalar, q, v, load) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Derivatives of the accelerations by displacements along the rates, rates and generalised forces, each (n_v, n_v)."""
    n, loaded = system.n_v, LoadedMechanism(system, loads, t, q, v, load)
    rates, multipliers = loaded.motion()
    m, unit, zero = multipliers.size, np.eye(n), np.zeros(n)

    def changes(t, q, v, load, rates, multipliers):
        """Changes with accelerations and multipliers as inputs, which are fixed."""
        inner = LoadedMechanism(system, loads, t[0], q, v, load)
        found = inner.changes(rates, multipliers, [*((e, zero) for e in unit), *((zero, e) for e in unit)])
        return tuple(np.array(part, dtype=object).T for part in zip(*found, strict=True))

    table = write(changes, 1, q.size, n, n, n, m, name="changes").inlined([t], q, v, load, rates, multipliers)
    motion, violation, following = np.split(table, np.cumsum([2 * n * n, 2 * n * m]))
    X = np.array([loaded.mechanism.response(e, np.zeros(m))[0] for e in unit]).T
    slopes = X @ motion.reshape(n, 2 * n) + following.reshape(n, 2 * n)
    if m:
        Y = np.array([loaded.mechanism.response(zero, e)[0] for e in np.eye(m)]).T
        slopes = slopes + Y @ violation.reshape(m, 2 * n)
    return slopes[:, :n], slopes[:, n:], X


def inverse_dynamics_derivatives(system: System, loads, t: Scalar, q, v, acceleration) -> tuple[np.ndarray, np.ndarray]:
    """Derivatives of inverse dynamics by displacements along the rates, and by rates, each (n_v, n_v)."""
    own, on_bodies, _ = applied_loads(system, loads, State(t, q, v))
    forces = inverse_dynamics(system, q, v, acceleration, own, on_bodies, t)
    along = [coordinate_rates(system, q, unit) for unit in np.eye(system.n_v)]
    by_q = np.array([forward(forces, q, direction) for direction in along]).T
    return by_q, np.array([forward(forces, v, unit) for unit in np.eye(system.n_v)]).T
