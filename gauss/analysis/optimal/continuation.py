"""Poses of loops along straight lines of some coordinates: the others follow from pose to pose, on their branch."""

from collections.abc import Mapping

import numpy as np

from gauss.analysis.loop_closure import closed
from gauss.system import State, System


def followed(system: System, start: State, targets: Mapping[int, float], shares) -> tuple[list[State], bool]:
    """States at rest whose coordinates go from a start to targets, and whether the loops of all of them are closed.

    Parameters
    ----------
    start : State
        State that meets the constraints.
    targets : mapping of int to float
        Coordinates that are led, by their places in q, and where they go; they are no parts of quaternions.
    shares : array_like, shape (k,)
        Shares of the way, increasing.
    """
    columns = [_column(system, place) for place in targets]
    places, state, states, all_closed = list(targets), start, list[State](), True
    way = np.array(list(targets.values())) - start.q[places]
    for share in shares:
        q = state.q.copy()
        q[places] = start.q[places] + share * way
        state, is_closed = closed(system, State(start.t, q, np.zeros(system.n_v)), columns)
        all_closed = all_closed and is_closed
        states.append(state)
    return states, all_closed


def _column(system: System, place: int) -> int:
    """Rate of a coordinate."""
    joint = next(one for one in system.joints if one.q.start <= place < one.q.stop)
    return joint.v.start + place - joint.q.start
