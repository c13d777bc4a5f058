"""Laws that depend on their history: their values at samples, with the state before a motion and with that after it.

Methods call a law several times in a step, and again in steps that they reject: what a law keeps from these calls is not the
history of the motion.
"""

import warnings

import numpy as np

from gauss.dynamics.kinematics import Kinematics, kinematics
from gauss.dynamics.laws.traced_laws import Laws
from gauss.errors import SimulationError, SwitchingWarning, user_level
from gauss.scene.stateful_laws import PreservedState
from gauss.simulation.trajectory import Trajectory
from gauss.system import State, System

REPEATED_CALLS = 3  # with one state, of a law that may be random
COMPARED_SAMPLES = 5  # of a motion, at which a law is called with both states


class History:
    """State of the opaque laws of a system before a motion."""

    def __init__(self, laws: Laws):
        own = [(str(getattr(bound.load, "name", "")), law) for bound in laws.called for law in bound.laws]
        self.kept = [(name, law, PreservedState(law)) for name, law in own]

    def refuse_random(self, system: System, start: State):
        """Refuse random laws in adaptive steps: no step is short enough for their error.

        SimulationError if a law has other values in a second call with the same state of the mechanism and of its own; with
        its name.
        """
        motion = Kinematics(system, start)
        for name, law, before in self.kept:
            if _is_random(law, motion, before):
                raise SimulationError(
                    f"the law of {name!r} has other values when it is called again in the same state, as if it were random: "
                    "adaptive steps cannot meet a tolerance. Hold random values from sample to sample with control= and "
                    "rate=, or use a fixed step."
                )

    def warn(self, trajectory: Trajectory):
        """Warn of laws whose values depend on what calls during the motion have changed, by the names of their loads."""
        names = dict.fromkeys(name for name, law, before in self.kept if _depends(law, before, trajectory))
        if names:
            warnings.warn(
                f"{trajectory.system.scene.name!r}: the law of {', '.join(map(repr, names))} depends on what it keeps from "
                "one call for the next, but methods call a law several times in a step, and again in steps that they "
                "reject: its motion is another one. Simulate a controller with a state from sample to sample, each time "
                "with state=motion.state(-1), and change its output in between.",
                SwitchingWarning,
                stacklevel=user_level(),
            )


def _depends(law, before: PreservedState, trajectory: Trajectory) -> bool:
    """Whether a law has other values with its present state than with the one before; its present state is left."""
    if not before.differs():
        return False
    after, count = PreservedState(law), min(COMPARED_SAMPLES, len(trajectory))
    rows = np.linspace(0, len(trajectory) - 1, count).astype(int)
    motions = [kinematics(trajectory.system, trajectory.state(int(row))) for row in rows]
    try:
        return any(not np.array_equal(_value(law, one, before), _value(law, one, after)) for one in motions)
    except Exception:  # a law may fail in any way in a state that it does not expect
        return True
    finally:
        after.restore()


def _is_random(law, motion, state: PreservedState) -> bool:
    """Whether a law has other values in calls with the same state of the mechanism and of its own; its state is left."""
    try:
        values = [_value(law, motion, state) for _ in range(REPEATED_CALLS)]
    except Exception:  # the motion reports a law that fails
        return False
    finally:
        state.restore()
    return any(not np.array_equal(values[0], other, equal_nan=True) for other in values[1:])


def _value(law, motion, state: PreservedState) -> np.ndarray:
    """Value of a law with a state of its own."""
    state.restore()
    return np.asarray(law(motion.state.t, motion), dtype=float)
