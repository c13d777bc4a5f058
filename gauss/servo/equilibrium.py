"""Equilibrium under servos: no inertia terms, relations of positions added (those of rates hold at rest).

Q(q) − AᵀΛ + Wᵀu = 0,     joints closed,     c(q, t) = 0
"""

from typing import NamedTuple

import numpy as np

from gauss.codegen import jacobian
from gauss.dynamics.assemble import position_residual
from gauss.dynamics.assembly_search import NEWTON_STEPS
from gauss.dynamics.constraint_scales import constraint_scales
from gauss.dynamics.kinematics import Kinematics, kinematics
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.loads import Applied
from gauss.dynamics.projection import LEAST_DAMPING
from gauss.errors import StateError
from gauss.servo.instant import DEPENDENT
from gauss.servo.kernels import ShapedKernel, directions
from gauss.servo.lagrange import contact_scalars, generalised_forces, loop_constraints, require_written
from gauss.servo.project import first_accepted, sizes_of
from gauss.servo.relation import rows
from gauss.servo.servo import Servo, state_of
from gauss.shapes import Shaped
from gauss.system import State, retract

BALANCED = 1e-11  # relative to the largest force, and to the sizes of rows: residuals of an equilibrium


class Equilibrium(NamedTuple):
    """Equilibrium under the efforts of servos.

    Attributes
    ----------
    state : State
        State at rest.
    efforts : ndarray, shape (j,)
        Efforts of the servos [N, N m]; of least norm where they are not unique.

    Examples
    --------
    >>> import gauss
    >>> from gauss import servo
    >>> crane = gauss.load("servo/crane")
    >>> rest = servo.equilibrium(crane)
    >>> dict(zip(crane.efforts, rest.efforts.round(6).tolist()))
    {'trolley force': 0.0, 'rope tension': 19.62}
    """

    state: State
    efforts: Shaped[np.ndarray, " j"]


def equilibrium(servo: Servo, state: State | None = None) -> Equilibrium:
    """Equilibrium near a state.

    Parameters
    ----------
    servo : Servo
        The servo; relations of rates hold at rest.
    state : State, optional
        First guess; the start of the scene when not given. Its time is kept.

    Returns
    -------
    Equilibrium
        State at rest, and the efforts that keep it.

    Raises
    ------
    StateError
        If there is none nearby: the message names the coordinate or relation that is out of balance.

    Examples
    --------
    >>> import gauss
    >>> from gauss import servo
    >>> crane = gauss.load("servo/crane")
    >>> servo.equilibrium(crane).efforts.round(6)  # the tension carries the load
    array([ 0.  , 19.62])
    """
    state, system = state_of(servo, state, "servo.equilibrium"), servo.system
    require_written(system)
    servo.follow_laws()
    form = servo.made((_Form,), lambda: _Form(servo))
    state = State(state.t, state.q, np.zeros(system.n_v))
    unknown = np.zeros(form.n_contacts + len(servo.efforts))
    residual, K, scale = form(state, unknown)
    for _ in range(NEWTON_STEPS):
        if np.abs(residual / scale).max() <= BALANCED:
            return Equilibrium(state, unknown[form.n_contacts :])
        step = form.units * np.linalg.lstsq(K / scale[:, None] * form.units, -residual / scale, rcond=DEPENDENT)[0]
        found = _damped_step(form, state, unknown, step, residual, scale)
        if found is None:
            break
        state, unknown, residual, K = found
    worst = int(np.abs(residual / scale).argmax())
    raise StateError(
        f"no equilibrium is reached from here: {form.names[worst]} is out of balance by {abs(residual[worst]):.3g}. "
        "The servos cannot keep the system at rest there, or the start is too far away."
    )


