"""Motions with constraints that jump between modes: each mode is moved on its own, and its end is located on the path.

The motion of a mode goes on smoothly beyond the surface at which a condition changes; the surface is located on its
steps, and the motion is made once more up to there. A jump of a position residual is refused; a jump of a velocity residual
is an impact (Gauss's principle for velocities), after which the next mode begins. Any method and any driver moves the modes.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import chain, pairwise
from typing import NamedTuple

import numpy as np

from gauss.codegen import Kernel
from gauss.dynamics.laws.constraint_modes import ConstraintModes, Mode, Step, constraint_modes
from gauss.dynamics.laws.prescribed_jumps import driven_impact
from gauss.dynamics.laws.switching import switching
from gauss.dynamics.laws.switching_functions import constraint_watch
from gauss.dynamics.laws.traced_laws import Laws
from gauss.errors import GaussError, SimulationError
from gauss.simulation.brent import brent
from gauss.simulation.motion_records import Event, joined_stats
from gauss.simulation.prescribed import booked, of_impact
from gauss.simulation.problem import Problem
from gauss.simulation.trajectory import Trajectory
from gauss.system import State

BEYOND = 1e-12  # relative to the size of a condition: a state that is no further beyond its surface lies on it
SHORTEST = 1e-9  # of the duration: steps are divided down to here where a condition might change twice within one
AT_ONCE = 1e-9  # of a step: conditions that change closer to each other change at once
GROWTH = 2.0  # of the time for which a mode is moved ahead, after the last surface and where none was met
MOST_SURFACES = 10_000  # of one motion

Drive = Callable[[Problem], Trajectory]


class Crossing(NamedTuple):
    """Point of a motion on the surface of one or several conditions."""

    state: State
    conditions: tuple[int, ...]


class ModeMotion(NamedTuple):
    """Motion of one mode, the work from the start of the whole motion to its begin, and whether an impact precedes it."""

    motion: Trajectory
    work: np.ndarray
    is_after_impact: bool


def across_surfaces(problem: Problem, drive: Drive) -> Trajectory:
    """Motion of a problem, by ``drive`` from problem to trajectory; in one piece where no constraint jumps.

    SimulationError if a position residual jumps where the motion crosses a surface, or the next mode drives the motion back.
    """
    modes = constraint_modes(problem.system)
    if modes is None:
        return drive(problem)
    if problem.held is not None and not modes.steps:  # no surface is known, and a law of inputs may not be called twice
        return drive(problem)
    if problem.held is not None:
        raise SimulationError(
            f"constraint {modes.names[0]!r} has a jump or a kink at a condition, where the motion is divided; "
            "a control law is not held across it. Let its residual be continuous with its slope, or leave control= out."
        )
    return _Pieces(problem, drive, modes).trajectory()


class _Pieces:
    """Motion in pieces, one for each mode."""

    def __init__(self, problem: Problem, drive: Drive, modes: ConstraintModes):
        self.problem, self.drive, self.modes = problem, drive, modes
        self.watch: Kernel | None = constraint_watch(modes.system)
        self.parts: list[ModeMotion] = []
        self.events: list[Event] = []
        self.shortest = SHORTEST * (problem.end - problem.start.t)

    def trajectory(self) -> Trajectory:
        """The whole motion."""
        p, mode = self.problem, self.modes.mode(self.problem.start)
        state, work, ahead, crossed, met = p.start, np.zeros(3), p.end - p.start.t, None, 0
        while True:
            end = min(state.t + ahead, p.end)
            found = self._first(state, end, mode)
            begun, end = state.t, end if found is None else found.state.t
            if end > state.t:
                moved = self._piece(state, end, mode, work)
                state, work = State(end, moved.q[-1], moved.v[-1]), work + moved.work[-1]
            if found is None:
                if end >= p.end:
                    return self._joined()
                ahead *= GROWTH
                continue
            following = self.modes.beyond(state, mode, found.conditions)
            if crossed == (found.conditions, state.t):
                raise self._error(self._stuck(state, found.conditions))
            ahead = max(GROWTH * (end - begun), self.shortest)
            met += 1
            state, work = self._passed(state, work, mode, following, found.conditions)
            mode, crossed = following, (found.conditions, state.t) if self._is_after_impact(state.t) else None
            if met > MOST_SURFACES:
                raise self._error(f"t = {state.t:.6g} s: more than {MOST_SURFACES} conditions of constraints changed.")

    def _passed(self, state: State, work, mode: Mode, following: Mode, which: tuple[int, ...]) -> tuple[State, np.ndarray]:
        """State and work on the other side of a surface; an impact is noted with the last piece."""
        try:
            step = self.modes.step(state, mode, following)
            if step.position:
                raise SimulationError(self._jump(state, step, which))
            if not step.velocity:
                return state, work
            happened = driven_impact(self.modes.system_of(following), state, (step.name,))
        except GaussError as error:
            raise self._error(str(error)) from error
        self.events.append(of_impact(state.t, (step.name,), happened))
        return happened.state, booked(work, happened)

    def _is_after_impact(self, t: float) -> bool:
        return bool(self.events) and self.events[-1].t == t

    def _piece(self, start: State, end: float, mode: Mode, work: np.ndarray) -> Trajectory:
        """Motion of a mode to a time; its samples before that time are kept, at the end of the motion that one, too."""
        p, samples = self.problem, None
        if p.samples is not None:
            inside = p.samples[(p.samples >= start.t) & ((p.samples < end) | (end >= p.end))]
            samples = inside if inside.size and inside[-1] == end else np.append(inside, end)
        try:
            moved = self._moved(start, end, mode, samples)
        except SimulationError as error:
            if error.trajectory is not None and len(error.trajectory):
                self._keep(error.trajectory, len(error.trajectory), work, start.t)
            raise self._error(str(error)) from error
        self._keep(moved, len(moved) if samples is None else inside.size, work, start.t)
        return moved

    def _keep(self, moved: Trajectory, count: int, work: np.ndarray, start: float):
        rows = {name: getattr(moved, name)[:count] for name in ("t", "q", "v", "work")}
        self.parts.append(ModeMotion(replace(moved, **rows, energies=None), work, self._is_after_impact(start)))

    def _moved(self, start: State, end: float, mode: Mode, samples) -> Trajectory:
        p, system = self.problem, self.modes.system_of(mode)
        laws = Laws(system)
        times = p.switching.times
        own = switching(system, laws, start, end, [t for t in times.switches if start.t < t <= end])
        return self.drive(
            p._replace(system=system, laws=laws, switching=own, start=start, end=end, samples=samples, progress=False)
        )

    def _first(self, start: State, end: float, mode: Mode) -> Crossing | None:
        """First surface that the motion of a mode meets."""
        try:
            ahead = self._moved(start, end, mode, None)
        except SimulationError as error:  # perhaps beyond the surface only
            if error.trajectory is None or not len(error.trajectory):
                return None
            ahead = error.trajectory
        states = [State(float(t), q, v) for t, q, v in zip(ahead.t, ahead.q, ahead.v, strict=True)]
        for begin, reached in pairwise([start, *states]):
            if reached.t > begin.t:
                for found in self._within(begin, reached, mode):
                    return found
        return None

    def _within(self, begin: State, reached: State, mode: Mode) -> Iterator[Crossing]:
        """Surfaces met in a step, in order."""
        if reached.t - begin.t > self.shortest and self._may_hide(begin, reached, mode):
            middle = self._at(begin, 0.5 * (begin.t + reached.t), mode)
            yield from self._within(begin, middle, mode)
            yield from self._within(middle, reached, mode)
            return
        beyond = np.flatnonzero(self.modes.margins(reached, mode) < -BEYOND * self._sizes(begin, reached))
        roots = {int(k): self._root(begin, reached, mode, int(k)) for k in beyond}
        if roots:
            t = min(roots.values())
            together = tuple(k for k, other in roots.items() if other - t <= AT_ONCE * (reached.t - begin.t))
            yield Crossing(begin if t == begin.t else self._at(begin, t, mode), together)

    def _root(self, begin: State, reached: State, mode: Mode, k: int) -> float:
        if self.modes.margins(begin, mode)[k] <= 0.0:
            return begin.t
        margin = lambda t: float(self.modes.margins(self._at(begin, t, mode), mode)[k])  # noqa: E731
        values = {begin.t: float(self.modes.margins(begin, mode)[k]), reached.t: float(self.modes.margins(reached, mode)[k])}
        return float(
            brent(lambda t: values[t] if t in values else margin(t), begin.t, reached.t, 1e-15 * abs(reached.t), 1e-15)
        )

    def _at(self, begin: State, t: float, mode: Mode) -> State:
        """State of the motion of a mode a little later."""
        if t <= begin.t:
            return begin
        found = self._moved(begin, t, mode, np.array([t]))
        return State(t, found.q[-1], found.v[-1])

    def _sizes(self, begin: State, reached: State) -> np.ndarray:
        return np.maximum(np.abs(self.modes.sides(begin)), np.abs(self.modes.sides(reached))) + self.modes.sizes

    def _may_hide(self, begin: State, reached: State, mode: Mode) -> bool:
        """Whether a condition may change more than once in a step."""
        if self.watch is None:
            return False
        system = self.modes.system_of(mode)
        try:
            ends = [([s.t], s.q, s.v, system.accelerations(s)) for s in (begin, reached)]
        except GaussError:
            return False
        return bool(self.watch(np.concatenate([*ends[0], *ends[1]]))[0] < 1.0)

    def _jump(self, state: State, step: Step, which: tuple[int, ...]) -> str:
        return (
            f"constraint {step.name!r}: what it prescribes jumps by {step.position:.6g} [m, rad] at t = {state.t:.9g} s, "
            f"where a condition on {self._place(state, which)} changes, which no finite impulse does. Let the residual be "
            "continuous, or end the motion before."
        )

    def _stuck(self, state: State, which: tuple[int, ...]) -> str:
        return (
            f"t = {state.t:.6g} s: constraints {', '.join(map(repr, self.modes.names))} have a kink where a condition on "
            f"{self._place(state, which)} changes, and the impact there drives the motion back from both sides: it cannot "
            "pass. Round the kink off."
        )

    def _place(self, state: State, which: tuple[int, ...]) -> str:
        """What conditions depend on, with the coordinates there."""
        system, about = self.modes.system, ", ".join(dict.fromkeys(self.modes.about[k] for k in which))
        named = {joint.name: state.q[joint.q] for joint in system.joints if joint.name in about.split(", ")}
        values = ", ".join(f"{name} = {' '.join(f'{x:.9g}' for x in q)}" for name, q in named.items())
        return f"{about} ({values} [m, rad])" if values else about

    def _error(self, text: str) -> SimulationError:
        return SimulationError(text, self._joined() if self.parts else None)

    def _joined(self) -> Trajectory:
        """All pieces as one motion of the whole system."""
        parts, last, steps = self.parts, self.parts[-1].motion, self.problem.samples is None
        repeats = [steps and k > 0 and not part.is_after_impact for k, part in enumerate(parts)]  # the point before

        def joined(of: Callable[[ModeMotion], np.ndarray]) -> np.ndarray:
            return np.concatenate([of(part)[int(repeated) :] for part, repeated in zip(parts, repeats, strict=True)])

        events = sorted(chain(self.events, *(part.motion.events for part in parts)), key=lambda event: event.t)
        return replace(
            last,
            system=self.problem.system,
            t=joined(lambda part: part.motion.t),
            q=joined(lambda part: part.motion.q),
            v=joined(lambda part: part.motion.v),
            work=joined(lambda part: part.motion.work + part.work),
            stats=joined_stats([part.motion.stats for part in parts]),
            events=tuple(events),
        )
