"""Motion with one-sided constraints and grips: phases between events, each a mechanism of its own.

While a gap stays closed, or a grip holds, it is a constraint like any other; while a grip slips, it is a load. So a phase is
the scene with these constraints and loads and without what is open: smooth, solved and projected as every mechanism is. A
phase ends when an open gap closes (an impact, by least compulsion of velocities), when a closed one would have to be pulled
(it opens), when features that touch part, as a corner and a face at
its rim, when a grip takes more than its limit (it slips), or comes to a standstill. All are located on the dense output
of the step. What holds afterwards is decided by the compulsion with rows G x ≤ h and limited grips.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace

import numpy as np

from gauss.assembly import assemble, gap_kernel, kinematics, margin_kernel
from gauss.assembly.gaps import TOUCHING
from gauss.backends import solve
from gauss.dynamics.consistent import project
from gauss.dynamics.drift import Drift
from gauss.dynamics.dynamics import OnDemand
from gauss.dynamics.holding import grip_forces
from gauss.dynamics.impact import impact, resting
from gauss.dynamics.laws import Laws
from gauss.dynamics.program import Program
from gauss.dynamics.solver import Solver
from gauss.dynamics.traced import Traced
from gauss.errors import SimulationError, StateError
from gauss.integrators import Controlled, Point, Rates, Tolerance
from gauss.simulation.crossing import first_hit, first_negative, first_true
from gauss.simulation.instant import holder_of
from gauss.simulation.run import Run
from gauss.simulation.trajectory import Event, Trajectory
from gauss.system import State, System, build, guards, obstacles, phase_scene, sides

MOST_AT_ONCE = 200  # events within the shortest time: more of them do not come to an end
SHORTEST = 1e-9  # of the duration
LOOKS_AT_FORCES = 2  # into each step, for what holds and lets go: each costs a solution
PATIENCE = 600  # evaluations of a phase by numpy that cost about as much as its machine code does once
DEEPEST = 1e-6  # [m, rad]: a start deeper in a contact than this is a mistake


class Phase:
    """One mechanism between two events.

    Parameters
    ----------
    whole : System
        With its one-sided constraints and grips.
    held : tuple of int
        Numbers of its gaps that are closed.
    grips : tuple of int
        What its grips do, see :class:`gauss.dynamics.holding.Holding`.
    places : mapping
        By name of a gap, the features that touch there, where there are others.
    backend : str
        How accelerations are solved.
    """

    def __init__(self, whole: System, held: tuple[int, ...], grips: tuple[int, ...], places: Mapping, backend: str):
        names = [whole.contacts.placed[i].name for i in held]
        self.case, self.held, self.grips = (held, grips), np.array(held, dtype=int), np.array(grips, dtype=int)
        self.open = np.setdiff1d(np.arange(len(whole.contacts.placed)), held)
        self.names, self.limits = tuple(whole.scene.grips), np.array([g.limit for g in whole.scene.grips.values()])
        told = dict(zip(self.names, grips, strict=True))
        self.system = build(phase_scene(whole.scene, names, told, places), OnDemand())
        self.margins = margin_kernel(whole, list(places.values())) if places else None
        self.backend, self.solvers = backend, [Solver(backend)]
        self.may_compile = backend == "auto" and not obstacles(self.system)
        rows = {constraint.name: constraint.rows for constraint in self.system.structure.constraints}
        self.rows = np.array([rows[name].start for name in names], dtype=int)

    @property
    def solver(self) -> Solver | Traced:
        """Where its accelerations come from: numpy first, machine code once there is enough to do for it."""
        if self.may_compile and self.solvers[0].evaluations >= PATIENCE:
            self.may_compile = False
            laws = Laws(self.system)
            if not laws.called:
                self.solvers.append(Traced(self.system, Program(self.system, laws, Drift()).kernels(), ()))
        return self.solvers[-1]

    @property
    def may_end(self) -> bool:
        """Whether something in it holds that could let go."""
        return bool(self.held.size or (self.grips == 0).any())

    def holds(self, state: State) -> bool:
        """Whether forces that push, within their limits, hold what holds; if not, others may, where rows are redundant."""
        solution = solve(assemble(self.system, state), self.backend)
        force = grip_forces(self.system, self.names, self.grips, self.limits, solution)
        return bool((solution.multipliers[self.rows] <= 0.0).all() and (np.abs(force) <= self.limits).all())


class PhasedRun(Run):
    """Simulation of a system with one-sided constraints or grips while it runs.

    Parameters
    ----------
    system : System
        With its one-sided constraints and grips.
    method : Controlled
        How it is stepped.
    backend : str
        How accelerations, impacts and contacts are solved.
    tolerance, step, end
        As of a :class:`Run`.
    """

    def __init__(self, system: System, method: Controlled, backend: str, tolerance: Tolerance, step, end: float):
        super().__init__(system, method, Solver(backend), tolerance, step, end)
        self.backend, self.holder = backend, holder_of(system)
        self.sides = sides(system.scene)
        self.names = [side.name for side in self.sides]
        self.guarded = [guard.name for guard in guards(system.scene)]
        self.restitution = np.array([side.whole.restitution for side in self.sides])
        self.kernel = system.dynamics.on_demand("gaps", lambda: gap_kernel(system)) if self.names else None
        self.phases: dict[tuple, Phase] = {}
        self.phase: Phase | None = None
        self.events: list[Event] = []

    def evaluate(self, state: State) -> Rates:
        """No rates: every phase has its own."""
        return Rates(np.zeros(self.system.n_v), np.zeros(self.powers))

    def settle(self, state: State) -> State:
        """State on the constraints of the phase."""
        return project(self.phase.system if self.phase else self.system, state)

    def widths(self, state: State) -> np.ndarray:
        """Widths and rates of all gaps (2, m)."""
        return self._watched(state)[:, : len(self.names)]

    def _watched(self, state: State) -> np.ndarray:
        """Widths and rates of all gaps, then of all guards."""
        return np.zeros((2, 0)) if self.kernel is None else self.kernel(flat(state)).reshape(2, -1)

    def adaptive(self, method: Controlled, point: Point) -> Iterator:
        """Accepted steps of all phases; at an impact the same time twice, before and after."""
        self._refuse_penetration(point.state, DEEPEST, "move it out with scene.start")
        latest, at_once = point.state.t, 0
        after, jumped = self._next_phase(point, ())
        if jumped:
            yield after, None
        while after.state.t < self.end:
            point = after
            run = Run(self.phase.system, method, self.phase.solver, self.tolerance, self.step, self.end)
            for reached, dense in run.adaptive(method, after):
                self.steps += 1
                run.solver = self.phase.solver
                event = self._event(point, reached, dense)
                point = event[0] if event else reached
                coarse = max(DEEPEST, self.tolerance.rtol)  # a coarse tolerance may leave gaps as coarse
                self._refuse_penetration(point.state, coarse, "an impact was missed: limit the step with step= [s]")
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

    def _refuse_penetration(self, state: State, deepest: float, remedy: str):
        width = self._watched(state)[0]
        worst = int(np.argmin(width)) if width.size else 0
        if width.size and width[worst] < -deepest:
            name = [*self.names, *self.guarded][worst]
            raise StateError(f"t = {state.t:.6g} s: {-width[worst]:.3g} [m, rad] inside of {name!r}; {remedy}.")

    def _event(self, begin: Point, reached: Point, dense: Callable) -> tuple[Point, tuple[int, ...]] | None:
        """Point at the first event of a step, and the gap that was hit; None if nothing happens in it."""
        phase = self.phase
        t0, t1 = begin.state.t, reached.state.t
        hit = first_hit(lambda t: self._watched(dense(t)[0]), t0, t1, self._open())
        last = hit[0] if hit else t1
        changes = [self._standstill(dense, t0, last), self._parting(dense, t0, last)]
        change = min((t for t in changes if t is not None), default=None)
        last = last if change is None else change
        let_go = self._letting_go(dense, t0, last) if phase.may_end else None
        if let_go is None and change is None and hit is None:
            return None
        state, work = dense(last if let_go is None else let_go)
        return Point(self.settle(state), work, reached.rates), ((hit[1],) if let_go is None and change is None else ())

    def _open(self) -> np.ndarray:
        """Numbers of the gaps that are open, and of the guards of contacts that have no other."""
        busy = {self.sides[i].whole.name for i in self.phase.held}
        guards = [len(self.names) + k for k, name in enumerate(self.guarded) if name not in busy]
        return np.concatenate([self.phase.open, guards]).astype(int)

    def _standstill(self, dense: Callable, begin: float, end: float) -> float | None:
        """Time in a step when a grip that slips comes to a standstill."""
        slipping = np.flatnonzero(self.phase.grips)
        if not slipping.size:
            return None
        onward = -self.phase.grips[slipping]
        return first_negative(lambda t: onward * self.holder.rates(dense(t)[0])[slipping], begin, end)

    def _parting(self, dense: Callable, begin: float, end: float) -> float | None:
        """Time in a step when features that touch part, as a corner and a face at its rim."""
        if self.phase.margins is None:
            return None
        return first_negative(lambda t: self.phase.margins(flat(dense(t)[0])), begin, end)

    def _letting_go(self, dense: Callable, begin: float, end: float) -> float | None:
        """Time in a step from which a closed gap would have to be pulled, or a grip takes more than its limit."""

        def lets_go(t: float) -> bool:
            state = self.settle(dense(t)[0])
            return not self.phase.holds(state) and self._choose(state, self.phase.held) != self.phase.case

        for looked in np.linspace(begin, end, LOOKS_AT_FORCES + 1)[1:]:
            if lets_go(looked):
                return first_true(lets_go, begin, looked)
            begin = looked
        return None

    def _choose(self, state: State, touching: np.ndarray) -> tuple:
        """Gaps that stay closed, and what grips do."""
        if not touching.size and not self.holder.names:
            return (), ()
        return self.holder.choose(state, touching, self.backend).case

    def _next_phase(self, point: Point, hits: tuple[int, ...]) -> tuple[Point, bool]:
        """Point from which the next phase goes on, once it is chosen, and whether an impact has changed the rates."""
        state, work = point.state, point.work
        width, rate = self.widths(state)
        hits = [i for i in hits if i < len(self.names)]
        touching = np.union1d(np.flatnonzero(width <= TOUCHING), np.array(hits, dtype=int))
        closing = touching[rate[touching] < -resting(state)]
        if closing.size:
            state, loss = impact(self.system, state, touching, self.restitution, self.backend)
            work = work + np.array([0.0, 0.0, loss])
            self._note(state.t, "impact", [self.names[i] for i in closing], loss)
            rate = self.widths(state)[1]
        case = self._choose(state, touching[rate[touching] <= resting(state)])
        self._note_changes(state.t, case)
        places = self._places(state, case[0])
        key = case, tuple(places.items())
        if key not in self.phases:
            self.phases[key] = Phase(self.system, *case, places, self.backend)
        self.phase = self.phases[key]
        state = self.settle(state)
        return Point(state, work, self.phase.solver.rates(self.phase.system, state)), bool(closing.size)

    def _places(self, state: State, held: tuple[int, ...]) -> dict:
        """Features that touch at closed gaps, where there are others, by name of the gap."""
        motion = kinematics(self.system, state)
        found = {side.name: side.whole.fixed(motion, side.index) for side in (self.sides[i] for i in held)}
        return {name: place for name, place in found.items() if place is not None}

    def _note_changes(self, t: float, case: tuple):
        """Events of a change from the phase at hand to the next."""
        before = self.phase.case if self.phase else ((), case[1])
        for kind, gone, left in (("opens", before[0], case[0]), ("closes", case[0], before[0])):
            self._note(t, kind, [self.names[i] for i in gone if i not in left])
        changes = list(zip(self.holder.names, before[1], case[1], strict=True))
        self._note(t, "slips", [name for name, old, new in changes if new and new != old])
        self._note(t, "holds", [name for name, old, new in changes if old and not new])

    def _note(self, t: float, kind: str, names: list[str], loss: float = 0.0):
        if names:
            self.events.append(Event(float(t), kind, tuple(names), loss))

    def _trajectory(self, kept, samples, began: float) -> Trajectory:
        solvers = [self.solver, *(solver for phase in self.phases.values() for solver in phase.solvers)]
        compiled = sum(len(phase.solvers) > 1 for phase in self.phases.values())
        whole = super()._trajectory(kept, samples, began)
        stats = replace(
            whole.stats,
            evaluations=sum(solver.evaluations for solver in solvers),
            worst_error=max(solver.worst_error for solver in solvers),
            rescued=sum(solver.rescued for solver in solvers),
            method=f"{len(self.phases)} phases between events, {compiled} of them compiled; else {self.solver.method}",
        )
        return replace(whole, stats=stats, events=tuple(self.events))


def flat(state: State) -> np.ndarray:
    """Time, coordinates and rates, one after the other."""
    return np.concatenate([[state.t], state.q, state.v])
