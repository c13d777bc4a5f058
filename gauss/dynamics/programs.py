"""Functions of a system for compiled loops, by the dynamics of a :class:`gauss.dynamics.rules.Plan`.

Those of other files are imported where they are asked for: one motion needs one of them.
"""

from functools import cached_property

from gauss.dynamics.embedded_aba import Embedding
from gauss.dynamics.front_rank import embedding_of
from gauss.dynamics.traced_system import Program


class EmbeddedProgram(Program):
    """Functions of a system with loop constraints of which those that are eliminated are independent.

    Where a front is near singular, accelerations are not finite; the fallback of the plan goes on from the last state
    before.
    """

    has_full_rank = True

    @cached_property
    def elimination(self) -> Embedding:
        """That whose fronts are regular."""
        return embedding_of(self.pattern)

    @property
    def may_lose_rank(self) -> bool:
        """Whether fronts without hubs tell where the loop constraints lose rank."""
        return self.projects and self.shared.monitors


def program_of(dynamics: str) -> type[Program]:
    """Class of the functions of a system for compiled loops and batches."""
    match dynamics:
        case "tree recursion":
            from gauss.dynamics.tree_program import TreeProgram

            return TreeProgram
        case "call graph":
            from gauss.dynamics.call_graph_program import CallGraphProgram

            return CallGraphProgram
        case "callbacks":
            from gauss.dynamics.called_program import CalledProgram

            return CalledProgram
        case "embedded loops":
            return EmbeddedProgram
        case _:
            return Program
