"""Accelerations, reactions of contacts and efforts of servos at one instant: the saddle system in maximal coordinates.

    [Φ  0  Aᵀ  W_aᵀ] [a ]   [f]
    [0  0  Bᵀ  W_qᵀ] [q̈ ] = [P]        force of the contacts −Aᵀλ, −Bᵀλ, of the servos Wᵀu, u = −μ
    [A  B  0   0   ] [λ ]   [D]
    [A_s B_s 0 0   ] [μ ]   [D_s]

It is solved block by block: contacts by the recursion, then S u = b. Where the directions W span the same as the rows
(ideal case), it is the system of a minimum, and any backend of the Gauss QP serves.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from gauss.backends import solve as solve_compulsion
from gauss.backends.closure import Factor
from gauss.backends.compulsion import Compulsion
from gauss.backends.estimate import acceleration_errors
from gauss.backends.solution import Answer
from gauss.backends.structure import ConstraintRows
from gauss.dynamics.assemble import assemble_motion
from gauss.dynamics.kinematics import kinematics
from gauss.dynamics.loads import Applied
from gauss.errors import BackendError, SimulationError
from gauss.servo.allocate import allocate
from gauss.servo.instant import ServoInstant, number
from gauss.servo.kernels import body_directions, body_rows
from gauss.servo.relation import ServoRows
from gauss.servo.servo import Servo
from gauss.shapes import Shaped
from gauss.system import State

IDEAL = 1e-12  # squared sine, in the mass metric, between directions and rows of ideal servos
REFINED = 1e-14  # relative error of accelerations at which refinement ends
REFINEMENTS = 10


@dataclass(frozen=True)
class ServoSolution:
    """Accelerations and both kinds of reactions.

    Parameters
    ----------
    a : ndarray, shape (6n,)
        Quasi-accelerations [rad/s², m/s²].
    qdd : ndarray, shape (p,)
        Joint accelerations.
    multipliers : ndarray, shape (r,)
        λ of the contacts: their reaction is −Aᵀλ.
    efforts : ndarray, shape (j,)
        Efforts u of the servos, along their directions [N, N m].
    names : tuple of str
        Names of the efforts.
    method : str
        Method of solution.
    error : float
        Estimated relative error of the accelerations: the size of the last correction.
    compulsion : Compulsion
        Problem of the contacts, without servos.

    Examples
    --------
    >>> import gauss
    >>> from gauss import servo
    >>> held = gauss.load("servo/inverted_pendulum")
    >>> now = servo.solve(held, servo.initial_state(held))
    >>> now.qdd.round(4), bool(now.error < 1e-9)
    (array([0., 0.]), True)
    """

    a: Shaped[np.ndarray, " n6"]
    qdd: Shaped[np.ndarray, " p"]
    multipliers: Shaped[np.ndarray, " r"]
    efforts: Shaped[np.ndarray, " j"]
    names: tuple[str, ...]
    method: str
    error: float
    compulsion: Compulsion = field(repr=False)

    def effort(self, name: str) -> float:
        """Effort of this name [N, N m]."""
        return float(self.efforts[self.names.index(name)])


class Saddle:
    """Saddle system of a servo in a consistent state, with its contacts factored.

    ``load`` (n_v,): generalised forces added to those of the scene; ``hidden``: rows on the coordinates that replace those
    of the relations, from index reduction. ``compulsion``: Gauss's problem without servos; ``instant``: rows, directions and
    responses in maximal coordinates.
    """

    def __init__(self, servo: Servo, state: State, load=None, hidden: ServoRows | None = None):
        self.servo, self.t = servo, number(state.t)
        motion = kinematics(servo.system, state)
        applied = Applied(motion)
        rows, count = body_rows(servo)(motion), servo.n_contacts
        compulsion = assemble_motion(motion, applied, load)
        residual = np.abs(np.concatenate([rows.position[:count], rows.velocity[:count]])).max(initial=0.0)
        names = [scalar.name for scalar in servo.scalars]
        compulsion = replace(compulsion, constraint_residual=max(compulsion.violation, float(residual)))
        self.compulsion = extended(compulsion, rows.G[:count], rows.gamma[:count], names[:count])
        self.factor = Factor(self.compulsion)
        self.free = solve_compulsion(self.compulsion, "recursion")
        if not self.free.status.certified:
            raise SimulationError(f"t = {state.t:.6g} s, contacts without servos: {self.free.status}.")
        W, G, gamma = body_directions(servo, motion), rows.G[count:], rows.gamma[count:]
        if hidden is not None:  # rows found by index reduction are rows on the coordinates
            G, gamma = np.concatenate([np.zeros((len(hidden.G), servo.system.Phi.size)), hidden.G], axis=1), hidden.gamma
        pulls = [self._response(w) for w in W]
        width = servo.system.Phi.size + servo.system.n_v
        self.multipliers_W = _columns([multipliers for _, multipliers in pulls], self.compulsion.D.size)
        self.instant = ServoInstant(
            rows.position[count:] if hidden is None else hidden.position,
            rows.velocity[count:] if hidden is None else hidden.velocity,
            G,
            gamma,
            W,
            np.concatenate([self.free.a, self.free.qdd]),
            _columns([x for x, _ in pulls], width),
            _columns([self._response(g)[0] for g in G], width),
            W @ np.concatenate([motion.quasi_velocities(), state.v]),
            np.array([applied.driven, applied.loaded, applied.dissipated]),
        )

    def _response(self, direction):
        split = self.servo.system.Phi.size
        a, qdd, multipliers, _ = self.factor.solve(direction[:split], np.zeros(self.compulsion.D.size), direction[split:])
        return np.concatenate([a, qdd]), multipliers

    def solve(self, backend: str = "auto") -> ServoSolution:
        """Solve; see :func:`gauss.servo.solve`."""
        if backend == "auto":
            backend = "recursion" if is_ideal(self.instant) and self.instant.b.size else "saddle"
        return self._oblique() if backend == "saddle" else self._ideal(backend)

    def _oblique(self) -> ServoSolution:
        """Block elimination, refined on the residuals of the whole saddle system."""
        servo, instant = self.servo, self.instant
        u = allocate(instant, servo, self.t)
        x = instant.free + instant.X_W @ u
        multipliers, error = self.free.multipliers + self.multipliers_W @ u, np.inf
        inverse = np.linalg.pinv(instant.S, 1e-14)
        split = servo.system.Phi.size
        for _ in range(REFINEMENTS):
            r1, r2, r3 = self.compulsion.residuals(x[:split], x[split:], multipliers)
            pull = instant.W.T @ u
            a, qdd, dm, _ = self.factor.solve(r1 - pull[:split], r2, r3 - pull[split:])
            dx = np.concatenate([a, qdd])
            du = inverse @ (instant.G @ (x - dx) - instant.gamma)
            dx, dm = dx + instant.X_W @ du, dm + self.multipliers_W @ du
            x, u, multipliers, last = x - dx, u - du, multipliers - dm, error
            answer = Answer(x[:split], x[split:], multipliers, np.zeros(0))
            found = acceleration_errors(self.compulsion, answer, (dx[:split], dx[split:]))
            error = float(found.max())
            if error <= REFINED or error > last / 2:
                break
        return ServoSolution(
            x[:split],
            x[split:],
            multipliers,
            u,
            servo.efforts,
            "saddle system, block by block: oblique, no minimum of the compulsion" if u.size else "contacts alone",
            error,
            self.compulsion,
        )

    def _ideal(self, backend: str) -> ServoSolution:
        """Gauss QP with the relations as further rows; efforts and reactions follow from S u = b."""
        instant = self.instant
        if not is_ideal(instant):
            raise BackendError(
                f"backend {backend!r} minimises the compulsion, but these servos are not ideal: their forces are not along "
                "the rows of what they hold. Use backend 'saddle' or 'auto'."
            )
        found = solve_compulsion(extended(self.compulsion, instant.G, instant.gamma, self.servo.held), backend)
        if not found.status.certified:
            raise SimulationError(f"backend {backend!r}: {found.status}.")
        allocate(instant, self.servo, self.t)  # refuses cables that would have to push
        u = np.linalg.solve(instant.S, instant.b)
        return ServoSolution(
            found.a,
            found.qdd,
            self.free.multipliers + self.multipliers_W @ u,
            u,
            self.servo.efforts,
            f"Gauss QP by backend {found.backend!r}: ideal, the least compulsion under the relations",
            found.certificate.error,
            self.compulsion,
        )


def is_ideal(instant: ServoInstant) -> bool:
    """Whether the efforts span the same directions as the rows, where contacts leave freedom (W = G)."""
    if instant.S.shape[0] != instant.S.shape[1]:
        return False
    rows = instant.G @ instant.X_G / np.outer(instant.lengths, instant.lengths)
    share = instant.cosines.T @ np.linalg.solve(rows, instant.cosines)  # of each direction, within the span of the rows
    return bool((1.0 - np.diag(share) <= IDEAL).all())


def extended(compulsion: Compulsion, G, gamma, names) -> Compulsion:
    """Compulsion with further rows G (a, q̈) = γ."""
    if not len(gamma):
        return compulsion
    structure, constraints, A_blocks, B_blocks = compulsion.structure, [], [], []
    for k, (name, row) in enumerate(zip(names, G, strict=True), start=compulsion.D.size):
        parts = row[: compulsion.Phi.size].reshape(-1, 6)
        bodies = tuple(int(body) for body in np.flatnonzero(parts.any(axis=1)))
        on_columns = row[compulsion.Phi.size :][None]
        joints = {(c.start, c.stop) for constraint in structure.constraints for c in constraint.columns}
        columns = tuple(slice(*pair) for pair in sorted(joints) if on_columns[:, slice(*pair)].any())
        constraints.append(ConstraintRows(name, slice(k, k + 1), bodies, columns))
        A_blocks.append(tuple(parts[body][None] for body in bodies))
        B_blocks.append(tuple(on_columns[:, c] for c in columns))
    zero = np.zeros(len(gamma))
    return replace(
        compulsion,
        structure=replace(structure, constraints=(*structure.constraints, *constraints)),
        A_blocks=(*compulsion.A_blocks, *A_blocks),
        B_blocks=(*compulsion.B_blocks, *B_blocks),
        C=np.concatenate([compulsion.C, zero]),
        D=np.concatenate([compulsion.D, gamma]),
    )


def _columns(vectors, height: int) -> np.ndarray:
    return np.array(vectors).reshape(len(vectors), height).T
