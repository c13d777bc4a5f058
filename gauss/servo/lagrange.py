"""Lagrange's equations with servo-constraints: the second route, in tree coordinates, from T and U.

    P_i = d/dt ∂T/∂q̇_i − ∂T/∂q_i,      P_i − Q_i + Σ Λ A + Σ μ W = 0

T and U are formed without the servo relations (substituted before differentiation, they would lose the equations of the
directions that the servos block). Only the kinematics are shared with the assembly of the compulsion.
"""

from typing import NamedTuple

import numpy as np
from scipy.linalg import qr

from gauss.codegen import forward, jacobian, reverse
from gauss.dynamics.coupling_constraints import Couplings
from gauss.dynamics.kinematics import Kinematics
from gauss.dynamics.laws.traced_laws import Laws, needs_poses
from gauss.dynamics.loads import Applied
from gauss.errors import SceneError, require
from gauss.rotations import cross
from gauss.servo.instant import DEPENDENT
from gauss.servo.kernels import ShapedKernel, directions
from gauss.servo.observed import MotionSymbols
from gauss.servo.relation import ScalarRelation, as_relations, rows, scalars
from gauss.servo.servo import Servo
from gauss.shapes import Shaped
from gauss.system import State, System, whole


class LagrangeSolution(NamedTuple):
    """Solution of Lagrange's equations.

    Attributes
    ----------
    qdd : ndarray, shape (n_v,)
        Accelerations.
    efforts : ndarray, shape (j,)
        Efforts of the servos [N, N m].

    Examples
    --------
    >>> import gauss
    >>> from gauss import servo
    >>> held = gauss.load("servo/inverted_pendulum")
    >>> found = servo.lagrange(held, servo.initial_state(held))
    >>> found.qdd.round(4), found.efforts.round(4)
    (array([0., 0.]), array([0.]))
    """

    qdd: Shaped[np.ndarray, " n"]
    efforts: Shaped[np.ndarray, " j"]


class Terms(NamedTuple):
    """Terms of Lagrange's equations at one state: M q̈ = Q − h − AᵀΛ + Wᵀu, A q̈ = D, G q̈ = γ."""

    M: np.ndarray
    force: np.ndarray  # Q − h
    A: np.ndarray
    D: np.ndarray
    G: np.ndarray
    gamma: np.ndarray
    W: np.ndarray


def lagrange(servo: Servo, state: State) -> LagrangeSolution:
    """Accelerations and efforts by Lagrange's equations with multipliers.

    Parameters
    ----------
    servo : Servo
        The servo.
    state : State
        Consistent state.

    Returns
    -------
    LagrangeSolution
        Accelerations and efforts.

    Raises
    ------
    SceneError
        If a coordinate is a quaternion, or a law of a load cannot be traced.

    Examples
    --------
    >>> import gauss
    >>> from gauss import servo
    >>> held = gauss.load("servo/inverted_pendulum")
    >>> state = servo.initial_state(held)
    >>> classical, ours = servo.lagrange(held, state), servo.solve(held, state)
    >>> bool(abs(classical.qdd - ours.qdd).max() < 1e-9)
    True
    """
    terms = _terms(servo, state)
    n, p, j = len(terms.M), len(terms.A), len(terms.W)
    K = np.zeros((n + p + len(terms.G), n + p + j))
    K[:n, :n], K[:n, n : n + p], K[:n, n + p :] = terms.M, terms.A.T, -terms.W.T
    K[n : n + p, :n], K[n + p :, :n] = terms.A, terms.G
    x = np.linalg.lstsq(K, np.concatenate([terms.force, terms.D, terms.gamma]), rcond=DEPENDENT)[0]
    return LagrangeSolution(x[:n], x[n + p :])


def without_multipliers(servo: Servo, state: State) -> np.ndarray:
    """Accelerations (n_v,) by the equations that need no multipliers.

    The relations A δq = 0 and W δq = 0 are solved for some of the variations, δq_i = Σ a_il δq_l; for each of the others
    P_l − Q_l + Σ_i a_il (P_i − Q_i) = 0. Where they reduce to δq_i = 0, P_l = Q_l remains: in these equations an
    auxiliary system that places only the δq_i does not appear.

    Parameters
    ----------
    servo : Servo
        The servo.
    state : State
        Consistent state.

    Returns
    -------
    ndarray, shape (n_v,)
        Accelerations.

    Examples
    --------
    >>> import gauss
    >>> from gauss import servo
    >>> held = gauss.load("servo/inverted_pendulum")
    >>> state = servo.initial_state(held)
    >>> bool(abs(servo.without_multipliers(held, state) - servo.solve(held, state).qdd).max() < 1e-9)
    True
    """
    terms = _terms(servo, state)
    blocked = np.concatenate([terms.A, terms.W])
    Z = free_displacements(blocked)
    K = np.concatenate([Z.T @ terms.M, terms.A, terms.G])
    right = np.concatenate([Z.T @ terms.force, terms.D, terms.gamma])
    return np.linalg.lstsq(K, right, rcond=None)[0]


