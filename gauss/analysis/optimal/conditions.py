"""Conditions on the ends of a motion and limits along it, by names: "pin" is a coordinate, "pin rate" its rate.

Of conditions that constraints make redundant (a loop with all its coordinates given) those are kept that are independent, by
pivoting on tangents of the constraints; the others are checked.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.linalg import qr

from gauss.analysis.loop_closure import closed, followed, with_rates
from gauss.analysis.tangents import Tangents
from gauss.dynamics.projection import limits
from gauss.dynamics.rigid_loops import refuse_other_pose
from gauss.errors import ArgumentError, StateError, did_you_mean, require
from gauss.system import State, System

CONSISTENT = 1e-7  # share of the unit, by which conditions may differ from what the constraints make of the others
STEPS = 32  # from the start to a pose of the end, so that loops stay on their branch
PREFERENCE = 1e3  # weight of named conditions, so that pivoting takes them first
INDEPENDENT = 1e-8  # share of the largest pivot, below which a condition follows from others


@dataclass(frozen=True)
class EndCondition:
    """Condition on one coordinate or rate at an end of a motion."""

    name: str  # "pin" or "pin rate"
    place: int  # entry of (q, v)
    low: float  # low, high: least and largest value; of a periodic motion, of the increase over the period
    high: float

    @property
    def is_fixed(self) -> bool:
        """Whether it asks for one value."""
        return self.low == self.high


@dataclass(frozen=True)
class MotionEnd:
    """Conditions on one end, and a consistent state near them."""

    conditions: tuple[EndCondition, ...]  # independent conditions
    guess: State  # state that meets what is fixed


def entries(system: System) -> dict[str, int]:
    """Places in (q, v) of all coordinates and rates by name; those of states of one's own by their names."""
    found = {}
    for column, name in enumerate(system.coordinates):
        if name in system.scene.states:
            found[name] = system.n_q + column
            continue
        joint, rate = system.coordinate(name)
        quaternion = joint.pair.quaternion
        if quaternion is None or (rate or 0) < quaternion:
            found[name] = joint.q.start + (rate or 0)
        found[f"{name} rate"] = system.n_q + column
    return found


def value_range(name: str, given, what: str) -> tuple[float, float]:
    """Least and largest value of a number or a pair."""
    try:
        low, high = (float(given),) * 2 if np.ndim(given) == 0 else map(float, given)
    except (TypeError, ValueError):
        low = high = np.nan
    if np.isnan([low, high]).any() or low > high or np.isinf(low) and low == high:
        raise ArgumentError(f"optimal motion: {what}: {name!r}: expected a number or (least, largest), got {given!r}.")
    return low, high


def end_of(system: System, given, what: str, near: State) -> MotionEnd:
    """Conditions at an end.

    ArgumentError, StateError if names or values do not fit, or constraints contradict them.

    Parameters
    ----------
    given : State, mapping of str to float or pair, or None
        The whole state, conditions by name, or none.
    what : str
        "start" or "end", for messages.
    near : State
        What is not given is sought near this state.
    """
    if given is None:
        return MotionEnd((), near)
    if isinstance(given, State):
        state = system.state(given.q, given.v, given.t)
        refuse_other_pose(system, state.q)
        conditions = [EndCondition(name, place, *(2 * (_entry(state, place),))) for name, place in _all(system).items()]
        if not closed(system, state)[1]:
            raise StateError(
                f"optimal motion: {what}: the state does not meet the constraints; system.initial_state(q, v) does."
            )
        return MotionEnd(_independent_ones(system, state, conditions), state)
    require(given, (Mapping,), f"optimal motion: {what}")
    known = entries(system)
    conditions = [
        EndCondition(name, known[_known(name, known, what)], *value_range(name, one, what)) for name, one in given.items()
    ]
    state = _assembled(system, conditions, what, near)
    return MotionEnd(_independent_ones(system, state, conditions), state)


def increments(system: System, given, start: State) -> tuple[EndCondition, ...]:
    """Conditions of a periodic motion: increases of independent coordinates and rates over the period.

    ArgumentError if names or values do not fit.

    Parameters
    ----------
    given : bool or mapping of str to float
        Whether the motion is periodic, or increases of coordinates over a period that are not zero, as of a crank.
    start : State
        State near the start.
    """
    if given is False or given is None:
        return ()
    require(given, (bool, Mapping), "optimal motion: periodic")
    named, known = {} if given is True else given, _all(system)
    for name in named:
        _known(name, known, "periodic")
    conditions = [
        EndCondition(name, place, *value_range(name, named.get(name, 0.0), "periodic")) for name, place in known.items()
    ]
    first = sorted(conditions, key=lambda one: one.name not in named)
    return _independent_ones(system, start, first, preferred=len(named))


