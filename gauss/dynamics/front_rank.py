"""Rank of the fronts of embedded loops at a consistent state; the conditions of a rule of :mod:`gauss.dynamics.plan`."""

import numpy as np

from gauss.dynamics.embedded_aba import EmbeddedMechanism
from gauss.dynamics.error_scale import consistent_states
from gauss.dynamics.rules import Question
from gauss.dynamics.store import cached_on_disk
from gauss.system import State, System

LEAST_RELATIVE_PIVOT = 1e-6  # of a front; accelerations lose that share of their digits before they are refined


def has_loops(ask: Question) -> bool:
    """Whether loops, couplings or relations constrain the tree."""
    return ask.system.closes


def independent_fronts(ask: Question) -> list[str]:
    """The loop constraints are independent, and each chain of a hub meets its own rows."""
    system = ask.system
    found = cached_on_disk(system, (has_regular_fronts,), lambda: has_regular_fronts(system))
    return [] if found else ["its loop constraints are redundant, or depend on each other where chains are eliminated"]


def has_regular_fronts(system: System) -> bool:
    """Whether the fronts of embedded loops have large pivots at a consistent state."""
    return any(_is_regular(system, state) for state in consistent_states(system))


def _is_regular(system: System, state: State) -> bool:
    with np.errstate(all="ignore"):
        try:
            pivots = EmbeddedMechanism(system, state.q, state.v, state.t).pivots
        except ZeroDivisionError:
            return False
        return all(abs(float(pivot)) >= LEAST_RELATIVE_PIVOT for pivot in pivots)  # false for NaN
