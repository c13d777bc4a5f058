"""Phases of an optimal motion: conditions, guesses and impacts of each, from which the problems of collocation are made."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gauss.analysis.optimal.conditions import (
    EndCondition,
    MotionEnd,
    end_of,
    entries,
    increments,
    motion_limits,
    refuse_beyond,
    value_range,
)
from gauss.analysis.optimal.contact_set import ContactSet, impact_between
from gauss.analysis.optimal.equations import Casadi, OptimalEquations
from gauss.analysis.optimal.guess import first_guess
from gauss.analysis.optimal.meshes import law_mesh
from gauss.analysis.optimal.problem import MotionProblem, MotionValues
from gauss.errors import ArgumentError, did_you_mean, extra
from gauss.simulation.tolerances import check_tolerances
from gauss.system import State, System

COSTS: dict[str, Callable | None] = {"effort": lambda t, q, v, u: u @ u, "time": None}
ORDERS = (2, 4, 6, 8, 10)
SWINGS = 4.0  # times of the scene, guess of a duration without upper limit


@dataclass(frozen=True)
class MotionPhase:
    """Phase of an optimal motion: which gaps are closed in it, how long it may last, where it ends.

    Parameters
    ----------
    duration : float or tuple of float
        Duration, or the least and the largest one [s].
    closed : str or sequence of str
        Stops, ropes and contacts that are closed all along; their forces push, and rough contacts stick. Those that are open
        in the phase before it close at its start, without rebound.
    struck : str or sequence of str
        Those that close at its start and rebound, by their coefficients of restitution; they are open after it.
    end : State or mapping of str to float or tuple of float, optional
        State at its end, or conditions by name as for :func:`gauss.optimal_motion`; free when not given.
    guess : OptimalMotion or Trajectory, optional
        Motion near the optimum; straight lines between the ends when not given.
    """

    duration: float | tuple[float, float]
    closed: str | Sequence[str] = ()
    struck: str | Sequence[str] = ()
    end: State | Mapping | None = None
    guess: object = None


@dataclass(frozen=True)
class MeshSettings:
    """How phases are discretised and solved; as for :func:`gauss.optimal_motion`.

    ArgumentError if one is no number of its kind.

    Parameters
    ----------
    intervals, order, refinements, iterations : int
        Intervals of the first mesh of a phase, order of the collocation, most refinements, most iterations.
    tolerance : float
        Largest error of an interval.
    """

    intervals: int
    order: int
    tolerance: float
    refinements: int
    iterations: int

    def __post_init__(self):
        """Refuse settings that are no numbers of their kind."""
        for name, least in (("intervals", 1), ("refinements", 0), ("iterations", 1)):
            value = getattr(self, name)
            if not isinstance(value, int | np.integer) or isinstance(value, bool) or value < least:
                raise ArgumentError(f"optimal motion: {name}: expected a whole number from {least} on, got {value!r}.")
        if self.order not in ORDERS:
            known = ", ".join(map(str, ORDERS))
            raise ArgumentError(f"optimal motion: order: expected one of {known}, got {self.order!r}.")
        check_tolerances(tolerance=self.tolerance)


class PhaseProblems:
    """Problems of collocation of a motion, and first guesses.

    ArgumentError, StateError, SimulationError as for :func:`gauss.optimal_motion`.

    Parameters
    ----------
    whole : System
        System with all its unilateral constraints.
    start : State, mapping or None
        Conditions on the start.
    periodic, reset, meets, cost, limits
        As for :func:`gauss.optimal_motion`.
    settings : MeshSettings
        Discretisation.

    Attributes
    ----------
    problems : list of MotionProblem
        Problem of each phase.
    guesses : list of MotionValues
        Their first guesses.
    """

    def __init__(
        self,
        whole: System,
        phases: Sequence[MotionPhase],
        settings: MeshSettings,
        start=None,
        periodic: bool | Mapping = False,
        reset: Callable | None = None,
        meets: Callable | None = None,
        cost: str | Callable = "effort",
        limits: Mapping | None = None,
    ):
        self.whole, self.phases, self.settings, self.cost = whole, phases, settings, cost
        self.closed = [ContactSet(whole, _names(phase.closed)) for phase in phases]
        self.struck = [ContactSet(whole, _names(phase.struck)) for phase in phases]
        of = {one.names: OptimalEquations(one.system) for one in self.closed}
        self.equations = [of[one.names] for one in self.closed]
        self.limits, system = {} if limits is None else limits, self.closed[0].system
        self.spans = [_span(phase.duration, cost, len(phases)) for phase in phases]
        near = system.initial_state()
        first = end_of(system, near if start is None else start, "start", near)
        shift = increments(system, periodic, first.guess)
        self.wraps = bool(shift) and reset is None
        self._refuse(reset, meets, bool(shift))
        self.problems, self.guesses, at = list[MotionProblem](), list[MotionValues](), first
        for k, span in enumerate(self.spans):
            problem, guess, at = self._of_phase(k, span, at, shift)
            self.problems.append(replace(problem, start=first.conditions) if not k else problem)
            self.guesses.append(guess)
        self.problems[-1] = self._with_end(self.problems[-1], self.equations[-1], reset, meets)

    def _of_phase(self, k: int, span: tuple[float, float], first: MotionEnd, shift):
        """Problem of a phase, its guess, and its end."""
        equations, settings, whole = self.equations[k], self.settings, self.whole
        shift = shift if k == len(self.phases) - 1 else ()
        touching = self._touching(k)
        last = self._last(k, touching, first, shift)
        bounds = motion_limits(whole, equations, self.limits)
        refuse_beyond({"start": first, "end": last}, *bounds[:2])
        law, times = _cost(equations, self.cost), (first.guess.t, span)
        conditions = (), last.conditions, shift
        problem = MotionProblem(whole, equations, law, *times, *conditions, bounds, settings.order // 2, settings.iterations)
        problem = replace(problem, **self._signed(k), **self._impact(k, touching))
        mesh = self._mesh(k, span, first.guess)
        fixed = [one.place for one in (*last.conditions, *shift) if one.is_fixed]
        between = (first.guess, last.guess), _led(whole, fixed), mesh, _middle(span, whole), problem.stages
        return problem, first_guess(equations, self.phases[k].guess, *between), last

    def _mesh(self, k: int, span: tuple[float, float], near: State) -> np.ndarray:
        """First mesh of a phase: equal intervals, divided where laws of time switch if it is known when it is."""
        before = self.spans[:k]
        if any(least != largest for least, largest in before):
            return np.linspace(0.0, 1.0, self.settings.intervals + 1)
        begin = State(near.t + sum(duration for duration, _ in before), near.q, near.v)
        return law_mesh(self.closed[k].system, begin, span, self.settings.intervals)

    def _last(self, k: int, touching: ContactSet | None, first: MotionEnd, shift: tuple[EndCondition, ...]) -> MotionEnd:
        """Conditions at the end of a phase, and a state near it."""
        last = _last(self.closed[k].system, self.phases[k].end, first, shift)
        if touching is None or not touching.less(self.closed[k]).names:
            return last
        return _closing((self.closed[k] | touching).system, last)

    def _signed(self, k: int) -> dict:
        """What is not negative in a phase, with its names, and at its start."""
        own, equations = self.closed[k], self.equations[k]
        found = {"gaps": own.open_gaps(equations), "forces": own.forces(equations)}
        found |= {"gap_labels": own.opened.gap_labels, "force_labels": own.force_labels}
        if (k or self.wraps) and not (own | self.struck[k]).less(self.closed[k - 1]).names:
            found["opens"] = own.pulls(equations, self.closed[k - 1])
        return found

    def _touching(self, k: int) -> ContactSet | None:
        """Gaps that are closed in the impact at the end of a phase; None where no other phase follows."""
        following = k + 1
        if following == len(self.phases):
            if not self.wraps:
                return None
            following = 0
        return self.closed[following] | self.struck[following]

    def _impact(self, k: int, touching: ContactSet | None) -> dict:
        """What a problem knows of the impact at the end of a phase."""
        if touching is None or not (closing := touching.less(self.closed[k])).names:
            return {}
        equations, following = self.equations[k], (k + 1) % len(self.phases)
        reset, bears = impact_between(equations, touching, self.struck[following], self.equations[following].units)
        names = [f"gap of {name}" for name in closing.names]
        meets = equations.in_units(lambda t, q, v, _: closing.widths(t, q, v), "closing")
        return {"reset": reset, "bears": bears, "meets": meets, "meeting": _met(equations, names)}

    def _refuse(self, reset, meets, is_periodic: bool):
        """Refuse functions of the end that are none, and impacts before which there is nothing."""
        if reset is not None and not is_periodic:
            raise ArgumentError(
                "optimal motion: reset: expected periodic= as well: the state after it is that of the start."
            )
        for what, given in (("reset", reset), ("meets", meets)):
            if given is not None and not callable(given):
                raise ArgumentError(f"optimal motion: {what}: expected a function of (q, v), got {given!r:.60}.")
        if self.struck[0].names and not self.wraps:
            raise ArgumentError(
                f"optimal motion: struck: {', '.join(map(repr, self.struck[0].names))} at the start of the first phase; "
                "expected a phase before it, or periodic=."
            )

    @staticmethod
    def _with_end(problem: MotionProblem, equations: OptimalEquations, reset, meets) -> MotionProblem:
        """The last problem, with the user's functions of its end."""
        if reset is not None:
            problem = replace(problem, reset=equations.at_end(reset, "reset", equations.units, equations.n_x))
        if meets is None:
            return problem
        met = equations.at_end(meets, "meets")
        names = [one.name for one in problem.meeting] + [f"meets[{k}]" for k in range(met.size1_out(0))]
        return replace(problem, meets=_both(problem.meets, met), meeting=_met(equations, names))


