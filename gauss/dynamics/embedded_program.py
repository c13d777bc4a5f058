"""Functions of a system for compiled loops, with its loops eliminated where they close."""

from functools import cached_property

from gauss.dynamics.embedded_aba import EmbeddedMechanism
from gauss.dynamics.front_rank import embedded_elimination
from gauss.dynamics.mechanism import Mechanism
from gauss.dynamics.traced_system import Program


class EmbeddedProgram(Program):
    """Functions of a system with loop constraints that are independent.

    Where a front is near singular, accelerations are not finite; the fallback of the plan goes on from the last state
    before.
    """

    has_full_rank = True

    @cached_property
    def elimination(self) -> type[Mechanism]:
        """That whose fronts are regular."""
        return embedded_elimination(self.pattern) or EmbeddedMechanism

    @property
    def may_lose_rank(self) -> bool:
        """Whether fronts without hubs tell where the loop constraints lose rank."""
        return self.projects and self.shared.monitors
