"""Multipliers λ of all constraints of many states at once, in machine code: Φ a − Φ a_free = −Aᵀ λ, body by body.

The articulated-body algorithm of the whole system, with its loops, gives q̈ and the multipliers of the loop constraints,
refined once. The wrench that a joint of the tree transmits is the sum over the bodies beyond it of inertia less loads and
loops (recursive Newton–Euler algorithm: Luh, Walker, Paul 1980). Bodies are those of the scene, unreduced.
"""

from functools import partial

import numpy as np

from gauss.codegen import Function, Interface, batch_code, write
from gauss.dynamics.assemble import relation_rows
from gauss.dynamics.error_scale import acceleration_scale
from gauss.dynamics.inverse_dynamics_residual import along_rates, body_residuals, joint_sides_of
from gauss.dynamics.kinematics import Kinematics, kinematics
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.loads import Applied
from gauss.dynamics.mechanism import Mechanism
from gauss.dynamics.mobility import mobility_at_start
from gauss.dynamics.store import cached, cached_on_disk
from gauss.dynamics.traced_system import largest
from gauss.rotations import cross
from gauss.system import State, System, whole

LEAST_PIVOT = 1e-5  # of S, 1 for a row as on free bodies: below, multipliers lose digits
LARGEST_CHANGE = 1e-8  # of q̈ and of the loop multipliers by one refinement, which leaves about the square of it


def are_unique(system: System) -> bool:
    """Whether the state determines all multipliers: no redundant rows, contacts, set-valued elements, losses."""
    if system.contacts.placed or system.set_valued.placed or system.losses or not system.n_v:
        return False
    found = mobility_at_start(system)
    return not found.redundant and not found.is_singular


def sample_multipliers(system: System, t, q, v) -> tuple[np.ndarray, np.ndarray] | None:
    """Multipliers (k, r) of all constraints at k states t (k,), q (k, n_q), v (k, n_v), and whether they are certain (k,).

    None where they are not unique, or a law of a load cannot be traced.
    """
    laws = Laws(system)
    if laws.called or not are_unique(system):
        return None
    interface = Interface({"q": system.n_q, "v": system.n_v}, "t", (LARGEST_CHANGE, 1.0 / LEAST_PIVOT))
    key = batch_code, sample_multipliers, laws.key
    make = lambda: batch_code(_written(system, laws), interface)  # noqa: E731
    run = cached(system, key, lambda: cached_on_disk(system, key, make).entry())
    found, errors = np.empty((len(t), system.structure.n_rows)), np.empty((len(t), 2))
    run(len(t), [np.ascontiguousarray(part, dtype=float) for part in (q, v, t)], [found, errors])
    return found, np.logical_and.reduce(errors <= interface.limits, axis=1)


def _written(system: System, laws: Laws) -> Function:
    """Function (q, v, t) → multipliers (r,), and measures of their error."""
    return write(partial(multipliers_of, system, laws.traced), system.n_q, system.n_v, 1, name="multipliers")


def multipliers_of(system: System, loads, q, v, t):
    """Multipliers (r,) of all constraints in a state, over symbols, and measures of their error."""
    motion = kinematics(system, State(t[0], q, v))
    applied = Applied(motion, loads)
    mechanism = Mechanism(system, q, v, t[0], (whole(system),))
    forces = applied.on_bodies(motion)
    rates, y = mechanism.motion(applied.P, forces)
    change, less = mechanism.response(*mechanism.residual(rates, y, applied.P, forces))
    rates, y, scale = rates + change, y + less, mechanism.scale
    size = largest(rates / system.scale.coordinates) + acceleration_scale(system)
    error = np.abs(change / system.scale.coordinates).sum() / size
    if y.size:  # multipliers over the scales of their rows have a common unit
        error = error + np.abs(less / scale).sum() / (
            np.abs(y / scale).sum() + system.scale.mass * acceleration_scale(system)
        )
    pivots = sum((1.0 / pivot for pivot in mechanism.pivots), 0.0 * t[0])
    return _rows(motion, applied, mechanism, rates, y), [error, pivots]


def _rows(motion: Kinematics, applied: Applied, mechanism: Mechanism, rates, y) -> np.ndarray:
    """Multipliers (r,) of all constraints from accelerations and the multipliers of the loop constraints."""
    system, found = motion.system, np.zeros(motion.system.structure.n_rows, dtype=object)
    wrenches, constraints = body_residuals(motion, applied, rates), motion.system.structure.constraints

    def act(body: int, moment, force):
        if body >= 0:
            wrenches[body] = wrenches[body][0] + moment, wrenches[body][1] + force

    place = 0
    for loop in mechanism.bodies[0].loop_joints:
        size, joint, at = loop.held.shape[1], loop.joint, motion.joints[loop.index]
        axes = motion.R[joint.parent] @ joint.R_parent
        own = loop.free @ applied.P[joint.v] - loop.held @ y[place : place + size]
        moment, force = axes @ own[:3], axes @ own[3:]  # of the parent on the child, about the joint point
        act(joint.child, moment + cross(at.r, force), force)
        act(joint.parent, -moment - cross(at.s, force), -force)
        found[constraints[loop.index].rows] = -np.concatenate([moment, force])
        place += size
    for constraint in constraints[len(system.joints) :]:
        size = constraint.rows.stop - constraint.rows.start
        found[constraint.rows] = y[place : place + size]
        place += size
    for (constraint, rows), relation in zip(relation_rows(motion), system.relations.placed, strict=True):
        for body, A in zip(relation.bodies, rows.A, strict=True):
            moment, force = np.split(-A.T @ found[constraint.rows], 2)
            act(body, motion.R[body] @ moment, force)
    along_rates(motion, wrenches)  # adds those of outer bodies
    for edge in system.structure.tree:
        joint, at = system.joints[edge.constraint], motion.joints[edge.constraint]
        sign, _, arm = joint_sides_of(edge, joint, at)
        moment, force = wrenches[edge.outer]
        found[constraints[edge.constraint].rows] = sign * np.concatenate([moment - cross(arm, force), force])
    return found
