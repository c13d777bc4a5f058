"""Assembly of the compulsion: A, B, C, D, Φ, a_free and P of one state.

Rows A v + B q̇ = C of joints, and their derivative A a + B q̈ = D, are six for every pair, about the joint point P fixed in
the child:

    R_c ω_c − R_p ω_p − E_ω q̇ = 0
    ẋ_c + W_c × r − ẋ_p − W_p × s − E_v q̇ = 0
"""

from functools import reduce

import numpy as np

from gauss import math
from gauss.arguments import real_numbers
from gauss.backends.compulsion import Compulsion
from gauss.codegen import Scalar
from gauss.dynamics.constraint_scales import constraint_scales, loop_distance_scales
from gauss.dynamics.gap_functions import with_contacts
from gauss.dynamics.kinematics import JointMotion, Kinematics, kinematics
from gauss.dynamics.loads import Applied
from gauss.errors import StateError, judged_later, require
from gauss.rotations import cross, skew, to_rotation_vector
from gauss.system import PlacedJoint, State, System, refuse_changed


def assemble(system: System, state: State, load=None) -> Compulsion:
    """Compulsion of a system in a state.

    Parameters
    ----------
    system : System
        Made by :func:`gauss.compile_scene`.
    state : State
        Made by ``system.state`` or ``system.initial_state``.
    load : array_like, shape (n_v,), optional
        Generalised forces [N m, N] added to those of the scene.

    Returns
    -------
    Compulsion
        With all matrices, dense and sparse. Its rows G x ≤ h are those of closed unilateral constraints: that touch and do
        not open. With joint friction, limited drives, clutches and gears with losses it is that of the mode of the state:
        sticking elements add rows after those of the system, slipping ones loads against their rates.

    Raises
    ------
    StateError
        If ``load`` has the wrong size.
    SceneError
        If there is friction of contacts, which is no row.
    SimulationError
        If no consistent mode of joint friction is found.
    """
    require(system, (System,), "assemble")
    require(state, (State,), "assemble")
    refuse_changed(system)
    with judged_later():
        of_mode = None if system.dynamics is None else system.dynamics.held(system, state, load)
        if of_mode is not None:
            return of_mode
        motion = kinematics(system, state)
        return with_contacts(motion, assemble_motion(motion, Applied(motion), load))


def assemble_motion(motion: Kinematics, applied: Applied, load=None) -> Compulsion:
    """Compulsion of given kinematics and loads, without unilateral constraints."""
    system = motion.system
    A_blocks, B_blocks, D = [], [], []
    for joint, at in zip(system.joints, motion.joints, strict=True):
        A, B, rows = joint_rows(motion, joint, at)
        A_blocks.append(A)
        B_blocks.append(B)
        D.append(rows)
    for coupling in system.scene.couplings.values():
        A_blocks.append(())
        B_blocks.append((np.ones((1, 1)), np.full((1, 1), -coupling.ratio)))
        D.append(np.zeros(1))
    C = np.zeros(system.structure.n_rows, dtype=motion.state.v.dtype)
    for constraint, rows in relation_rows(motion):
        A_blocks.append(rows.A)
        B_blocks.append(rows.B)
        C[constraint.rows] = rows.C
        D.append(rows.D)
    return Compulsion(
        structure=system.structure,
        Phi=system.Phi,
        impressed=impressed(motion, applied),
        P=applied.P + checked_load(system, load),
        A_blocks=tuple(A_blocks),
        B_blocks=tuple(B_blocks),
        C=C,
        D=np.concatenate(D),
        G=np.zeros((0, system.Phi.size + system.n_v)),
        h=np.zeros(0),
        units=units(system),
        constraint_residual=state_residual(motion) if system.has_closures else 0.0,
    )


