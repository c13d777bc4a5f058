"""Fronts of embedded loops that are regular at a consistent state; the conditions of a rule of :mod:`gauss.dynamics.plan`.

Of redundant loop constraints a set of full rank is eliminated. The others follow from it near every state of full rank; the
checks of accelerations and states have all rows.
"""

import numpy as np

from gauss.dynamics.conditions import has_large_loops
from gauss.dynamics.embedded_aba import EmbeddedChains, EmbeddedMechanism, Embedding
from gauss.dynamics.error_scale import consistent_states
from gauss.dynamics.generic_rank import ROUNDOFF_PIVOT, count, dependent_rows, is_generic_rank
from gauss.dynamics.initial_states import met_start
from gauss.dynamics.rules import Question
from gauss.dynamics.store import cached_on_disk
from gauss.system import State, System

ELIMINATIONS = EmbeddedMechanism, EmbeddedChains


def has_loops(ask: Question) -> bool:
    """Whether loops, couplings or relations constrain the tree, few enough for straight-line code."""
    return ask.system.closes and not has_large_loops(ask.system)


def regular_fronts(ask: Question) -> list[str]:
    """The loop constraints are independent where chains are eliminated, but for rows redundant at every state."""
    return [] if embedding(ask.system) else ["its loop constraints depend on each other where chains are eliminated"]


def independent_fronts(ask: Question) -> list[str]:
    """The loop constraints are independent where chains are eliminated.

    Between the steps of a motion, states are a little off the constraints, where redundant rows contradict each other.
    """
    found = embedding(ask.system)
    redundant = found is not None and any(found.dependent)
    return ["its loop constraints are redundant"] if redundant else regular_fronts(ask)


def embedding(system: System) -> Embedding | None:
    """Embedding with large pivots at a consistent state, with hubs if it has them there; None without one."""
    name, *dependent = cached_on_disk(system, (embedding,), lambda: _named(_regular_embedding(system)))
    return next((Embedding(one, dependent) for one in ELIMINATIONS if one.__name__ == name), None)


def embedding_of(system: System) -> Embedding:
    """The same; that of all rows without one, for plans that ask for it."""
    return embedding(system) or Embedding()


def _named(found: Embedding | None) -> tuple:
    """Name of an elimination, and its dependent rows."""
    return (found.mechanism.__name__, *map(tuple, found.dependent)) if found else ("",)


def _regular_embedding(system: System) -> Embedding | None:
    before = None  # rows that depend on others at the state before; states are assembled as long as these do not decide
    for state in consistent_states(system, met_start(system)):
        found = _regular_at(system, state)
        if found:
            return found
        dependent = dependent_rows(system, state)
        is_generic = is_generic_rank(system, dependent) if before is None else 0 < count(before) <= count(dependent)
        if is_generic:
            return _regular_at(system, state, dependent)
        before = dependent
    return None


def _regular_at(system: System, state: State, dependent=()) -> Embedding | None:
    found = (Embedding(one, dependent) for one in ELIMINATIONS)
    return next((one for one in found if _is_regular(one, system, state)), None)


def _is_regular(embedding: Embedding, system: System, state: State) -> bool:
    """Whether the fronts have large pivots in a state of numbers, and the rows pivots above round-off."""
    with np.errstate(all="ignore"):
        try:
            found = embedding(system, state.q, state.v, state.t)
        except ZeroDivisionError:
            return False
        return found.is_regular and all(pivot > ROUNDOFF_PIVOT for pivot in found.pivots)
