"""Laws of time in results of one instant: an equilibrium and a linear model hold for the values at one time only."""

import warnings
from dataclasses import replace
from math import isfinite
from numbers import Real

import numpy as np

from gauss.codegen import reachable
from gauss.dynamics.kinematics import kinematics
from gauss.dynamics.laws.recorded_time import reads_time
from gauss.dynamics.laws.traced_laws import Laws
from gauss.errors import ArgumentError, TimeDependenceWarning, require, user_level
from gauss.system import State, System


def state_at(system: System, given: State | None, t: float | None, what: str) -> State:
    """State that a result is asked for, at the time that is asked for; the start of the scene at rest if none is given.

    ArgumentError if the state or the time is none, or both are given: a state has a time of its own.

    Parameters
    ----------
    given : State, optional
        State of the user.
    t : float, optional
        Time of the user [s].
    what : str
        Name of the function in messages.

    Warns
    -----
    TimeDependenceWarning
        If neither is given, and laws of the scene depend on time.
    """
    if t is not None and (not isinstance(t, Real) or not isfinite(t)):
        raise ArgumentError(f"{what}: t: expected a time [s], got {t!r}.")
    if given is not None:
        require(given, (State,), what)
        if t is not None:
            raise ArgumentError(f"{what}: t: the given state has a time of its own, {given.t:g} s; give one of the two.")
        return given
    start = system.initial_state(t=float(t or 0.0))
    found = system.initial_state(start.q, resting(system, start).v, start.t)
    if t is None and (names := timed_laws(system, found)):
        words = f"the laws of {', '.join(map(repr, names))} depend on time; the result holds for t = {found.t:g} s only"
        warnings.warn(f"{what}: {words}. Name a time by t= [s].", TimeDependenceWarning, stacklevel=user_level())
    return found


def own_states(system: System) -> list[int]:
    """Places in v of states of one's own."""
    return [k for k, name in enumerate(system.coordinates) if name in system.scene.states]


def resting(system: System, state: State) -> State:
    """State without rates; states of one's own, as currents and pressures, keep their values."""
    v, own = np.zeros(system.n_v), own_states(system)
    v[own] = state.v[own]
    return replace(state, v=v)


def timed_laws(system: System, state: State) -> tuple[str, ...]:
    """Names of loads and constraints whose laws depend on time; opaque laws are asked at a state."""
    laws = Laws(system)
    found = [relation.name for relation in system.relations.placed if relation.is_timed]
    if laws.motion is not None:
        clock = laws.motion.state.t
        found += [name for name, law in laws.functions if any(node is clock for node in reachable(law.outputs))]
    if laws.called:
        motion = kinematics(system, state)
        found += [bound.load.name for bound in laws.called if any(any(reads_time(law, motion)) for law in bound.laws)]
    return tuple(dict.fromkeys(found))