def _met(equations: OptimalEquations, names: list[str]) -> tuple[EndCondition, ...]:
    """Conditions on what is zero at an end."""
    return tuple(EndCondition(name, equations.n_x + k, 0.0, 0.0) for k, name in enumerate(names))


def _both(one: Casadi, other: Casadi) -> Casadi:
    """Values of two functions of (t, x, u), the first of which may be None."""
    import casadi

    if one is None:
        return other
    given = other.sx_in()
    return casadi.Function("both", given, [casadi.vertcat(one(*given), other(*given))])


def _names(given: str | Sequence[str]) -> tuple[str, ...]:
    """Names of one constraint, or of several."""
    return (given,) if isinstance(given, str) else tuple(given)


def _last(system: System, end, first: MotionEnd, shift: tuple[EndCondition, ...]) -> MotionEnd:
    """Conditions at the end, near the start, or a period after it."""
    x = np.concatenate([first.guess.q, first.guess.v])
    after = {one.name: x[one.place] + one.low for one in shift if one.low}
    near = end_of(system, after, "periodic", first.guess).guess if after else first.guess
    return end_of(system, end, "end", near)


def _led(system: System, fixed: list[int]) -> list[int]:
    """Of the places that are fixed at an end those of coordinates that are no parts of quaternions."""
    turning = {entry for place in system.quaternions.values() for entry in range(place.start, place.stop)}
    return [place for place in fixed if place < system.n_q and place not in turning]


