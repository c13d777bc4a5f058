"""Motion with one-sided constraints: phases between events, each a mechanism of its own.

While a gap stays closed it is a constraint like any other, so a phase is the scene with its closed gaps as relations and
without the others: smooth, solved and projected as every mechanism is. A phase ends when an open gap closes (an impact, by
least compulsion of velocities) or when a closed one would have to be pulled (it opens). Both are located on the dense output
of the step. What is closed afterwards is decided by the compulsion with rows G x ≤ h.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from gauss.assembly import assemble, gap_kernel
from gauss.assembly.gaps import TOUCHING
from gauss.backends import solve
from gauss.errors import SimulationError, StateError
from gauss.integrators import Controlled, Point, Tolerance
from gauss.simulation.consistent import project
from gauss.simulation.crossing import first_hit, first_true
from gauss.simulation.dynamics import OnDemand
from gauss.simulation.impact import impact, resting, staying
from gauss.simulation.run import Run
from gauss.simulation.solver import Solver
from gauss.simulation.trajectory import Event, Trajectory
from gauss.system import State, System, build, phase_scene

MOST_AT_ONCE = 200  # events within the shortest time: more of them do not come to an end
SHORTEST = 1e-9  # of the duration
OPENING_LOOKS = 2  # into each step, for closed gaps that open: each costs a solution
DEEPEST = 1e-6  # [m, rad]: a start deeper in a contact than this is a mistake


class Phase:
    """One mechanism between two events.

    Parameters
    ----------
    scene_system : System
        With its one-sided constraints.
    held : ndarray of int
        Numbers of its gaps that are closed.
    backend : str
        How accelerations are solved.
    """

    def __init__(self, scene_system: System, held: np.ndarray, backend: str):
        names = [scene_system.contacts.placed[i].name for i in held]
        self.held = held
        self.open = np.setdiff1d(np.arange(len(scene_system.contacts.placed)), held)
        self.system = build(phase_scene(scene_system.scene, names), OnDemand())
        self.solver = Solver(backend)
        rows = {constraint.name: constraint.rows for constraint in self.system.structure.constraints}
        self.rows = np.array([rows[name].start for name in names], dtype=int)

    def pushes(self, state: State) -> bool:
        """Whether forces that push keep all closed gaps closed; if not, others may, where rows are redundant."""
        solution = solve(assemble(self.system, state), self.solver.backend)
        return bool((solution.multipliers[self.rows] <= 0.0).all())


class PhasedRun(Run):
    """Simulation of a system with one-sided constraints while it runs.

    Parameters
    ----------
    system : System
        With its one-sided constraints.
    method : Controlled
        How it is stepped.
    backend : str
        How accelerations, impacts and contacts are solved.
    tolerance, step, end
        As of a :class:`Run`.
    """

    def __init__(self, system: System, method: Controlled, backend: str, tolerance: Tolerance, step, end: float):
        super().__init__(system, method, Solver(backend), tolerance, step, end)
        self.backend = backend
        self.names = [placed.name for placed in system.contacts.placed]
        contacts = system.scene.contacts.values()
        self.restitution = np.array([contact.restitution for contact in contacts for _ in contact.sides(system.scene)])
        self.kernel = system.dynamics.on_demand("gaps", lambda: gap_kernel(system))
        self.phases: dict[tuple, Phase] = {}
        self.phase: Phase | None = None
        self.events: list[Event] = []

    def settle(self, state: State) -> State:
        """State on the constraints of the phase."""
        return project(self.phase.system if self.phase else self.system, state)

    def widths(self, state: State) -> np.ndarray:
        """Widths and rates of all gaps (2, m)."""
        return self.kernel(np.concatenate([[state.t], state.q, state.v])).reshape(2, -1)

    def adaptive(self, method: Controlled, point: Point) -> Iterator:
        """Accepted steps of all phases; at an impact the same time twice, before and after."""
        self._refuse_penetration(point.state)
        latest, at_once = point.state.t, 0
        after, jumped = self._next_phase(point, ())
        if jumped:
            yield after, None
        while after.state.t < self.end:
            point = after
            run = Run(self.phase.system, method, self.phase.solver, self.tolerance, self.step, self.end)
            for reached, dense in run.adaptive(method, after):
                self.steps += 1
                event = self._event(point, reached, dense)
                point = event[0] if event else reached
                yield point, dense
                if event:
                    break
            self.rejected += run.rejected
            if not event:
                return
            after, jumped = self._next_phase(*event)
            if jumped:
                yield after, None
            at_once = at_once + 1 if after.state.t - latest <= SHORTEST * self.end else 0
            latest = latest if at_once else after.state.t
            if at_once > MOST_AT_ONCE:
                names = ", ".join(self.events[-1].gaps)
                raise SimulationError(f"t = {latest:.6g} s: impacts and contacts of {names} do not come to an end.")

    def _refuse_penetration(self, state: State):
        width = self.widths(state)[0]
        worst = int(np.argmin(width))
        if width[worst] < -DEEPEST:
            raise StateError(
                f"the start is {-width[worst]:.3g} [m, rad] inside of {self.names[worst]!r}; move it out with scene.start."
            )

    def _event(self, begin: Point, reached: Point, dense: Callable) -> tuple[Point, tuple[int, ...]] | None:
        """Point at the first event of a step, and the gap that was hit; None if nothing happens in it."""
        phase = self.phase
        t0, t1 = begin.state.t, reached.state.t
        hit = first_hit(lambda t: self.widths(dense(t)[0]), t0, t1, phase.open)
        last = hit[0] if hit else t1
        opened = self._opening(dense, t0, last) if phase.held.size else None
        if opened is None and hit is None:
            return None
        t = last if opened is None else opened
        state, work = dense(t)
        state = self.settle(state)
        return Point(state, work, reached.rates), ((hit[1],) if opened is None else ())

    def _opening(self, dense: Callable, begin: float, end: float) -> float | None:
        """Time in a step from which a closed gap would have to be pulled."""

        def opens(t: float) -> bool:
            state, held = self.settle(dense(t)[0]), self.phase.held
            return not self.phase.pushes(state) and staying(self.system, state, held, self.backend).size < held.size

        for looked in np.linspace(begin, end, OPENING_LOOKS + 1)[1:]:
            if opens(looked):
                return first_true(opens, begin, looked)
            begin = looked
        return None

    def _next_phase(self, point: Point, hits: tuple[int, ...]) -> tuple[Point, bool]:
        """Point from which the next phase goes on, once it is chosen, and whether an impact has changed the rates."""
        state, work = point.state, point.work
        width, rate = self.widths(state)
        touching = np.union1d(np.flatnonzero(width <= TOUCHING), np.array(hits, dtype=int))
        closing = touching[rate[touching] < -resting(state)]
        if closing.size:
            state, loss = impact(self.system, state, touching, self.restitution, self.backend)
            work = work + np.array([0.0, 0.0, loss])
            self._note(state.t, "impact", closing, loss)
            rate = self.widths(state)[1]
        held = staying(self.system, state, touching[rate[touching] <= resting(state)], self.backend)
        before = self.phase.held if self.phase else np.zeros(0, dtype=int)
        self._note(state.t, "opens", np.setdiff1d(before, held))
        self._note(state.t, "closes", np.setdiff1d(held, before))
        key = tuple(held)
        if key not in self.phases:
            self.phases[key] = Phase(self.system, held, self.backend)
        self.phase = self.phases[key]
        state = self.settle(state)
        return Point(state, work, self.phase.solver.rates(self.phase.system, state)), bool(closing.size)

    def _note(self, t: float, kind: str, which: np.ndarray, loss: float = 0.0):
        if which.size:
            self.events.append(Event(float(t), kind, tuple(self.names[i] for i in which), loss))

    def _trajectory(self, kept, samples, began: float) -> Trajectory:
        solvers = [self.solver, *(phase.solver for phase in self.phases.values())]
        whole = super()._trajectory(kept, samples, began)
        stats = replace(
            whole.stats,
            evaluations=sum(solver.evaluations for solver in solvers),
            worst_error=max(solver.worst_error for solver in solvers),
            method=f"{len(self.phases)} phases between events; {self.solver.method}",
        )
        return replace(whole, stats=stats, events=tuple(self.events))