def units(system: System) -> np.ndarray:
    """Units (6n + p,) of accelerations: 1 rad, and the length of the scene."""
    return np.concatenate(
        [np.tile(np.repeat([1.0, system.scale.length], 3), len(system.Phi) // 6), system.scale.coordinates]
    )


def state_residual(motion: Kinematics) -> Scalar:
    """Largest residual of the loop constraints, over the row scales: in position, and in velocity relative to the rates."""
    system, scales = motion.system, constraint_scales(motion.system)
    rows = [system.structure.constraints[index].rows for index in system.structure.closures]
    scales = np.concatenate([scales[own] for own in rows])
    fastest = math.maximum(1.0 / system.scale.time, _largest(motion.state.v * (1.0 / system.scale.coordinates)))
    moving = _largest(closure_rates(motion) * (1.0 / scales)) / fastest
    return math.maximum(_largest(closure_distances(motion) * (1.0 / loop_distance_scales(system))), moving)


def _largest(values) -> Scalar:
    sizes = np.abs(values)
    return reduce(math.maximum, sizes, 0.0) if sizes.dtype == object else np.fmax.reduce(sizes, initial=0.0)


def closure_distances(motion: Kinematics) -> np.ndarray:
    """Size of the position residual of every row of a loop constraint [rad, m]."""
    system = motion.system
    joints = [index for index in system.structure.closures if index < len(system.joints)]
    parts = [joint_distance(motion, system.joints[index], motion.joints[index]) for index in joints]
    parts += [np.array([coupling_residual(motion, coupling)]) for coupling in system.scene.couplings.values()]
    return np.concatenate([*parts, *(rows.gap for _, rows in relation_rows(motion))])


def closure_rates(motion: Kinematics) -> np.ndarray:
    """Velocity residual A v + B q̇ − C of every row of a loop constraint; that of tree joints is zero."""
    system, rates = motion.system, motion.state.v
    joints = [index for index in system.structure.closures if index < len(system.joints)]
    parts = [joint_rate_residual(motion, system.joints[index], motion.joints[index]) for index in joints]
    for coupling in system.scene.couplings.values():
        driven, driver = (rates[system.column(name)] for name in (coupling.driven, coupling.driver))
        parts.append(np.array([driven - coupling.ratio * driver]))
    v = motion.quasi_velocities() if system.relations.placed else ()
    for constraint, rows in relation_rows(motion):
        found = -rows.C
        for body, A in zip(constraint.bodies, rows.A, strict=True):
            found = found + A @ v[6 * body : 6 * body + 6]
        for columns, B in zip(constraint.columns, rows.B, strict=True):
            found = found + B @ rates[columns]
        parts.append(found)
    return np.concatenate(parts)


def coupling_residual(motion: Kinematics, coupling) -> Scalar:
    """Residual of a coupling [rad, m]."""
    driven, driver = (motion.coordinate(name) for name in (coupling.driven, coupling.driver))
    return driven - coupling.ratio * driver - coupling.offset


def impressed(motion: Kinematics, applied: Applied) -> np.ndarray:
    """Φ a_free (6n,): Euler's equations in principal axes, Newton's in world axes, without reactions."""
    forces, gravity = np.empty_like(motion.system.Phi, dtype=motion.state.v.dtype), np.array(motion.system.scene.gravity)
    for i in range(motion.system.structure.n_bodies):
        R_transposed = motion.R[i].T
        omega = R_transposed @ motion.W[i]
        J = motion.system.Phi[6 * i : 6 * i + 3]
        forces[6 * i : 6 * i + 3] = R_transposed @ applied.M[i] - cross(omega, J * omega)
        forces[6 * i + 3 : 6 * i + 6] = applied.F[i] + motion.system.Phi[6 * i + 3] * gravity
    return forces


def position_residual(motion: Kinematics) -> np.ndarray:
    """Position residual φ (r,) of all constraints [rad, m]; zero for tree joints and velocity rows."""
    system, constraints = motion.system, motion.system.structure.constraints
    phi: np.ndarray = np.zeros(system.structure.n_rows)
    for index in system.structure.closures:
        rows = constraints[index].rows
        name = constraints[index].name
        if index < len(system.joints):
            phi[rows] = joint_residual(motion, system.joints[index], motion.joints[index])
        elif name in system.scene.couplings:
            phi[rows] = coupling_residual(motion, system.scene.couplings[name])
    for constraint, rows in relation_rows(motion):
        phi[constraint.rows] = rows.gap
    return phi


def relation_rows(motion: Kinematics):
    """Constraint and rows of every relation."""
    constraints = motion.system.structure.constraints
    first = len(constraints) - len(motion.system.relations.placed)
    return zip(constraints[first:], motion.system.relations.rows(motion), strict=True)


def checked_load(system: System, load) -> np.ndarray:
    """Generalised forces (n_v,) of the user, checked; StateError if they have the wrong size, or are not finite."""
    if load is None:
        return np.zeros(system.n_v)
    found = real_numbers(load)
    if found is None or found.shape != (system.n_v,) or not np.isfinite(found).all():
        got = f"{load!r:.80}" if found is None else f"shape {found.shape}"
        raise StateError(f"load: expected {system.n_v} finite numbers ({', '.join(system.coordinates)}), got {got}.")
    return found


ONE = np.eye(3)


def joint_rows(motion: Kinematics, joint: PlacedJoint, at: JointMotion):
    """Blocks of A for the bodies of a joint, block of B, and D (6,)."""
    p, c = joint.parent, joint.child
    blocks = []
    for body, arm, sign in ((p, at.s, -1.0), (c, at.r, 1.0)):
        if body >= 0:
            blocks.append(sign * _block(motion.R[body], arm))
    B = -np.concatenate([at.E_omega, at.E_v])
    rates = motion.state.v[joint.v]
    W_p, W_c = motion.W[p], motion.W[c]
    D_omega = cross(W_p, at.E_omega @ rates) + at.bias_omega
    D_v = cross(W_p, cross(W_p, at.s)) - cross(W_c, cross(W_c, at.r)) + 2.0 * cross(W_p, at.E_v @ rates) + at.bias_v
    return tuple(blocks), (B,), np.concatenate([D_omega, D_v])


def _block(R: np.ndarray, arm: np.ndarray) -> np.ndarray:
    """[R, 0; −[arm]× R, 1]."""
    block = np.zeros((6, 6), dtype=np.result_type(R, arm))
    block[:3, :3], block[3:, :3], block[3:, 3:] = R, -skew(arm) @ R, ONE
    return block


def joint_rate_residual(motion: Kinematics, joint: PlacedJoint, at: JointMotion) -> np.ndarray:
    """Velocity residual A v + B q̇ (6,) of :func:`joint_rows` [rad/s, m/s]."""
    p, c = joint.parent, joint.child
    rates, W_p, W_c = motion.state.v[joint.v], motion.W[p], motion.W[c]
    linear = motion.u[c] + cross(W_c, at.r) - motion.u[p] - cross(W_p, at.s)
    return np.concatenate([W_c - W_p - at.E_omega @ rates, linear - at.E_v @ rates])


def joint_residual(motion: Kinematics, joint: PlacedJoint, at: JointMotion) -> np.ndarray:
    """Pose of the child relative to its pose by parent and coordinates (6,): rotation vector [rad], distance [m]."""
    R_actual = motion.R[joint.child] @ joint.R_child
    angular = to_rotation_vector(R_actual @ at.R_predicted.T)
    return np.concatenate([angular, at.P - motion.x[joint.parent] - at.s])


def joint_distance(motion: Kinematics, joint: PlacedJoint, at: JointMotion) -> np.ndarray:
    """Smooth measure of the same (4,): twice the sine of half the angle, components of the distance."""
    off = (motion.R[joint.child] @ joint.R_child - at.R_predicted).ravel()
    return np.array([np.sqrt(off @ off / 2.0), *(at.P - motion.x[joint.parent] - at.s)])