def _closing(system: System, last: MotionEnd) -> MotionEnd:
    """End at which further gaps close, with those of the conditions on coordinates that do not follow from this."""
    known, n_q = entries(system), system.n_q
    places = {one.name: (one.low, one.high) for one in last.conditions if one.place < n_q and one.name in known}
    still = State(last.guess.t, last.guess.q, np.zeros(system.n_v))
    found = end_of(system, places, "end, where gaps close", still)
    kept = [one for one in last.conditions if one.place >= n_q or one.name not in known or one in found.conditions]
    return MotionEnd(tuple(kept), State(last.guess.t, found.guess.q, last.guess.v))


def _cost(equations: OptimalEquations, cost):
    """Cost per time as a function of CasADi; None for the time itself."""
    with extra("export"):
        import casadi  # noqa: F401
    if not callable(cost) and cost not in COSTS:
        raise ArgumentError(f"optimal motion: no cost {cost!r}, and no function. {did_you_mean(str(cost), COSTS)}")
    law = cost if callable(cost) else COSTS[cost]
    return None if law is None else equations.running_cost(law)


def _span(duration, cost, phases: int) -> tuple[float, float]:
    """Least and largest duration."""
    low, high = value_range("duration", duration, "duration")
    if not low > 0.0 or np.isinf(low):
        raise ArgumentError(
            f"optimal motion: duration: expected a positive time [s], or (least, largest), got {duration!r}."
        )
    if cost == "time" and low == high and phases == 1:
        raise ArgumentError("optimal motion: cost 'time' needs a free duration=(least, largest) [s].")
    return low, high


def _middle(span: tuple[float, float], system: System) -> float:
    """First guess of the duration [s]."""
    low, high = span
    return float(np.sqrt(low * high)) if np.isfinite(high) else max(2.0 * low, SWINGS * system.scale.time)
