"""Positions of free bodies at the end of a step, projected onto the gaps: no shape is left in another one.

    minimise ½ δᵀ M δ   subject to   g + J δ ≥ 0 of all near gaps

Steps find rates that close gaps as these and their second derivatives predict. What the prediction misses, by impacts and by
gaps that begin to close within a step, is removed from the positions; rates and forces stay as they are, so that no speed
remains of it (projected Moreau–Jean time stepping: Acary, Appl. Math. Comput. 220, 2013).
"""

import numpy as np

from gauss.codegen.kernels.position_projection import DOUBT, LARGEST_MOVE, REACH
from gauss.dynamics.contact.gap_laws import gap_after
from gauss.dynamics.contact.near_detection import NearContacts
from gauss.system import State

ACCEPTED_DEPTH = 2e-6  # of the length of the scene: less than a hundredth of what soft contacts in such steps need


def depth_after(near: NearContacts, rate: np.ndarray, time: float, hit: bool) -> float:
    """Deepest penetration at the end of a step [m], as its rates predict it, or deeper.

    Parameters
    ----------
    rate : ndarray, shape (m,)
        Rates of the gaps after the step, at the present poses [m/s].
    time : float
        Time from there to the end of the step [s].
    hit : bool
        Whether there was an impact: the second derivatives were those of the rates before it.
    """
    gap = gap_after(near.gap, rate, near.bias[:, 0], time)
    if hit:
        gap = gap_after(gap, 0.0, -DOUBT * np.abs(near.bias[:, 0]), time)
    return float((-gap).max(initial=0.0))


def without_penetration(stepper, state: State, h: float, depth: float) -> np.ndarray:
    """Coordinates (n_q,) of the nearest positions whose gaps are not negative; those given where none are found.

    Parameters
    ----------
    stepper : FreeBodyStepper
        Steps of the system.
    state : State
        End of a step of length h [s].
    depth : float
        Deepest penetration that is expected [m].
    """
    n, still = stepper.n, State(state.t, state.q, np.zeros_like(state.v))
    begun = stepper.begin(still, 0.0, 0.0)
    near, overlaps = stepper.detection.find(begun.bodies, REACH * depth)
    if overlaps or not near.gap.size or near.gap.min() >= -stepper.settings["accepted"]:
        return state.q
    b = np.zeros((near.gap.size, 3))
    b[:, 0] = near.gap / h
    added = stepper.pushed_apart(near, begun, b)
    if added is None or h * stepper.speed(added) > LARGEST_MOVE * depth:
        return state.q
    step = np.repeat([[h], [0.0]], n, axis=1)
    end = stepper.kernels.end(np.concatenate([begun.q, np.zeros((6, n)), stepper.given, added.T, step]))
    q = state.q.copy()
    changed = added.any(axis=1)
    q[stepper.q_places[:, changed]] = end[:7, changed]
    return q
