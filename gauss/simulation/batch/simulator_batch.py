"""Batch of simulators: motions that Python advances together, each with inputs of its own."""

from collections.abc import Callable
from copy import copy
from functools import partial
from typing import NamedTuple

import numpy as np

from gauss.arguments import named_arguments, real_numbers
from gauss.codegen import one_tier
from gauss.dynamics.conditions import smooth_question
from gauss.dynamics.consistent_states import RESIDUAL_TOLERANCE
from gauss.dynamics.contact.step_modes import UNKNOWN
from gauss.dynamics.error_scale import ACCELERATION_TOLERANCE
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.load_receiver import output_kernel
from gauss.dynamics.outputs import shape_of, split
from gauss.dynamics.projection import within_limits
from gauss.dynamics.rules import Question
from gauss.dynamics.scene_compilation import compile_scene
from gauss.errors import SimulationError, StateError, did_you_mean, require
from gauss.integrators import FixedStep
from gauss.scene import Scene
from gauss.simulation.arguments import random_changes
from gauss.simulation.batch.fixed_step_batch import FixedStepBatch
from gauss.simulation.batch.initial_states import columns, refuse_inconsistent
from gauss.simulation.batch.machine_code import STEPPED, batch_program, contact_state_size, fixed_step_code, one_by_one
from gauss.simulation.batch.simulators_in_turn import SimulatorsInTurn
from gauss.simulation.held_inputs import numbers_in_words
from gauss.simulation.integrators import usual_fixed_step
from gauss.simulation.memory_limit import refuse_beyond_memory
from gauss.simulation.moreau.unseen_contacts import MOTIONS, NEVER, PassingWatch
from gauss.simulation.passed_switching import StepsAhead
from gauss.simulation.simulator import Simulator
from gauss.simulation.simulator_state import SimulatorState
from gauss.simulation.tolerances import check_tolerances, checked_count
from gauss.simulation.undetected_switching import warn_of_passages
from gauss.system import State, System, retract

POINT_COPIES = 4  # of times, coordinates and rates of a motion, that a batch holds at least: with accelerations and starts


class SimulatorBatchState(NamedTuple):
    """State of a batch of simulators, opaque."""

    of: tuple  # step [s], number of motions, method
    kept: tuple  # what the motions continue from
    # number of steps, whether a warning was given, inputs, marks of motions and their reasons, when shapes are looked at
    flags: tuple


