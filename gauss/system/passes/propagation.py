"""A vector of one body carried over to all others, across every joint: the normal of a plane, the centre of a sphere."""

from collections import deque
from collections.abc import Callable, Iterable

import numpy as np

from gauss.system.placed_elements import PlacedJoint


def propagated(
    joints: Iterable[PlacedJoint],
    seed: tuple[int, np.ndarray],
    across: Callable[[PlacedJoint, int, np.ndarray], np.ndarray | None],
    tolerance: float,
) -> dict[int, np.ndarray] | None:
    """Vector of every body, by its index; None if there is none across some joint, or two paths to a body disagree.

    ``seed``: a body and its vector. ``across``: ``across(joint, body, vector)`` is the vector of the other body of a joint;
    None if it has none. ``tolerance``: largest difference of two vectors of one body.
    """
    found, waiting, beside = dict([seed]), deque([seed[0]]), neighbours(joints)
    while waiting:
        body = waiting.popleft()
        for joint in beside[body]:
            other = joint.child if body == joint.parent else joint.parent
            vector = across(joint, body, found[body])
            if vector is None or (other in found and np.abs(found[other] - vector).max() > tolerance):
                return None
            if other not in found:
                found[other] = vector
                waiting.append(other)
    return found


def neighbours(joints: Iterable[PlacedJoint]) -> dict[int, list[PlacedJoint]]:
    """Joints of each body, in order."""
    beside: dict[int, list[PlacedJoint]] = {}
    for joint in joints:
        beside.setdefault(joint.parent, []).append(joint)
        beside.setdefault(joint.child, []).append(joint)
    return beside
