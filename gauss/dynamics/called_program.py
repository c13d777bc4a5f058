"""Traced functions of a system whose opaque laws are called by machine code: their forces are results of a callback."""

from functools import cached_property

import numpy as np

from gauss.codegen import PythonCallback
from gauss.dynamics.traced_system import Program
from gauss.system import State, System


class CalledProgram(Program):
    """Functions of one system, which ask Python for the loads with opaque laws."""

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