class SimulatorBatch:
    """Motions of a scene in fixed steps, all in one call; see :class:`gauss.Simulator`.

    Motions are advanced side by side in vector registers; those with contacts of many pairs of shapes, or with opaque laws,
    one after the other.

    Parameters
    ----------
    scene : Scene or System
        Scene, or a compiled one. Its inputs are set by :meth:`step`.
    step : float
        Step [s].
    batch : int
        Number of motions.
    integrator : str, optional
        "rk4", "semi_implicit_euler" or "time_stepping"; the last for scenes with contacts, friction or limited forces, "rk4"
        for all others when not given.
    threads : int
        Threads that share the motions in vector registers; the results do not depend on it.

    Attributes
    ----------
    system : System
        The system.
    step_size : float
        Step [s].
    inputs, output_names : tuple of str
        Names of the inputs and of the outputs of the scene.
    diverged : ndarray of bool, shape (batch,)
        Motions that diverged or cannot continue; their states are not finite until they begin anew.
    unconfirmed : ndarray of bool, shape (batch,)
        Motions whose accelerations or loop constraints a check did not confirm: the step is too long for them.

    reasons : dict of int to str
        Why motions of ``diverged`` cannot continue, where a step or a law says it.

    Raises
    ------
    SimulationError
        If there is no such method, if the scene cannot be compiled, with the reasons, or if a prescribed motion jumps;
        after ten thousand steps, the step that comes near such a jump says it.

    Examples
    --------
    >>> import gauss, numpy as np
    >>> scene = gauss.load("cart_pole")
    >>> scene.input("push", "rail", limits=10.0).name
    'push'
    >>> many = gauss.SimulatorBatch(scene, step=1e-3, batch=3)
    >>> many.step([[-1.0], [0.0], [1.0]], n=100)
    >>> np.sign(many.v[:, 0])
    array([-1., -1.,  1.])
    """

    @named_arguments
    def __init__(self, scene: Scene | System, step: float, batch: int, integrator: str | None = None, threads: int = 1):
        require(scene, (Scene, System), "SimulatorBatch")
        check_tolerances(step=step)
        self.system = system = compile_scene(scene) if isinstance(scene, Scene) else scene
        whole, self.step_size, self.threads = system.scene, float(step), checked_count("threads", threads)
        self.inputs, self.output_names = tuple(whole.inputs), tuple(whole.outputs)
        self.integrator = usual_fixed_step(whole) if integrator is None else str(integrator)
        if self.integrator not in STEPPED:
            raise SimulationError(f"no integrator {integrator!r} for many motions. {did_you_mean(self.integrator, STEPPED)}")
        method = STEPPED[self.integrator]
        self._ahead = StepsAhead(system, Laws(system), self.step_size, method)
        with one_tier():
            self._begin, self._measure = self._compiled(method)
        self._start, self._size = system.initial_state(), checked_count("batch", batch)
        many = f"batch: {self._size:.3g} motions of {whole.name!r}"
        refuse_beyond_memory(POINT_COPIES * self._size * (1 + system.n_q + system.n_v), many, "give a smaller batch")
        self._passing = PassingWatch(system, self.step_size)
        self._ahead.look(self._start, self._start.t + self.step_size)
        self._u = np.zeros((self._size, 1, len(self.inputs)))
        self._alone: Simulator | None = None
        self.reset()

    def __reduce__(self):
        return _again, ((self.system, *self._options, self.threads), self.snapshot())

    def _compiled(self, method: FixedStep) -> tuple[Callable, Callable[[np.ndarray], np.ndarray]]:
        """Maker of a batch at some initial states, and machine code of the outputs."""
        system, held = self.system, bool(self.inputs)
        if one_by_one(system, method, held):
            alone = Simulator(system, self.step_size, self.integrator)
            self._ahead.warned_of |= alone.warned_of
            return partial(SimulatorsInTurn, alone), output_kernel(alone.program, system, method.nonsmooth, batch=True)
        ask = smooth_question(Question(system, Laws(system))) if method.nonsmooth else Question(system, Laws(system))
        memory = contact_state_size(system) if method.nonsmooth else 0
        program = batch_program(system, Laws(system), method)(ask.system, ask.laws, memory=memory, inputs=held)
        loop = fixed_step_code(system, method, held)
        return partial(FixedStepBatch, loop), output_kernel(program, system, method.nonsmooth, batch=True)

    @property
    def _options(self) -> tuple:
        return self.step_size, self._size, self.integrator

    @property
    def has_time_laws(self) -> bool:
        """Whether loads or constraints of the scene have laws, which may depend on time."""
        laws = Laws(self.system)
        return bool(laws.functions or laws.called) or self.system.relations.asks_time

    def __len__(self):
        return self._size

    def reset(self, q=None, v=None, *, seed: int | None = None, spread: float = 0.05):
        """Begin all motions anew; inputs are zero until the next step.

        Parameters
        ----------
        q, v : array_like, shape (batch, n_q), (batch, n_v), optional
            Initial states that meet the constraints; those of the scene when not given.
        seed : int, optional
            Seed of random changes of these states: displacements and rates are uniform up to ``spread``.
        spread : float
            Largest random change of coordinates [rad, m] and of rates [rad/s, m/s].

        Raises
        ------
        StateError
            If the states have wrong shapes, or violate the constraints.
        """
        starts = columns(self.system, *(_tiled(*pair, self._size) for pair in ((self._start.q, q), (self._start.v, v))))
        if starts.shape[1] != self._size:
            raise StateError(f"reset: expected the states of {self._size} motions, got {starts.shape[1]}.")
        if seed is not None:
            changes = random_changes(seed, spread, (self._size, 2, self.system.n_v))
            starts = np.array([self._changed(*pair) for pair in zip(starts.T, changes, strict=True)]).T
        self._batch, self._steps, self._warned = self._begin(starts), 0, False
        refuse_inconsistent(self.system, starts, self._batch.residual)
        self._u[:] = 0.0
        self._passing.begin()
        self.diverged, self.unconfirmed = np.zeros((2, self._size), dtype=bool)
        self.reasons: dict[int, str] = {}

    def restart(self, which, q, v):
        """Begin some motions anew, of a scene without laws of time.

        Parameters
        ----------
        which : array_like of int or bool
            Motions.
        q, v : array_like, shape (k, n_q), (k, n_v)
            Their initial states, consistent.

        Raises
        ------
        SimulationError
            If the scene has laws of time or state.
        StateError
            If there are no such motions, or the states have wrong shapes, or violate the constraints.
        """
        if self.has_time_laws:
            raise SimulationError(f"scene {self.system.scene.name!r} has laws of time or state; reset all motions.")
        starts, chosen = columns(self.system, q, v), _chosen(which, self._size)
        if starts.shape[1] != chosen.size:
            raise StateError(f"restart: expected the states of {chosen.size} motions, got {starts.shape[1]}.")
        fresh = self._begin(starts)
        refuse_inconsistent(self.system, starts, fresh.residual)
        fresh.points[0] = self.t
        self._batch.take(chosen, fresh)
        self.diverged[chosen] = self.unconfirmed[chosen] = False
        self.reasons = {k: why for k, why in self.reasons.items() if k not in chosen}

    def _changed(self, start: np.ndarray, change: np.ndarray) -> np.ndarray:
        """Neighbour (n_q + n_v,) of a state by a displacement and a change of rates, which meets the constraints."""
        q, v = np.split(start, [self.system.n_q])
        near = State(0.0, retract(self.system, q, change[0]), v + change[1])
        state = self.system.projected(within_limits(self.system, near))
        return np.concatenate([state.q, state.v])

    def step(self, u=None, n: int = 1):
        """Make steps of all motions under values of the inputs.

        Parameters
        ----------
        u : array_like, shape (batch, n_u), optional
            Values of the inputs of each motion [N m, N], cut off at their limits; the last ones when not given.
        n : int
            Number of steps.

        Warns
        -----
        SwitchingWarning
            Once between resets, if a law of the state may have switched undetected within a step; once for all motions, if
            a law of time jumps, and if it has a feature shorter than the step, in the next ten thousand steps.
        ContactLawWarning
            Once between resets, if shapes may pass through each other unseen at the rates where a call begins or ends.

        Raises
        ------
        SimulationError
            If a value is not finite, a shape is wrong, or a prescribed motion jumps; nothing changes.
        """
        n = checked_count("n", n)
        if u is not None:
            self._set(u)
        if self._steps + n > self._ahead.seen_from(0.0):
            self._ahead.look(self._start, (self._steps + n) * self.step_size)
        self._look_for_passing()
        batch, before = self._batch, self._advance(n)
        if not self._warned and (batch.unseen > 0.0).any():
            warn_of_passages(self.system, batch.unseen, self.integrator)
            self._warned = True
        finite, solved = np.isfinite(batch.reached).all(axis=0), batch.unsolved <= 0.0
        confirmed = (batch.error <= ACCELERATION_TOLERANCE) & (batch.residual <= RESIDUAL_TOLERANCE)
        if not self.system.nonsmooth:
            self.unconfirmed |= finite & ~confirmed
        else:
            for k in map(int, np.flatnonzero((finite & ~confirmed) | ~solved)):
                finite[k] = not self.diverged[k] and self._repeated(k, before[:, k], n)
        self.diverged |= ~finite
        self.reasons |= batch.found_reasons()
        if n > 1:
            self._look_for_passing()

    def _advance(self, n: int) -> np.ndarray:
        """Make steps of all motions, or of none; return the points before, empty for single steps of smooth systems."""
        batch, single = self._batch, n == 1 and not self.system.nonsmooth and not isinstance(self._batch, SimulatorsInTurn)
        kept, batch.worst[:] = () if single else tuple(map(copy, batch.kept())), 0.0
        try:
            batch.advance(self._steps, n, self.step_size, self.threads, self._u if self.inputs else None)
        except BaseException:  # Ctrl-C, or an opaque law: single steps are completed, others undone
            if single:
                self._steps += n
            else:
                batch.keep(*kept)
            raise
        self._steps += n
        return kept[0] if kept else np.zeros((0, 0))

    def _look_for_passing(self):
        """Look for shapes that may pass through each other within a step, where that is due."""
        if not self._passing.has_pairs or isinstance(self._batch, SimulatorsInTurn):  # which look themselves
            return
        rates = np.nan_to_num(self._batch.reached[self.system.n_q :], posinf=0.0, neginf=0.0)
        square = np.einsum("ij,ij->j", rates, rates)
        fastest = np.argsort(-square)[:MOTIONS].tolist()
        states = lambda: ((f"motion {k}, ", State(self.t, self.q[k], self.v[k])) for k in fastest)  # noqa: E731
        self._passing.examine(float(square.max()), self._steps, states)

    def _set(self, u):
        given, shape = real_numbers(u), (self._size, len(self.inputs))
        if given is None or given.shape != shape or not np.isfinite(given).all():
            expected = f"({shape[0]} motions, {shape[1]} inputs)"
            raise SimulationError(f"u: expected finite numbers of shape {expected}, got {numbers_in_words(given)}.")
        self._u[:, 0] = given

    def _repeated(self, k: int, before: np.ndarray, n: int) -> bool:
        """Whether a simulator makes the steps of a motion whose contact problem the batch does not solve."""
        if self._alone is None:
            self._alone = Simulator(self.system, self.step_size, self.integrator)
        alone = self._alone
        alone.reset()
        fresh, end = alone.snapshot(), before.size - len(self.inputs)
        more = len(np.frombuffer(fresh.point)) - before.size  # codes of contact modes, which the points of a batch lack
        point = np.insert(before, end, [UNKNOWN] * more)
        alone.restore(SimulatorState(point.tobytes(), fresh.control, 0.0, self._steps - n, watched=(NEVER, True)))
        try:
            alone.step(self._u[k, 0] if self.inputs else None, n)
        except SimulationError as error:
            self._batch.points[1:, k], self.reasons[k] = np.nan, str(error)
            return False
        self._batch.points[:, k] = np.delete(np.frombuffer(alone.snapshot().point), slice(end, end + more))
        return True

    def snapshot(self) -> SimulatorBatchState:
        """Present state of all motions, to the last bit; any batch of the same scene, step and size can restore it."""
        marks = self.diverged.copy(), self.unconfirmed.copy(), dict(self.reasons)
        flags = self._steps, self._warned, self._u.copy(), *marks, self._passing.due
        return SimulatorBatchState(self._options, tuple(map(copy, self._batch.kept())), flags)

    def restore(self, snapshot: SimulatorBatchState):
        """Continue all motions from a snapshot.

        Raises
        ------
        SimulationError
            If it is of another system, step, method or number of motions.
        """
        require(snapshot, (SimulatorBatchState,), "restore")
        if snapshot.of != self._options or snapshot.kept[0].shape != self._batch.points.shape:
            raise SimulationError("restore: the snapshot is of another system, step, method or number of motions.")
        self._batch.keep(*snapshot.kept)
        self._steps, self._warned, u, diverged, unconfirmed, reasons, self._passing.due = snapshot.flags
        self._u[:], self.diverged, self.unconfirmed, self.reasons = u, diverged.copy(), unconfirmed.copy(), dict(reasons)

    @property
    def t(self) -> float:
        """Time [s]."""
        return self._steps * self.step_size

    @property
    def q(self) -> np.ndarray:
        """Coordinates (batch, n_q), a copy."""
        return self._batch.reached[: self.system.n_q].T.copy()

    @property
    def v(self) -> np.ndarray:
        """Rates (batch, n_v), a copy."""
        return self._batch.reached[self.system.n_q :].T.copy()

    @property
    def outputs(self) -> dict[str, np.ndarray]:
        """Values (batch, …) of the outputs of the scene."""
        outputs, found = self.system.scene.outputs, split(self.output_vectors(), self.system.scene)
        return {name: values.reshape(-1, *shape_of(outputs[name], self.system)) for name, values in found.items()}

    def output_vectors(self) -> np.ndarray:
        """Values (batch, m) of all outputs in a row."""
        points = self._batch.points.copy()
        points[len(points) - len(self.inputs) :, : self._size] = self._u[:, 0].T
        return self._measure(points)[:, : self._size].T


def _chosen(which, batch: int) -> np.ndarray:
    """Numbers of some motions; StateError if there are no such motions."""
    try:
        return np.ravel(np.arange(batch)[which])
    except (IndexError, ValueError, TypeError) as error:
        raise StateError(
            f"which: expected numbers of motions below {batch}, or {batch} truths, got {which!r:.80}."
        ) from error


def _again(given: tuple, snapshot: SimulatorBatchState) -> SimulatorBatch:
    """Batch of the same arguments in the same states, in another process."""
    many = SimulatorBatch(*given)
    many.restore(snapshot)
    return many


def _tiled(own: np.ndarray, given, batch: int):
    return np.tile(own, (batch, 1)) if given is None else given