def _damped_step(
    form: "_Form", state: State, unknown: np.ndarray, step: np.ndarray, residual: np.ndarray, scale: np.ndarray
):
    """State, multipliers and efforts, residual and Jacobian after a damped Newton step; None if none lowers the residual."""
    system, size = form.system, np.linalg.norm(residual / scale)

    def trial_at(share: float) -> tuple[State, np.ndarray, np.ndarray, np.ndarray]:
        trial = State(state.t, retract(system, state.q, share * step[: system.n_v]), state.v)
        values = unknown + share * step[system.n_v :]
        return trial, values, *form(trial, values)[:2]

    return first_accepted(trial_at, lambda trial: np.linalg.norm(trial[2] / scale) < size, LEAST_DAMPING)


class _Form:
    """Balance of forces and relations of positions, with their derivatives, traced once."""

    def __init__(self, servo: Servo):
        self.system, self.called = servo.system, Laws(servo.system).called
        system, symbols = servo.system, servo.symbols
        graph, state = symbols.t.graph, symbols.motion.state
        contacts = contact_scalars(servo)
        finite = [scalar for scalar in (*contacts, *servo.scalars[servo.n_contacts :]) if scalar.level == "position"]
        found = rows(finite, symbols)
        A, _ = loop_constraints(symbols)
        self.n_loops = len(A)
        A = np.concatenate([A, rows(contacts, symbols).G])
        self.n_contacts = len(A)
        multipliers, u = graph.symbols("L", len(A)), graph.symbols("u", len(servo.efforts))
        effort = graph.symbols("P", system.n_v)
        W = directions(servo, symbols)
        balance = generalised_forces(symbols, effort) + W.T @ u - A.T @ multipliers
        inputs = [*symbols.inputs, *effort, *multipliers, *u]
        self.kernel = ShapedKernel(inputs, [balance, jacobian(balance, state.q), W, A, found.position, found.G])
        unit, numbers = system.scale, np.zeros(system.n_v + len(multipliers) + len(u))
        slopes = lambda at: self.kernel(np.concatenate([at.q, at.v, [at.t], numbers]))[-1]  # noqa: E731
        places = [system.structure.constraints[i] for i in system.structure.closures]
        self.loops = [c.rows for c in places if c.name not in system.scene.relations]
        loop_sizes = [constraint_scales(system)[here] for here in self.loops]
        self.sizes = np.concatenate([*loop_sizes, sizes_of(system, slopes)])
        self.units = np.concatenate([unit.coordinates, np.full(len(multipliers) + len(u), unit.force)])
        self.names = [f"coordinate {name!r}" for name in system.coordinates]
        self.names += ["a loop joint"] * self.n_loops + [f"relation {scalar.name!r}" for scalar in finite]

    def __call__(self, state: State, unknown: np.ndarray):
        """Residual, its derivative with respect to (q, Λ, u), and the scale of each entry."""
        motion = kinematics(self.system, state)
        applied = Applied(Kinematics(self.system, state), self.called)
        numbers = self.kernel(np.concatenate([state.q, state.v, [state.t], applied.P, unknown]))
        balance, slope, W, A, relations, G = numbers
        loops = np.concatenate([np.zeros(0), *(position_residual(motion)[here] for here in self.loops)])
        n, p = len(balance), self.n_contacts
        K = np.zeros((n + self.n_loops + len(relations), n + p + len(W)))
        K[:n, :n], K[:n, n : n + p], K[:n, n + p :] = slope, -A.T, W.T
        K[n : n + self.n_loops, :n], K[n + self.n_loops :, :n] = A[: self.n_loops], G
        unit = self.system.scale
        acting = [applied.P, *(A * unknown[:p, None]), *(W * unknown[p:, None])]
        work = max(np.abs(force * unit.coordinates).max(initial=0.0) for force in acting)
        weights = self.system.Phi[3::6].sum() * np.linalg.norm(self.system.scene.gravity)
        scale = np.concatenate([(max(work, weights * unit.length) or unit.energy) / unit.coordinates, self.sizes])
        return np.concatenate([balance, loops, relations]), K, scale
