"""Event-driven integration with unilateral and set-valued elements: smooth phases between located events.

A phase is the scene of one contact mode: active unilateral constraints and sticking elements are bilateral constraints,
sliding ones are loads, inactive ones are dropped. It ends when an open gap closes (an impact, by least compulsion of
velocities), when the multiplier of a closed one changes sign (it opens), when features in contact separate, as a corner and
a face at its rim, when the force of a sticking element exceeds its limit (it slips), when a sliding one comes to rest, when
backlash sides of an elastic link touch or separate, and when the power flow through a link with losses reverses, or its
drive stops. All events are located on the dense output of the step. The next mode is that of the compulsion with rows
G x ≤ h and limited forces (Brogliato, Nonsmooth Mechanics, 3rd ed., 7.1: event-driven schemes).
"""

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from gauss.dynamics.consistent_states import project
from gauss.dynamics.constraint_scales import gap_scales
from gauss.dynamics.contact.impact import impact, resting
from gauss.dynamics.contact.mode_selection import mode_selector
from gauss.dynamics.contact.unilateral import ActiveSetKernel
from gauss.dynamics.engines.certified import CertifiedEngine
from gauss.dynamics.gap_functions import TOUCHING, gap_kernel
from gauss.dynamics.kinematics import Kinematics, kinematics
from gauss.dynamics.laws.switching_times import NO_TIMES, Timetable
from gauss.dynamics.store import cached_on_disk
from gauss.errors import SimulationError, StateError
from gauss.integrators import Controlled, Point, Rates, crossed_time
from gauss.simulation.motion_records import Event
from gauss.simulation.phases.event_location import first_hit, first_negative, first_true
from gauss.simulation.phases.phase import Phase
from gauss.simulation.prescribed import booked, of_impact
from gauss.simulation.problem import Problem
from gauss.simulation.python_run import PythonRun
from gauss.simulation.trajectory import Trajectory
from gauss.system import ContactMode, State, guards, sides

ZENO_EVENTS = 200  # events within ZENO_TIME: more of them do not come to an end
ZENO_TIME = 1e-9  # relative to the duration
FORCE_CHECKS = 2  # checks of forces in a step: each costs a solution
FORCE_CHECKS_OF_LONG_STEPS = 6  # the same in a step as long as a cell of the mesh of the laws of time
DEEPEST = 1e-6  # penetration of a start, relative to the size of the gap, above which it is refused

# Changes of the contact mode by field: kind of event, and its condition on the values (before, after).
CHANGES = {
    "set_valued": {"slips": lambda old, new: new and new != old, "holds": lambda old, new: old and not new},
    "power_flow": {"power reversal": lambda old, new: old * new < 0},
    "trains": {"starts": lambda old, new: not old and new, "stuck": lambda old, new: old and not new},
    "backlash_sides": {"contact": lambda old, new: new and not old, "separate": lambda old, new: old and not new},
}

REVERSED_RATE = 1e-5  # relative to the rate at rest: a smaller reversed rate is rounding