def free_displacements(blocked: np.ndarray) -> np.ndarray:
    """Basis Z (h, h − m) of the displacements with ``blocked`` δq = 0, by solving for m of the variations."""
    h = blocked.shape[1]
    if not len(blocked):
        return np.eye(h)
    _, R, order = qr(blocked, mode="economic", pivoting=True)
    diagonal = np.abs(np.diag(R))
    m = int((diagonal > DEPENDENT * diagonal[0]).sum())
    Z = np.zeros((h, h - m))
    Z[order[:m]] = -np.linalg.solve(R[:m, :m], R[:m, m:])
    Z[order[m:]] = np.eye(h - m)
    return Z


def _terms(servo: Servo, state: State) -> Terms:
    require(servo, (Servo,), "servo.lagrange")
    require(state, (State,), "servo.lagrange: state")
    servo.follow_laws()
    return servo.made((LagrangeForm,), lambda: LagrangeForm(servo))(state)


class LagrangeForm:
    """Lagrange's equations of one servo, traced once."""

    def __init__(self, servo: Servo):
        self.system = system = servo.system
        require_written(system)
        self.called, symbols = Laws(system).called, servo.symbols
        state = symbols.motion.state
        q, v = state.q, state.v
        momenta = reverse(kinetic_energy(symbols), v)
        h = forward(momenta, q, v) - reverse(kinetic_energy(symbols), q)
        effort = symbols.t.graph.symbols("P", system.n_v)
        contacts = rows(contact_scalars(servo), symbols)
        A, D = loop_constraints(symbols)
        A, D = np.concatenate([A, contacts.G]), np.concatenate([D, contacts.gamma])
        found, count = rows(list(servo.scalars), symbols), servo.n_contacts
        M, Q = jacobian(momenta, v), generalised_forces(symbols, effort)
        outputs = [M, Q - h, A, D, found.G[count:], found.gamma[count:], directions(servo, symbols)]
        self.kernel = ShapedKernel([*symbols.inputs, *effort], outputs)

    def __call__(self, state: State) -> Terms:
        """Terms in numbers."""
        applied = Applied(Kinematics(self.system, state), self.called)
        return Terms(*self.kernel(np.concatenate([state.q, state.v, [state.t], applied.P])))


def require_written(system: System):
    """Refuse systems with quaternions, and with opaque laws of loads on bodies; SceneError if there is one."""
    if not system.is_flat:
        names = ", ".join(repr(joint.name) for joint in system.joints if joint.pair.quaternion is not None)
        raise SceneError(f"joint {names} has a quaternion: its rates are no derivatives of coordinates; use solve instead.")
    called = [bound.load.name for bound in Laws(system).called if not bound.on_coordinates or needs_poses(bound.load)]
    if called:
        raise SceneError(f"the law of {called[0]!r} is an opaque callback of the motion; use solve instead.")


def kinetic_energy(symbols: MotionSymbols):
    """T of coordinates and rates."""
    motion, Phi, total = symbols.motion, symbols.motion.system.Phi.reshape(-1, 6), 0.0
    for i, (J, mass) in enumerate(zip(Phi[:, :3], Phi[:, 3], strict=True)):
        omega = motion.R[i].T @ motion.W[i]
        total = total + 0.5 * (omega @ (J * omega) + mass * (motion.u[i] @ motion.u[i]))
    return total


def generalised_forces(symbols: MotionSymbols, effort) -> np.ndarray:
    """Q (n_v,): −∂U/∂q of gravity, and the virtual work of all other loads; ``effort`` are those of opaque laws."""
    motion, system = symbols.motion, symbols.motion.system
    state, gravity = motion.state, np.array(system.scene.gravity)
    bodies = range(system.structure.n_bodies)
    U = sum((-system.Phi[6 * i + 3] * (gravity @ motion.x[i]) for i in bodies), symbols.t.graph.constant(0.0))
    applied = Applied(motion, Laws(system).traced)
    Q = effort + applied.P - reverse(U, state.q)
    for i in bodies:
        Q = Q + jacobian(motion.u[i], state.v).T @ applied.F[i] + jacobian(motion.W[i], state.v).T @ applied.M[i]
    return Q


def contact_scalars(servo: Servo) -> list[ScalarRelation]:
    """Constraints of the scene beyond joints and couplings, and relations that contacts keep."""
    motion = servo.symbols.motion
    of_scene = [r for c in servo.system.scene.relations.values() for r in as_relations(c, motion, ideal=True)]
    return [*scalars(of_scene, servo.symbols), *servo.scalars[: servo.n_contacts]]


def loop_constraints(symbols: MotionSymbols) -> tuple[np.ndarray, np.ndarray]:
    """Loop constraints A q̈ = D of joints and couplings, in tree coordinates."""
    motion, system = symbols.motion, symbols.motion.system
    v = motion.state.v
    parts = []
    for index in system.structure.closures:
        if index < len(system.joints):
            joint, at = system.joints[index], motion.joints[index]
            p, c, rates = joint.parent, joint.child, v[joint.v]
            parts.append(motion.W[c] - motion.W[p] - at.E_omega @ rates)
            moved = motion.u[c] + cross(motion.W[c], at.r) - motion.u[p] - cross(motion.W[p], at.s)
            parts.append(moved - at.E_v @ rates)
    parts.append(Couplings(whole(system)).K @ v)
    velocities = np.array([symbols.t.graph.lift(entry) for part in parts for entry in part] + [None], dtype=object)[:-1]
    A = jacobian(velocities, v).reshape(velocities.size, system.n_v)
    return A, -forward(velocities, motion.state.q, v)
