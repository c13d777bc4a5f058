"""Derivatives of accelerations and of inverse dynamics: ∂q̈ = M⁻¹ (∂r + …) on the constraints, by residuals at fixed q̈ and λ.

With the equations of motion r(q, v, q̈, λ) = 0 and the constraints g(q, v, q̈) = 0, a small change of q or v leaves a
residual at fixed q̈ and λ; the change of q̈ that removes it is the derivative (Carpentier and Mansard, Analytical derivatives
of rigid body dynamics algorithms, RSS 2018). Residuals are differentiated on the traced graph, without finite differences;
those of trees without forces on bodies by composite bodies, with half of the operations.
"""

import numpy as np

from gauss import math
from gauss.codegen import LDLT, Scalar, as_number, forward, write
from gauss.dynamics.composite_bodies import CompositeBodies
from gauss.dynamics.constraint_leak import LARGEST_LEAK, REFUSED_LEAK, constraint_leak, may_leak, refused_where_leaking
from gauss.dynamics.error_scale import ACCELERATION_TOLERANCE, acceleration_scale
from gauss.dynamics.mechanism import Mechanism, inverse_dynamics, loop_constraint_scales
from gauss.dynamics.rigid_loops import refused_in_other_pose
from gauss.dynamics.rnea import KinematicTree
from gauss.dynamics.traced_refinement import refined_motion
from gauss.dynamics.traced_system import applied_loads
from gauss.errors import SimulationError
from gauss.system import State, System, coordinate_rates, whole


class LoadedMechanism:
    """A system in one state under its loads, over symbols.

    ``loads``: its loads, with traced laws. ``q``, ``v``, ``load`` (n_q,), (n_v,), (n_v,): coordinates, rates, generalised
    forces added to the loads. ``subsystems``: subsystems of another stage of the reduction; those of the system when not
    given.
    """

    def __init__(self, system: System, loads, t: Scalar, q, v, load, subsystems=None):
        own, self.forces, _ = applied_loads(system, loads, State(t, q, v))
        self.system, self.q, self.v, self.effort = system, q, v, own + load
        self.mechanism = Mechanism(system, q, v, t, subsystems)

    def motion(self) -> tuple[np.ndarray, np.ndarray]:
        """Accelerations (n_v,) and multipliers (m,); not numbers where a loop that cannot move has another pose."""
        rates, multipliers = self.mechanism.motion(self.effort, self.forces)
        return refused_in_other_pose(self.system, self.q, rates), multipliers

    def accelerations(self, pattern: System | None = None) -> np.ndarray:
        """Accelerations (n_v,) alone, as of :meth:`motion`; refined where bodies of loops are unlike, else not numbers.

        ``pattern``: a system of numbers, where those of this one are symbols.
        """
        found, pattern = self.motion()[0], pattern or self.system
        if not may_leak(pattern):
            return found
        state = State(self.mechanism.t, self.q, self.v)
        refined = refined_motion(self.system, state, self.effort, self.forces)[0]
        size = acceleration_scale(pattern) + np.abs(refined.rates / pattern.scale.coordinates).sum()
        off = np.abs(refined.residual / loop_constraint_scales(pattern)).sum()
        leak = constraint_leak(pattern, self.mechanism)
        other = math.where(leak <= REFUSED_LEAK, found, np.nan)
        other = math.where(off <= ACCELERATION_TOLERANCE * size, refined.rates, other)
        return math.where(leak <= LARGEST_LEAK, found, other)

    def residual(self, rates, multipliers) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Residuals of the equations of motion (n_v,) and of the loop constraints (m,), and all accelerations (n_v,)."""
        motion, violation = self.mechanism.residual(rates, multipliers, self.effort, self.forces)
        return motion, violation, self.mechanism.dependent_accelerations(rates)

    def changes(self, rates, multipliers, directions) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """Changes along directions, at fixed accelerations (n_v,) and multipliers (m,), symbols or numbers.

        Directions are displacements along the rates (n_v,), and changes of the rates (n_v,). For each the change of the
        residual of the equations of motion (n_v,), of the loop constraints (m,), and of dependent accelerations (n_v,).
        """
        parts = self.residual(rates, multipliers)
        moving = np.concatenate([self.q, self.v])
        along = [np.concatenate([coordinate_rates(self.system, self.q, dq), dv]) for dq, dv in directions]
        outputs, ends = np.concatenate(parts), np.cumsum([part.size for part in parts])[:-1]
        changes = (np.split(forward(outputs, moving, direction), ends) for direction in along)
        return [(force, rows, following) for force, rows, following in changes]


def acceleration_derivatives(system: System, loads, t: Scalar, q, v, load) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Derivatives of the accelerations by displacements along the rates, rates and generalised forces, each (n_v, n_v).

    Not numbers where a loop that cannot move has another pose than in the scene, and where elimination loses digits.
    """
    n, loaded = system.n_v, LoadedMechanism(system, loads, t, q, v, load)
    unit, zero = np.eye(n), np.zeros(n)
    composites = None if loaded.forces else _composite_bodies(system, q, v)
    if composites is not None:
        M = _factored(system, composites.mass_matrix())
        rates = M.solve(loaded.effort - composites.tree.inverse_dynamics(zero))
        by_q, by_v = _of_open_tree(system, composites, loaded.effort, q, v, rates)
        solved = lambda columns: np.array([M.solve(column) for column in columns.T]).T  # noqa: E731
        return solved(-by_q), solved(-by_v), _mirrored(solved(unit))

    rates, multipliers = loaded.motion()
    m = multipliers.size

    def changes(t, q, v, load, rates, multipliers):
        """Changes with accelerations and multipliers as inputs, which are fixed."""
        inner = LoadedMechanism(system, loads, t[0], q, v, load)
        found = inner.changes(rates, multipliers, [*((e, zero) for e in unit), *((zero, e) for e in unit)])
        return tuple(np.array(part, dtype=object).T for part in zip(*found, strict=True))

    table = write(changes, 1, q.size, n, n, n, m, name="changes").inlined([t], q, v, load, rates, multipliers)
    motion, violation, following = np.split(table, np.cumsum([2 * n * n, 2 * n * m]))
    X = _mirrored(np.array([loaded.mechanism.response(e, np.zeros(m))[0] for e in unit]).T)
    slopes = X @ motion.reshape(n, 2 * n) + following.reshape(n, 2 * n)
    if m:
        Y = np.array([loaded.mechanism.response(zero, e)[0] for e in np.eye(m)]).T
        slopes = slopes + Y @ violation.reshape(m, 2 * n)
    parts = slopes[:, :n], slopes[:, n:], X
    by_q, by_v, by_load = (
        refused_where_leaking(system, loaded.mechanism, refused_in_other_pose(system, q, part)) for part in parts
    )
    return by_q, by_v, by_load


