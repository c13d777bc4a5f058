"""The motion of a scene with events as it was computed: states at given times, and its phases with what ended each.

The run is that of :func:`gauss.simulate`, which chooses modes, locates events and computes impacts; here is kept what the
derivatives of the motion need of it.
"""

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from gauss.codegen import one_tier
from gauss.dynamics.contact.impact import impact
from gauss.dynamics.plan import plan_of
from gauss.errors import SimulationError
from gauss.integrators import Point
from gauss.simulation.arguments import checked_problem
from gauss.simulation.held_inputs import driven_as
from gauss.simulation.phases.event_driven_run import EventDrivenRun
from gauss.simulation.phases.phase import Phase, phase_parts
from gauss.system import State, System

RELATIVE_TOLERANCE = 1e-12  # of the steps, as simulate has it


@dataclass
class RecordedPhase:
    """A smooth phase, and the event that ends it."""

    phase: Phase
    start: State  # its first state
    struck: tuple[int, ...] = ()  # gaps that close with an impact at its end
    bearing: tuple[int, ...] = ()  # closed gaps that bear an impulse there
    other: tuple[str, ...] = ()  # elements other than gaps that take part in the impact
    end: State = field(init=False)  # state before the event; that of the end of the motion in the last phase

    def system(self, whole: System) -> System:
        """Smooth system of the phase, made of another system of the same elements."""
        return smooth_system(whole, self.phase, self.phase.case[0])


def smooth_system(whole: System, phase: Phase, held: tuple[int, ...], **changes) -> System:
    """Smooth system of a phase in which other gaps are closed, or set-valued elements of other modes."""
    names = tuple(whole.contacts.placed[i].name for i in held)
    return phase_parts(whole, names, phase.case[1].but(**changes), phase.places).system


class RecordedRun(EventDrivenRun):
    """Event-driven run that keeps its phases."""

    def __init__(self, problem):
        super().__init__(problem)
        self.record: list[RecordedPhase] = []

    def _next_phase(self, point: Point, hits: tuple[int, ...], since: float | None = None) -> tuple[Point, bool]:
        held = () if self.started is None else self.phase.case[0]
        after, jumped = super()._next_phase(point, hits, since)
        if self.record:
            self.record[-1].end = point.state
        if jumped:
            self._keep_impact(point.state, held, hits, since)
        self.record.append(RecordedPhase(self.phase, after.state))
        return after, jumped

    def _keep_impact(self, state: State, held: tuple[int, ...], hits: tuple[int, ...], since: float | None):
        """Note what takes part in the impact that ends the last phase."""
        names = next(event.gaps for event in reversed(self.events) if event.kind == "impact")
        struck = tuple(i for i, name in enumerate(self.names) if name in names)
        if not self.record:
            raise SimulationError(f"the motion starts with an impact of {', '.join(names)}: it has no derivative there.")
        touching = np.union1d(np.array(held, dtype=int), np.array(struck, dtype=int)).astype(int)
        last = self.record[-1]
        last.struck, last.other = struck, tuple(name for name in names if name not in self.names)
        last.bearing = tuple(impact(self.system, state, touching, self.restitution, self.backend, since).active.tolist())


def recorded_motion(
    system: System, duration: float, start: State, nodes: np.ndarray, inputs: np.ndarray
) -> tuple[list[RecordedPhase], np.ndarray]:
    """Phases of a motion with events, and its states (k, n_q + n_v) at times (k,), inputs being held between these.

    SimulationError if the motion needs time stepping, begins with an impact, or cannot continue.
    """
    driven, breaks = system, ()
    if inputs.size and inputs.any():
        row = lambda t: min(int(np.searchsorted(nodes, t, side="right")) - 1, len(inputs) - 1)  # noqa: E731
        laws = {name: lambda t, j=j: inputs[row(t), j] for j, name in enumerate(system.scene.inputs)}
        driven, breaks = driven_as(system, laws), tuple(nodes[1:-1])
    with one_tier():
        problem = checked_problem(
            driven, duration, "dop853", None, RELATIVE_TOLERANCE, None, "auto", "projection", start, None, breaks, False
        )
        plan = plan_of(problem.question)
        if plan.driver != "events":
            raise SimulationError(f"scene {system.scene.name!r} cannot be differentiated: it is moved by {plan.driver}.")
        run, kept = RecordedRun(problem), [packed(problem.start)]
        reached = problem.start.t
        for point, dense in run.steps_of(run._first(problem.start), None):
            due = nodes[(nodes > reached) & (nodes <= point.state.t)]
            inside = [point.state if t == point.state.t else run.project(dense(t)[0]) for t in due]
            kept += [packed(state) for state in inside]
            reached = max(reached, point.state.t)
            last = point.state
        kept += [packed(last)] * (len(nodes) - len(kept))  # the last node, to the rounding of its time
    run.record[-1].end = last
    return run.record, np.array(kept)


def packed(state: State) -> np.ndarray:
    """Coordinates and rates as one vector."""
    return np.concatenate([state.q, state.v])


def phase_times(record: list[RecordedPhase], nodes: np.ndarray) -> list[np.ndarray]:
    """Times of each phase: its start, the nodes within, its end."""
    inside = [nodes[(nodes > one.start.t) & (nodes < one.end.t)] for one in record]
    found = [np.array([one.start.t, *within, one.end.t]) for one, within in zip(record, inside, strict=True)]
    assert all(first[-1] <= second[0] for first, second in pairwise(found))
    return found
