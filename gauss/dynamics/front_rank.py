"""Rank of the fronts of embedded loops at a consistent state; the conditions of a rule of :mod:`gauss.dynamics.plan`."""

import numpy as np

from gauss.dynamics.conditions import has_large_loops
from gauss.dynamics.embedded_aba import EmbeddedChains, EmbeddedMechanism
from gauss.dynamics.error_scale import consistent_states
from gauss.dynamics.rules import Question
from gauss.dynamics.store import cached_on_disk
from gauss.system import State, System

ELIMINATIONS = EmbeddedMechanism, EmbeddedChains


def has_loops(ask: Question) -> bool:
    """Whether loops, couplings or relations constrain the tree, few enough for straight-line code."""
    return ask.system.closes and not has_large_loops(ask.system)


def independent_fronts(ask: Question) -> list[str]:
    """The loop constraints are independent."""
    found = embedded_elimination(ask.system)
    return [] if found else ["its loop constraints are redundant, or depend on each other where chains are eliminated"]


def embedded_elimination(system: System) -> type[EmbeddedMechanism] | None:
    """Elimination whose fronts have large pivots at a consistent state, with hubs if it has them there; None without one."""
    name = cached_on_disk(system, (embedded_elimination,), lambda: _regular_elimination(system))
    return next((elimination for elimination in ELIMINATIONS if elimination.__name__ == name), None)


def _regular_elimination(system: System) -> str:
    states = consistent_states(system)
    return next((one.__name__ for state in states for one in ELIMINATIONS if _is_regular(one, system, state)), "")


def _is_regular(elimination: type[EmbeddedMechanism], system: System, state: State) -> bool:
    with np.errstate(all="ignore"):
        try:
            return elimination(system, state.q, state.v, state.t).is_regular
        except ZeroDivisionError:
            return False