class EventDrivenRun(PythonRun):
    """Motion of a system with unilateral or set-valued elements.

    Parameters
    ----------
    problem : Problem
        Initial value problem of the whole system, with an adaptive method; its backend solves accelerations, impacts and
        contact problems.
    """

    def __init__(self, problem: Problem):
        system, p = problem.system, problem
        super().__init__(system, p.method, CertifiedEngine(p.backend), p.tolerance, p.step, p.end, switching=p.switching)
        self.backend, self.selector = p.backend, mode_selector(system)
        self.sides = sides(system.scene)
        self.names = [side.name for side in self.sides]
        self.guarded = [guard.name for guard in guards(system.scene)]
        self.restitution = np.array([side.whole.restitution for side in self.sides])
        self.sizes = np.concatenate([gap_scales(system), np.full(len(self.guarded), system.scale.length)])
        self.kernel = cached_on_disk(system, (gap_kernel,), lambda: gap_kernel(system)) if self.names else None
        self.active_set = self._active_set()
        self.phases: dict[tuple, Phase] = {}
        self.started: Phase | None = None
        self.backlash_sides: dict[str, int] = {}

    def evaluate(self, state: State) -> Rates:
        """Zero rates: the engines of the phases compute them."""
        return Rates(np.zeros(self.system.n_v), np.zeros(self.powers))

    @property
    def phase(self) -> Phase:
        """Present phase."""
        assert self.started is not None
        return self.started

    def project(self, state: State) -> State:
        """State projected onto the constraints of the phase."""
        return self.phase.solver.project(self.phase.system, state) if self.started else project(self.system, state)

    def _active_set(self) -> ActiveSetKernel | None:
        """Compiled active-set kernel of the contacts, where these are the only non-smooth elements."""
        others = self.selector.names or self.selector.losses or self.selector.trains
        if self.backend != "auto" or others or not self.names:
            return None
        return ActiveSetKernel(self.system)

    def _gaps(self, state: State) -> np.ndarray:
        """Gap functions and their rates (2, m)."""
        return self._gaps_and_guards(state)[:, : len(self.names)]

    def _gaps_and_guards(self, state: State) -> np.ndarray:
        """Gap functions and their rates, then those of all guards."""
        return np.zeros((2, 0)) if self.kernel is None else self.kernel(packed(state)).reshape(2, -1)

    def adaptive(self, method: Controlled, point: Point) -> Iterator:
        """Accepted points of all phases; at an impact two of the same time, before and after."""
        self._refuse_penetration(point.state, DEEPEST, "move it out with scene.start")
        self.backlash_sides = self.selector.backlash_sides(point.state)
        self.latest, self.at_once = point.state.t, 0
        switches = Timetable(self.switching.times.switches, NO_TIMES.mesh)
        after, jumped = self._next_phase(point, ())
        if jumped:
            yield after, None
        while after.state.t < self.end:
            stop, onward = next(stop for stop in switches.stops(after.state.t, self.end) if stop[1] > after.state.t)
            point, event, run = after, None, self._phase_run(stop)
            for reached in self._smooth(run, method, after):
                point, dense, event = reached
                yield point, dense
            if not event and stop >= self.end:
                return
            after, jumped = (
                self._next_phase(*event) if event else self._next_phase(crossed_time(run, point, onward), (), stop)
            )
            if jumped:
                yield after, None
            self._refuse_zeno(after.state.t, bool(event))

    def _phase_run(self, stop: float) -> PythonRun:
        """Run of the present phase up to a time."""
        mesh, watch = Timetable(NO_TIMES.switches, self.switching.times.mesh), self.phase.watch
        switching = self.switching._replace(times=mesh, watch=watch.machine_code if watch else None)
        return PythonRun(
            self.phase.system, self.method, self.phase.solver, self.tolerance, self.step, stop, switching=switching
        )

    def _smooth(self, run: PythonRun, method: Controlled, begin: Point) -> Iterator:
        """Accepted points of a phase, with dense output; the last one with the event that ends the phase."""
        for reached, dense in run.adaptive(method, begin):
            self.steps += 1
            run.solver = self.phase.solver
            event = self._event(begin, reached, dense)
            begin = event[0] if event else reached
            self._refuse_penetration(begin.state, self._deepest(), "an impact is undetected: limit the step with step= [s]")
            yield begin, dense, event
            if event:
                break
        self.rejected += run.rejected

    def _refuse_zeno(self, t: float, event: bool):
        """Raise a SimulationError where events accumulate (Zeno behaviour)."""
        self.at_once = self.at_once + 1 if event and t - self.latest <= ZENO_TIME * self.end else 0
        self.latest = self.latest if self.at_once else t
        if self.at_once > ZENO_EVENTS:
            names = ", ".join(self.events[-1].gaps if self.events else self.system.scene.nonsmooth)
            raise SimulationError(
                f"t = {self.latest:.6g} s: impacts and contacts of {names} do not come to an end: more than {ZENO_EVENTS} "
                f"events within {ZENO_TIME:g} of the duration. Try integrator='time_stepping'."
            )

    def _refuse_penetration(self, state: State, deepest: float, remedy: str):
        width = self._gaps_and_guards(state)[0]
        if not np.isfinite(width).all():
            name = [*self.names, *self.guarded][int(np.flatnonzero(~np.isfinite(width))[0])]
            raise StateError(f"t = {state.t:.6g} s: the gap of {name!r} has no finite value.")
        worst = int(np.argmin(width / self.sizes)) if width.size else 0
        if width.size and width[worst] < -deepest * self.sizes[worst]:
            name = [*self.names, *self.guarded][worst]
            raise StateError(f"t = {state.t:.6g} s: {-width[worst]:.3g} [m, rad] inside of {name!r}; {remedy}.")

    def _deepest(self) -> float:
        """Allowed penetration during the motion, relative to the size of a gap: at least the tolerance."""
        return max(DEEPEST, self.tolerance.share(self.system))

    def _event(self, begin: Point, reached: Point, dense: Callable) -> tuple[Point, tuple[int, ...]] | None:
        """Point at the first event of a step, and the gap that closes; None without an event.

        Events of each kind are looked for up to the first one of the kinds before: closing gaps; sliding elements that come
        to rest and features that separate; backlash sides; released constraints.
        """
        t0, last, first = begin.state.t, reached.state.t, ""
        hit = first_hit(lambda t: self._gaps_and_guards(dense(t)[0]) / self.sizes, t0, last, self._open())
        if hit:
            last, first = hit[0], "hit"
        change = self._change(dense, t0, last)
        if change is not None:
            last, first = change, "change"
        side_change = self._backlash_change(dense, t0, last)
        if side_change:
            last, first = side_change[0], "backlash side"
        release = self._release(dense, t0, last) if self.phase.may_end else None
        if release is not None:
            last, first = release, "release"
        if not first:
            return None
        state, work = dense(last)
        state = self.project(state)
        if side_change and first == "backlash side":
            self._switch_backlash_side(side_change[1], state)
        return Point(state, work, reached.rates), (hit[1],) if hit and first == "hit" else ()

    def _change(self, dense: Callable, begin: float, end: float) -> float | None:
        """First time in a step at which a sliding element comes to rest, or features in contact separate."""
        times = self._standstill(dense, begin, end), self._separation(dense, begin, end)
        return min((t for t in times if t is not None), default=None)

    def _backlash_change(self, dense: Callable, begin: float, end: float) -> tuple[float, int] | None:
        """First time in a step at which a backlash side touches or separates, and the index of its link."""
        margins = lambda t: self._backlash_margins(dense(t)[0])  # noqa: E731
        return first_negative(margins, begin, end) if self.selector.backlashes else None

    def _open(self) -> np.ndarray:
        """Indices of the open gaps, and of the guards of contacts without a closed one."""
        busy = {self.sides[i].whole.name for i in self.phase.held}
        guards = [len(self.names) + k for k, name in enumerate(self.guarded) if name not in busy]
        return np.concatenate([self.phase.open, guards]).astype(int)

    def _standstill(self, dense: Callable, begin: float, end: float) -> float | None:
        """Time in a step at which a sliding element, or a train with losses, comes to rest.

        A sliding element that a drive keeps at rest beyond its limit has rates of rounding, as a train that starts away from
        a stop which has not opened yet.
        """
        selector, mode = self.selector, self.phase.mode
        in_trains = np.array([name in selector.train_friction for name in selector.names], dtype=bool)
        slipping = np.flatnonzero((self.phase.signs != 0) & selector.sticks & ~in_trains)
        directions = np.array([mode.trains[train.root] for train in selector.trains], dtype=int)
        turning = np.flatnonzero(directions)
        if not slipping.size and not turning.size:
            return None

        def onward(t: float) -> np.ndarray:
            state = dense(t)[0]
            slides, turns = selector.rates(state)[slipping], selector.turning(state)[turning]
            return np.concatenate([-self.phase.signs[slipping] * slides, directions[turning] * turns])

        def rounding(t: float) -> np.ndarray:
            sizes = np.concatenate([selector.sizes[slipping], selector.roots[turning]])
            return REVERSED_RATE * resting(self.system, dense(t)[0].v) * sizes

        found = first_negative(onward, begin, end, rounding)
        return None if found is None else found[0]

    def _backlash_margins(self, state: State) -> np.ndarray:
        """Distance of links with backlash from contact or separation of their sides, relative to a radian of strain."""
        motion, margins = Kinematics(self.system, state), []
        for name, play in self.selector.backlashes.items():
            touch, side = _contact_margins(play, motion), self.backlash_sides[name]
            margins.append(touch[side] if side else -max(touch.values()))
        return np.array(margins)

    def _switch_backlash_side(self, link: int, state: State):
        """Change the backlash side in contact of an elastic link with backlash."""
        name = list(self.selector.backlashes)[link]
        touch = _contact_margins(self.selector.backlashes[name], Kinematics(self.system, state))
        self.backlash_sides = self.backlash_sides | {
            name: 0 if self.backlash_sides[name] else max(touch, key=lambda side: touch[side])
        }

    def _separation(self, dense: Callable, begin: float, end: float) -> float | None:
        """Time in a step at which features in contact separate, as a corner and a face at its rim."""
        margins = self.phase.margins
        if margins is None:
            return None
        found = first_negative(lambda t: margins(packed(dense(t)[0])), begin, end)
        return None if found is None else found[0]

    def _release(self, dense: Callable, begin: float, end: float) -> float | None:
        """Time in a step from which a closed gap would pull, or a sticking element exceeds its limit."""

        def released(t: float) -> bool:
            state = dense(t)[0]
            state = self.project(state) if self.phase.asks_forces else state
            stay = None if self.active_set is None or self.phase.margins else self.active_set(state, self.phase.held)
            if stay is not None:
                return stay.size < self.phase.held.size
            return not self.phase.holds(state) and self._choose(state, self.phase.held) != self.phase.case

        for checked in np.linspace(begin, end, self._force_checks(begin, end) + 1)[1:]:
            if released(checked):
                return first_true(released, begin, checked)
            begin = checked
        return None

    def _force_checks(self, begin: float, end: float) -> int:
        """Number of checks of forces in a step: more where it is as long as a cell of the mesh of the laws of time."""
        edges = self.switching.times.mesh
        place = int(np.searchsorted(edges, 0.5 * (begin + end)))
        low, high = edges[place - 1] if place else -np.inf, edges[place] if place < len(edges) else np.inf
        return FORCE_CHECKS_OF_LONG_STEPS if 2.0 * (end - begin) > high - low else FORCE_CHECKS

    def _choose(self, state: State, touching: np.ndarray) -> tuple:
        """Contact mode: gaps that stay closed, and the state of all other elements."""
        if not touching.size and not self.selector.names and not self.selector.losses:
            return (), ContactMode(backlash_sides=self.backlash_sides)
        stay = None if self.active_set is None else self.active_set(state, touching)
        if stay is not None:
            return tuple(stay.tolist()), ContactMode(backlash_sides=self.backlash_sides)
        return self.selector.choose(state, touching, self.backend, self.backlash_sides).case

    def _next_phase(self, point: Point, hits: tuple[int, ...], since: float | None = None) -> tuple[Point, bool]:
        """Initial point of the next phase, and whether an impact precedes it.

        After a switching time, ``since`` is the time just before it.
        """
        state, work = point.state, point.work
        driven: tuple[str, ...] = ()
        if since is not None:
            self._refuse_penetration(state, DEEPEST, "it jumps there: let it change gradually")
            driven = self.switching.jumps.names(replace(state, t=since), state.t)
        width, rate = self._gaps(state)
        sizes, slow = self.sizes[: len(self.names)], resting(self.system, state.v)
        touching = np.union1d(
            np.flatnonzero(width <= TOUCHING * sizes), np.array([i for i in hits if i < len(self.names)], dtype=int)
        )
        closing = touching[rate[touching] < -slow * sizes[touching]]
        caught = self.selector.engaging(state)
        jumps = bool(closing.size or caught.size or driven)
        if jumps:
            happened = impact(self.system, state, touching, self.restitution, self.backend, since, driven)
            state, work = happened.state, booked(work, happened)
            hit = [self.names[i] for i in closing] + [self.selector.names[i] for i in caught]
            self.events.append(of_impact(state.t, [*hit, *driven], happened))
            rate, slow = self._gaps(state)[1], resting(self.system, state.v)
        case = self._choose(state, touching[rate[touching] <= slow * sizes[touching]])
        self._note_changes(state.t, case)
        work = work + np.array([0.0, 0.0, self._lost_backlash_energy(state, case[1])])
        places = self._places(state, case[0])
        key = case, tuple(places.items())
        if key not in self.phases:
            self.phases[key] = Phase(self.selector, case[0], case[1], places, self.backend)
        self.started = self.phases[key]
        state = self.project(state)
        return Point(state, work, self.phase.solver.rates(self.phase.system, state)), jumps

    def _places(self, state: State, held: tuple[int, ...]) -> dict:
        """Features in contact by name of the closed gap, where a body has several."""
        motion = kinematics(self.system, state)
        found = {side.name: side.whole.fixed(motion, side.index) for side in (self.sides[i] for i in held)}
        return {name: place for name, place in found.items() if place is not None}

    def _note_changes(self, t: float, case: tuple):
        """Record the events of the change from the present phase to the next."""
        before = self.started.case if self.started else ((), case[1])
        for kind, gone, left in (("opens", before[0], case[0]), ("closes", case[0], before[0])):
            self._note(t, kind, [self.names[i] for i in gone if i not in left])
        for key, kinds in CHANGES.items():
            old, new = getattr(before[1], key), getattr(case[1], key)
            for kind, happens in kinds.items():
                self._note(t, kind, [name for name, now in new.items() if happens(old[name], now)])

    def _lost_backlash_energy(self, state: State, mode: ContactMode) -> float:
        """Elastic energy of backlash sides that separate [J], which is dissipated."""
        before, motion = self.phase.mode.backlash_sides if self.started else {}, Kinematics(self.system, state)
        parted = [name for name, side in before.items() if side and not mode.backlash_sides[name]]
        backlashes = self.selector.backlashes
        return sum(float(backlashes[name].stored(backlashes[name].ends(motion)[0], before[name])) for name in parted)

    def _note(self, t: float, kind: str, names: list[str]):
        if names:
            self.events.append(Event(float(t), kind, tuple(names)))

    def _trajectory(self, kept, samples, began: float) -> Trajectory:
        solvers = [self.solver, *(solver for phase in self.phases.values() for solver in phase.solvers)]
        compiled = sum(phase.compiled for phase in self.phases.values())
        whole = super()._trajectory(kept, samples, began)
        stats = whole.stats._replace(
            evaluations=sum(solver.evaluations for solver in solvers),
            worst_error=max(solver.error for solver in solvers),
            rescued=sum(solver.rescued for solver in solvers),
            method=f"{len(self.phases)} phases between events, {compiled} of them compiled; else {self.solver.name}",
        )
        return replace(whole, stats=stats)


def _contact_margins(play, motion: Kinematics) -> dict[int, float]:
    """Margin of contact of both backlash sides of an elastic link with backlash, by side; positive in contact."""
    return {side: play.touch(*play.ends(motion), side) for side in (-1, 1)}


def packed(state: State) -> np.ndarray:
    """State as one vector (t, q, v)."""
    return np.concatenate([[state.t], state.q, state.v])
