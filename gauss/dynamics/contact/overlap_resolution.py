"""Shapes in each other at the start, moved apart by the least motion in the metric of the masses.

    minimise ½ δᵀ M δ   subject to   g + K δ ≥ 0 of all gaps

This is Gauss's principle for a displacement: δ = H Kᵀ f, 0 ≤ f ⟂ g + W f ≥ 0 with W = K H Kᵀ. The gaps are not linear, hence
some repetitions.
"""

import numpy as np

from gauss.dynamics.contact.contact_step import ContactLaws, ContactProblem
from gauss.dynamics.contact.overlaps import START_OVERLAP
from gauss.errors import SimulationError, StateError
from gauss.system import State, retract

REPETITIONS = 50
CLEARANCE = 0.25  # of the largest penetration at the start: overlaps are resolved to no more than that


def resolved(stepper, state: State) -> State:
    """Nearest state whose gaps are not negative, at the same rates.

    StateError if none is found: the joints, or other shapes, keep some shapes in each other.
    SimulationError if shapes are so deep in each other that no gap leads out.

    Parameters
    ----------
    stepper : MechanismStepper
        Steps of the system.
    """
    for _ in range(REPETITIONS):
        gap, K, H, _ = stepper.gaps_at(state)
        if not gap.size or gap.min() >= -CLEARANCE * START_OVERLAP:
            stepper.refuse_penetration(state)  # overlaps that no gap shows
            return state
        n = np.zeros(0, dtype=int)
        laws = ContactLaws(np.arange(gap.size), n.reshape(0, 2), n, np.zeros(0), n, np.zeros(0))
        response = K @ H
        W = response @ K.T
        if not W.any():  # nothing that moves opens a gap
            break
        try:
            force, _ = ContactProblem(W, gap, laws).solve(np.zeros(gap.size))
        except SimulationError:  # no displacement opens all gaps
            break
        state = stepper.projected(State(state.t, retract(stepper.system, state.q, force @ response), state.v))
    gap, _, _, names = stepper.gaps_at(state)
    raise StateError(
        f"t = {state.t:.6g} s: shapes of {names[int(np.argmin(gap))]!r} stay in each other; its joints or other shapes hold "
        "them there. Move them apart with scene.start, or remove that contact."
    )
