"""Local error of two half steps of time stepping, from a whole step, over the tolerance.

Where rates jump within a step, positions are off by up to h |Δv|, and the rates at its end are those after the jump. Jumps
are impacts, and changes whose difference between the whole step and the halves does not become smaller with the step.
Where sliding stops, or goes on in the other direction, whole step and halves may agree on the mode of their end and both be
wrong: the rates are off by up to h |Δq̈|, with the accelerations at the start of the step and the mean ones.
"""

from typing import NamedTuple

import numpy as np

from gauss.integrators.control import Tolerance
from gauss.simulation.moreau.single_steps import ReachedPoint, SingleSteps
from gauss.simulation.verify import differences
from gauss.system import State, System

INSTANT = 1e-3  # of a step: a step as short has the accelerations at its start
JUMP_ORDER = 0.5  # errors of rates that decrease with a lower power of the step are those of a jump; without one it is 1
SHORTENINGS = 2  # of the step in a row that show it


class LocalError(NamedTuple):
    """Error of a step over the tolerance."""

    displacement: float  # displacement, rates: of positions and of rates, if nothing jumps
    rates: float
    jump: float  # of positions, if rates jump
    impact: bool  # whether a gap had an impact

    def largest(self, jumps: bool) -> float:
        """The error, where rates may jump or not."""
        return max(self.displacement, self.jump if jumps or self.impact else self.rates)


class RateJumps:
    """Whether the rates jump after one point, by the errors of ever shorter steps from there."""

    def __init__(self):
        self.h, self.rates, self.count = np.inf, np.inf, 0

    def shown(self, h: float, error: LocalError) -> bool:
        """Take the error of a step of length h; whether the last ones are those of a jump."""
        expected = self.rates * (h / self.h) ** JUMP_ORDER if np.isfinite(self.rates) else np.inf
        self.count = self.count + 1 if error.rates > max(expected, 1.0) else 0
        self.h, self.rates = h, error.rates
        return self.count >= SHORTENINGS


FAILED = LocalError(np.inf, np.inf, np.inf, False)  # of a step that cannot be made


class StepErrors:
    """Errors of the steps of one system.

    Parameters
    ----------
    system : System
        The system.
    tolerance : Tolerance
        Its tolerance.
    steps : SingleSteps
        Its steps.
    """

    def __init__(self, system: System, tolerance: Tolerance, steps: SingleSteps):
        self.system, self.tolerance, self.steps = system, tolerance, steps
        self.order = 2 if steps.shares[0] else 1  # the midpoint rule is of order 2
        self.rate_of = _rate_of_each_coordinate(system)

    def of(self, begin: ReachedPoint, half: ReachedPoint, found: ReachedPoint, whole: ReachedPoint) -> LocalError:
        """Local error of two half steps."""
        n_q, n_v, share = 1 + self.system.n_q, self.system.n_v, 1.0 / (2.0**self.order - 1.0)
        (q, v), (q_whole, v_whole) = ((x.row[1:n_q], x.row[n_q:-3]) for x in (found, whole))
        allowed = self.allowed(self.state(found))
        apart = share * np.abs(differences(self.system, q_whole[None], q[None])[0]) / allowed[self.rate_of]
        rates = share * np.abs(v_whole - v) / allowed[n_v:]
        # a gap without restitution may close with a rate that depends on the step, which the next one stops
        jump = (found.row[0] - begin.row[0]) * np.abs(v - begin.row[n_q:-3]) / allowed[:n_v]
        kinds = {event.kind for event in half.events + found.events + whole.events}
        if "impact" not in kinds and ("holds" in kinds or self.steps.reverses(begin, found)):
            rates = np.maximum(rates, self._of_stop(begin, found) / allowed[n_v:])
        return LocalError(_largest(apart), _largest(rates), _largest(jump), "impact" in kinds)

    def _of_stop(self, begin: ReachedPoint, found: ReachedPoint) -> np.ndarray:
        """Change of the rates (n_v,) in a step less that by the accelerations at its begin."""
        n_q, t, h = 1 + self.system.n_q, begin.row[0], found.row[0] - begin.row[0]
        soon = self.steps.after(begin, t + INSTANT * h)
        before, instant, after = (x.row[n_q:-3] for x in (begin, soon, found))
        return np.abs(after - before - h / (soon.row[0] - t) * (instant - before))

    def state(self, reached: ReachedPoint) -> State:
        """State at a point."""
        n_q = 1 + self.system.n_q
        return State(float(reached.row[0]), reached.row[1:n_q], reached.row[n_q:-3])

    def allowed(self, state: State) -> np.ndarray:
        """Tolerance (2 n_v,) of displacements and rates."""
        return self.tolerance.scale(self.system, state)


def _largest(error: np.ndarray) -> float:
    return float(error.max(initial=0.0)) if np.isfinite(error).all() else np.inf


def _rate_of_each_coordinate(system: System) -> np.ndarray:
    """Rate (n_q,) that goes with each coordinate; with the four of a quaternion the first of its angular velocity."""
    found = np.empty(system.n_q, dtype=int)
    for joint in system.joints:
        plain = joint.pair.n_v if joint.pair.quaternion is None else joint.pair.quaternion
        found[joint.q] = joint.v.start + np.minimum(np.arange(joint.pair.n_q), plain)
    return found