def motion_limits(system: System, equations, given) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Limits of (q, v) and of the inputs: those of joints and inputs, and of names of a mapping.

    ArgumentError if a name or a value does not fit.
    """
    n_x, known = system.n_q + system.n_v, entries(system)
    lowest, highest = np.full(n_x, -np.inf), np.full(n_x, np.inf)
    least, largest = limits(system)
    for name, place in known.items():
        if place < system.n_q:
            column = system.column(name)
            lowest[place], highest[place] = least[column], largest[column]
    low, high = equations.lowest.copy(), equations.highest.copy()
    require(given, (Mapping,), "optimal motion: limits")
    for name, value in given.items():
        _known(name, (*known, *equations.names), "limits")
        is_number = isinstance(value, int | float | np.number)
        bounds = value_range(name, (-value, value) if is_number else value, "limits")
        of_input = name in equations.names
        least, largest = (low, high) if of_input else (lowest, highest)
        k = equations.names.index(name) if of_input else known[name]
        least[k], largest[k] = max(least[k], bounds[0]), min(largest[k], bounds[1])
        if least[k] > largest[k]:
            raise ArgumentError(
                f"optimal motion: limits: {name!r}: nothing is left of {bounds} within the limits of the scene."
            )
    return lowest, highest, low, high


def refuse_beyond(ends: dict[str, MotionEnd], lowest: np.ndarray, highest: np.ndarray):
    """Refuse conditions that no motion within the limits meets; ArgumentError if there is one, by its name."""
    for what, end in ends.items():
        for one in end.conditions:
            if one.low > highest[one.place] or one.high < lowest[one.place]:
                raise ArgumentError(
                    f"optimal motion: {what}: {one.name!r} = {one.low:.6g} is beyond its limits, "
                    f"{lowest[one.place]:.6g} to {highest[one.place]:.6g}."
                )


def _known(name, known, what: str):
    if name not in known:
        raise ArgumentError(f"optimal motion: {what}: nothing is called {name!r}. {did_you_mean(str(name), known)}")
    return name


def _all(system: System) -> dict[str, int]:
    """All entries of (q, v) on which a motion depends: those of quaternions too, without integrals of one's own states."""
    found, own = entries(system), system.scene.states
    for name, place in system.quaternions.items():
        found |= {f"{name} quaternion[{k}]": entry for k, entry in enumerate(range(place.start, place.stop))}
    return {name: place for name, place in found.items() if name.removesuffix(" rate") not in own or place >= system.n_q}


def _entry(state: State, place: int) -> float:
    return float(np.concatenate([state.q, state.v])[place])


def _assembled(system: System, conditions, what: str, near: State) -> State:
    """State that meets the conditions, near another one."""
    x = np.concatenate([near.q, near.v])
    for one in conditions:
        x[one.place] = np.clip(x[one.place], one.low, one.high)
    state = State(near.t, x[: system.n_q], x[system.n_q :])
    if system.has_closures:
        held = [one for one in conditions if one.is_fixed or not one.low <= _entry(near, one.place) <= one.high]
        state = _closed(system, held, state, what, near)
    _check(system, state, conditions, what)
    return state


def _closed(system: System, held: list[EndCondition], asked: State, what: str, near: State) -> State:
    """State with closed loops that keeps some coordinates and rates of another one."""
    targets = {one.place: asked.q[one.place] for one in held if one.place < system.n_q}
    (*_, state), is_closed = followed(system, near, targets, np.linspace(0.0, 1.0, STEPS + 1)[1:])
    if not is_closed:
        names = ", ".join(one.name for one in held if one.place in targets)
        raise StateError(f"optimal motion: {what}: the constraints allow no state with these coordinates: {names}.")
    rates = [one.place - system.n_q for one in held if one.place >= system.n_q]
    return with_rates(system, State(state.t, state.q, asked.v), rates) if rates else state


def _check(system: System, state: State, conditions, what: str):
    """Refuse conditions that a state does not meet."""
    from gauss.analysis.optimal.equations import coordinate_units

    units = np.concatenate([coordinate_units(system), system.scale.rates])
    for one in conditions:
        found = _entry(state, one.place)
        if not one.low - CONSISTENT * units[one.place] <= found <= one.high + CONSISTENT * units[one.place]:
            raise StateError(
                f"optimal motion: {what}: {one.name!r}: the constraints and the other conditions make {found:.6g} of it, "
                f"not {one.low:.6g}{'' if one.is_fixed else f' to {one.high:.6g}'}."
            )


def _independent_ones(system: System, state: State, conditions, preferred: int = 0) -> tuple[EndCondition, ...]:
    """Conditions without fixed ones that follow, by the constraints, from others; the first ones are preferred."""
    fixed = [one for one in conditions if one.is_fixed]
    if not fixed or not (system.has_closures or system.quaternions):
        return tuple(conditions)
    rows = Tangents(system, state).of_states[[one.place for one in fixed]]
    rows[:preferred] *= PREFERENCE
    _, R, order = qr(rows.T, mode="economic", pivoting=True)
    sizes = np.abs(np.diag(R))
    kept = [fixed[k] for k in order[: np.count_nonzero(sizes > INDEPENDENT * sizes.max(initial=0.0))]]
    return tuple(one for one in conditions if one in kept or not one.is_fixed)
