"""A motion in steps, and the linear maps of small changes over each: smooth steps, and events between them."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from gauss.analysis.sensitivity.event_parameters import (
    PLACE_STEP,
    PLACES,
    absent_from,
    bearing_places,
    elsewhere,
    is_of_event,
    refuse_bearing_start,
)
from gauss.analysis.sensitivity.phase_record import RecordedPhase, packed, phase_times, recorded_motion
from gauss.analysis.sensitivity.saltation import Transition
from gauss.analysis.sensitivity.timed_steps import SHORTEST, timed_steps, warn_of_jumps
from gauss.analysis.tangents import Tangents
from gauss.arguments import name_list, real_array
from gauss.dynamics.constraint_leak import may_leak
from gauss.dynamics.laws.switching import timed_switching
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.mechanism import loop_residual
from gauss.dynamics.motion_step import MotionStep
from gauss.dynamics.parameter_terms import OF_JOINTS
from gauss.dynamics.rigid_loops import refuse_other_pose
from gauss.dynamics.scene_compilation import system_of
from gauss.errors import ArgumentError, SimulationError, require
from gauss.simulation.tolerances import step_count
from gauss.system import State, System
from gauss.system.coordinate_names import displacement_names, rate_names


class Piece(Protocol):
    """Linear map of small changes of (state, inputs, parameters), (n_given,), to those of the state, (n_x,)."""

    def change(self, directions: np.ndarray) -> np.ndarray:
        """Changes (n_x, k) of the state at its end along directions (n_given, k)."""

    def gradient(self, weights: np.ndarray) -> np.ndarray:
        """Gradient (n_given,) of weights · state at its end."""


@dataclass(frozen=True)
class SmoothStep:
    """Linear map of one smooth step."""

    step: MotionStep  # dynamics
    t: float  # t, h: its start and its length [s]
    h: float
    x: np.ndarray  # x (n_x,), u (n_u,): state at its start, and inputs
    u: np.ndarray

    def change(self, directions: np.ndarray) -> np.ndarray:
        """Changes (n_x, k) of the state at its end along directions (n_given, k)."""
        return self.step.change(self.t, self.h, self.x, self.u, directions)

    def gradient(self, weights: np.ndarray) -> np.ndarray:
        """Gradient (n_given,) of weights · state at its end."""
        return self.step.gradient(self.t, self.h, self.x, self.u, weights)


def smooth_motion(step: MotionStep, steps, start: np.ndarray, inputs) -> tuple[np.ndarray, list[list[Piece]]]:
    """States (k + 1, n_x) after k groups of steps (begin, length) [s], and their linear maps."""
    x, pieces = [start], list[list[Piece]]()
    for group, u in zip(steps, inputs, strict=True):
        made, now = list[Piece](), x[-1]
        for t, h in group:
            made.append(SmoothStep(step, t, h, now, u))
            now = step.after(t, h, now, u)
        x.append(now)
        pieces.append(made)
    return np.array(x), pieces


class Motion:
    """Motion of fixed steps, before its derivatives.

    Parameters
    ----------
    system, duration, step, state, inputs, parameters, integrator
        As for :func:`gauss.sensitivities`.

    Attributes
    ----------
    t, x : ndarray, shape (k,), (k, n_x)
        Its times and states.
    pieces : list of list of Piece
        Linear maps of each step, in order.
    groups : list of list of (float, float)
        Begin and length of the parts of each step, of a smooth motion [s].
    """

    groups: list[list[tuple[float, float]]]

    def __init__(self, system, duration, step, state, inputs, parameters, integrator):
        system = system_of(system, "sensitivities")
        self.steps = step_count(duration, step, "sensitivities")
        self.h, self.start = step, system.initial_state() if state is None else state
        require(self.start, (State,), "sensitivities: state")
        refuse_other_pose(system, self.start.q)
        self.parameters = name_list(parameters, "sensitivities: parameters")
        _refuse_lengths_of_loops(system, self.parameters)
        self.integrator, self.system = integrator, system
        shape = self.steps, len(system.scene.inputs)
        self.inputs = np.zeros(shape) if inputs is None else real_array(inputs, "sensitivities: inputs").copy()
        if self.inputs.shape != shape:
            raise ArgumentError(f"sensitivities: inputs: expected shape {shape}, got {self.inputs.shape}.")
        self.t = self.start.t + step * np.arange(self.steps + 1)
        if system.scene.nonsmooth:
            self._through_events()
        else:
            self._smoothly()
        if not np.isfinite(self.x).all():
            late = self.t[np.flatnonzero(~np.isfinite(self.x).all(axis=1))[0]]
            unlike = " or bodies of one loop that differ less in mass" if may_leak(system) else ""
            raise SimulationError(
                f"sensitivities: the motion is not finite at t = {late:.6g} s; take shorter steps{unlike}."
            )
        warn_of_jumps(system, self.t, self.x)

    @property
    def states(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Times, coordinates and rates."""
        n_q = self.system.n_q
        return self.t, self.x[:, :n_q], self.x[:, n_q:]

    def directions(self) -> tuple[np.ndarray, tuple[str, ...]]:
        """Changes (n_x, m) of the start along independent coordinates and rates, and their names."""
        system = self.step.system
        tangents = Tangents(system, self.start)
        names = [displacement_names(system)[k] for k in tangents.independent_coordinates]
        names += [rate_names(system)[k] for k in tangents.independent_rates]
        return tangents.of_states, tuple(names)

    def _smoothly(self):
        """Equal steps of one smooth system."""
        self.step = MotionStep(self.system, self.integrator, self.parameters)
        self.pieces: list[list[Piece]]
        self.groups = timed_steps(self.system, self.step.laws, self.start, self.t, np.full(self.steps, self.h))
        self.x, self.pieces = smooth_motion(self.step, self.groups, packed(self.start), self.inputs)

    def _through_events(self):
        """Steps that end at the nodes and at the events of the motion of :func:`gauss.simulate`."""
        self._refuse_events()
        for name in self.parameters:
            is_of_event(self.system.scene, name)  # raises
        record, self.x = recorded_motion(self.system, self.h * self.steps, self.start, self.t, self.inputs)
        refuse_bearing_start(self.system, record[0].phase.case[0], self.parameters)
        self.start = record[0].start
        self.pieces = [[] for _ in range(self.steps)]
        made: dict[int, MotionStep] = {}
        steps = [self._step_of(one, made) for one in record]
        self.step = steps[0]
        timed = timed_switching(self.system, Laws(self.system), self.start, float(self.t[-1]))[0]
        ends = np.unique([*self.t, *np.ravel(timed.stops(float(self.t[0]), float(self.t[-1])))])
        for k, (one, times) in enumerate(zip(record, phase_times(record, ends), strict=True)):
            if k:
                row = self._row(one.start.t)
                between = Transition(self.system, record[k - 1], one, (steps[k - 1], steps[k]), self.inputs[row])
                self.pieces[row].append(between.saltation())
            self._append_steps(steps[k], one, times)

    def _step_of(self, one: RecordedPhase, made: dict[int, MotionStep]) -> MotionStep:
        """Smooth dynamics of a phase."""
        system = one.system(self.system)
        if id(system) not in made:
            absent = absent_from(system, self.system, self.parameters)
            step = MotionStep(system, self.integrator, self.parameters, absent)
            moved = self._moved_loops(one, step)
            made[id(system)] = MotionStep(system, self.integrator, self.parameters, absent, moved) if moved.any() else step
        return made[id(system)]

    def _moved_loops(self, one: RecordedPhase, step: MotionStep) -> np.ndarray:
        """Derivatives (m, n_p) of the position residual of a phase by the places of stops that bear in it."""
        residual = lambda system: loop_residual(system, one.start.q, one.start.t)[0]  # noqa: E731
        own = residual(step.system)
        found, ends = np.zeros((own.size, step.n_p)), np.cumsum([0, *step.sizes.values()])
        for parameter in bearing_places(self.system, one.phase.case[0], self.parameters):
            moved = residual(one.system(elsewhere(self.system, parameter)))
            outwards = -PLACES[parameter.partition(":")[0]] * PLACE_STEP
            found[:, ends[list(step.sizes).index(parameter)]] = (moved - own) / outwards
        return found

    def _append_steps(self, step: MotionStep, one: RecordedPhase, times: np.ndarray):
        """Smooth steps between the times of a phase."""
        x = packed(one.start)
        for begin, end in zip(times[:-1], times[1:], strict=True):
            row, node = self._row(0.5 * (begin + end)), np.flatnonzero(self.t == end)
            given = begin, end - begin, x, self.inputs[row]
            if end - begin > SHORTEST * self.h:
                self.pieces[row].append(SmoothStep(step, *given))
            x = self.x[node[0]] if node.size else step.after(*given)

    def _row(self, t: float) -> int:
        """Number of the step in which a time lies."""
        return int(np.clip(np.searchsorted(self.t, t, side="right") - 1, 0, self.steps - 1))

    def _refuse_events(self):
        """Raise a SimulationError for elements whose events have no derivatives here."""
        scene = self.system.scene
        names = [*scene.losses, *scene.backlashes, *(placed.name for placed in self.system.slips.placed)]
        names = [name for name in dict.fromkeys(names) if name not in scene.set_valued]
        if names:
            raise SimulationError(
                f"scene {scene.name!r} cannot be differentiated: events of {', '.join(map(repr, names))} (losses, backlash, "
                "friction of contacts) have no derivatives here; leave them out, or make them smooth loads."
            )


def _refuse_lengths_of_loops(system: System, parameters: tuple[str, ...]):
    """Raise an ArgumentError for lengths of which loops close: no start that is given closes them for other lengths."""
    held = _joints_of_loops(system)
    for parameter in parameters:
        kind, _, joint = parameter.partition(":") if isinstance(parameter, str) else ("", "", "")
        if kind in OF_JOINTS and joint in held:
            raise ArgumentError(
                f"sensitivities: {parameter!r} is a length of a loop through {', '.join(map(repr, sorted(held)))}: with "
                "another length the start does not close it. Expected a parameter that leaves the loops closed; derivatives "
                "of accelerations by lengths of loops are system.parameter_derivatives."
            )


def _joints_of_loops(system: System) -> set[str]:
    """Names of the joints on the loops that joints outside the spanning tree close."""
    to, found = {edge.outer: edge for edge in system.structure.tree}, set()

    def path(body: int) -> set[int]:
        joints = set()
        while body in to:
            joints.add(to[body].constraint)
            body = to[body].inner
        return joints

    for index in system.structure.closures:
        if index < len(system.joints):
            joint = system.joints[index]
            found |= {index} | (path(joint.parent) ^ path(joint.child))
    return {system.joints[index].name for index in found}