def inverse_dynamics_derivatives(system: System, loads, t: Scalar, q, v, acceleration) -> tuple[np.ndarray, np.ndarray]:
    """Derivatives of inverse dynamics by displacements along the rates, and by rates, each (n_v, n_v)."""
    own, on_bodies, _ = applied_loads(system, loads, State(t, q, v))
    composites = None if on_bodies else _composite_bodies(system, q, v)
    if composites is not None:
        return _of_open_tree(system, composites, own, q, v, acceleration)
    forces = inverse_dynamics(system, q, v, acceleration, own, on_bodies, t)
    return _slopes(system, forces, q, v)


def _slopes(system: System, forces, q, v) -> tuple[np.ndarray, np.ndarray]:
    """Derivatives (n_v, n_v) of functions (n_v,) of q and v by displacements along the rates, and by rates."""
    unit = np.eye(system.n_v)
    by_q = np.array([forward(forces, q, coordinate_rates(system, q, direction)) for direction in unit]).T
    return by_q, np.array([forward(forces, v, direction) for direction in unit]).T


def _composite_bodies(system: System, q, v) -> CompositeBodies | None:
    """Composite bodies of a tree whose inverse dynamics they differentiate; None for other systems."""
    if system.has_closures:
        return None
    found = CompositeBodies(KinematicTree(whole(system), q, v), v)
    return found if found.has_constant_subspaces else None


def _of_open_tree(system: System, composites: CompositeBodies, own, q, v, acceleration) -> tuple[np.ndarray, np.ndarray]:
    """Derivatives of inverse dynamics under generalised forces (n_v,), functions of q and v."""
    found, loads = composites.inverse_dynamics_derivatives(acceleration), _slopes(system, own, q, v)
    return found[0] - loads[0], found[1] - loads[1]


def _factored(system: System, M: np.ndarray) -> LDLT:
    """Factors of a mass matrix; SimulationError if a joint moves no inertia."""
    still = [name for name, own in zip(system.coordinates, np.diag(M), strict=True) if as_number(own) == 0]
    if still:
        raise SimulationError(
            f"acceleration_derivatives: {', '.join(map(repr, still))}: a joint that moves no inertia has no determined "
            "acceleration; give mass to what it moves."
        )
    return LDLT(M)


def _mirrored(X: np.ndarray) -> np.ndarray:
    """Symmetric matrix by its upper triangle."""
    return np.triu(X) + np.triu(X, 1).T
