"""What the fixed steps of a stepping object may pass over: laws that switch, and shapes that pass through each other."""

from collections.abc import Callable

import numpy as np

from gauss.dynamics.laws.traced_laws import Laws
from gauss.integrators import FixedStep
from gauss.simulation.moreau.unseen_contacts import FIRST, PassingWatch
from gauss.simulation.passed_switching import StepsAhead
from gauss.simulation.undetected_switching import warn_of_undetected
from gauss.system import State, System


class StepWatch:
    """Looks at the motion of a stepping object, its first step here, and warns.

    ``seen``: steps of the motion in which switching of laws of time has been looked for; ``has_pairs``: whether shapes could
    pass through each other. SimulationError if a constraint jumps, by time or at a condition on the state.
    """

    def __init__(self, system: System, laws: Laws, start: State, step: float, method: FixedStep):
        self.system, self.step = system, step
        self._ahead, self._passing = StepsAhead(system, laws, step, method), PassingWatch(system, step)
        self._ahead.look(start, start.t + step)
        self.has_pairs, self._warned, self.seen = self._passing.has_pairs, False, 0.0

    @property
    def warned_of(self) -> set[str]:
        """What was warned of laws of time."""
        return self._ahead.warned_of

    def begin(self, t: float):
        """Begin a motion at a time [s]."""
        self.go_on(t, (FIRST, False))

    def kept(self) -> tuple:
        """When the next look at the shapes is due, and whether undetected switching was warned of."""
        return self._passing.due, self._warned

    def go_on(self, t: float, kept: tuple):
        """Go on with a motion that began at a time [s], and what was kept of it; shapes are looked at before it steps."""
        self._passing.due, self._warned = kept
        begins = self.has_pairs and self._passing.due == FIRST
        self.seen = 0.0 if begins else self._ahead.seen_from(t)

    def look(self, rates: np.ndarray, steps: int, state: Callable[[], State], fastest: float):
        """Look at the shapes of a state () → State after some steps, where its rates (n_v,) or the steps make that due.

        It is left out where ``fastest``, the largest speed of a point of a shape [m/s], says that none moves far in a step.
        """
        if not self._passing.is_slow(fastest):
            self._passing.examine(rates.dot(rates), steps, lambda: [("", state())])

    def look_ahead(self, state: State, begun: float, steps: int):
        """Look for switching of laws of time up to the end of so many steps from a time [s], and beyond it."""
        self._ahead.look(state, begun + steps * self.step)
        self.seen = self._ahead.seen_from(begun)

    def switched(self, t: float):
        """Warn of a law of the state that may have switched undetected before a time [s], once for each motion."""
        if not self._warned:
            self._warned = True
            warn_of_undetected(self.system.scene.name, f"before t = {t:.6g} s, within a step of {self.step:g} s,")
