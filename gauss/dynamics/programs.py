"""Functions of a system for compiled loops, by the dynamics of a :class:`gauss.dynamics.rules.Plan`.

Kernels of links are imported where they are asked for: most motions need none of them.
"""

from functools import cached_property

import numpy as np

from gauss.codegen import PythonCallback
from gauss.dynamics.embedded_aba import Embedding
from gauss.dynamics.front_rank import embedding_of
from gauss.dynamics.traced_system import Program
from gauss.system import State, System


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


class CalledProgram(Program):
    """Functions of one system, which ask Python for the forces of the loads with opaque laws."""

    @cached_property
    def called_loads(self) -> PythonCallback:
        """Loads with opaque laws."""
        return called_loads(self.system)

    def applied(self, state: State):
        """Generalised forces, forces on bodies and power of all loads."""
        own, forces, power = super().applied(state)
        found = self.called_loads([state.t], state.q, state.v)
        return own + found[: self.system.n_v], forces, power + found[self.system.n_v :]

    def _tree_error(self, state: State, acceleration: np.ndarray, tau):
        called = self.called_loads([state.t], state.q, state.v)[: self.system.n_v]
        return super()._tree_error(state, acceleration, called if tau is None else called + tau)


def called_loads(system: System) -> PythonCallback:
    """Function (t, q, v) → (generalised forces (n_v,), power (3,)) of :class:`gauss.dynamics.load_forces.LoadForces`."""
    return PythonCallback("called_loads", 1 + system.n_q + system.n_v, system.n_v + 3)


def program_of(dynamics: str) -> type[Program]:
    """Class of the functions of a system for compiled loops and batches."""
    match dynamics:
        case "tree recursion":
            from gauss.dynamics.kernel_program import TreeProgram

            return TreeProgram
        case "call graph":
            from gauss.dynamics.call_graph_program import CallGraphProgram

            return CallGraphProgram
        case "callbacks":
            return CalledProgram
        case "embedded loops":
            return EmbeddedProgram
        case _:
            return Program
