"""Machine code of a large tree: sweeps along it, with its loads given from outside."""

import numpy as np

from gauss.assembly import Applied, Motion, forward_sweep, inverse_sweep
from gauss.dynamics.rounding import floor
from gauss.system import State, System
from gauss.tracing import Kernel


class SweptKernels:
    """Forward dynamics and their check, called as :class:`gauss.dynamics.program.Kernels` are.

    Parameters
    ----------
    system : System
        A tree.
    """

    settle = None  # a tree has nothing to be settled

    def __init__(self, system: System):
        self.system = system
        self.ground = np.concatenate([np.zeros(3), -np.array(system.scene.gravity)])
        self._forward, self._inverse = (Kernel(sweep(system), batch=False) for sweep in (forward_sweep, inverse_sweep))

    def refined(self, inputs: np.ndarray) -> np.ndarray:
        """(q, v, generalised forces, t) → as :meth:`gauss.dynamics.program.Program.refined`; loads are called."""
        q, v, effort, (t,) = np.split(inputs, np.cumsum([self.system.n_q, self.system.n_v, self.system.n_v]))
        effort = effort + Applied(Motion(self.system, State(t, q, v))).P
        found = self._forward(np.concatenate([q, v, effort, self.ground]))
        change = self._change(q, v, found, effort)
        return np.concatenate([found + change, [self._share(change, found), 0.0, np.abs(inputs).sum()]])

    def forward(self, inputs: np.ndarray) -> np.ndarray:
        """(t, q, v, generalised forces) → (q̈, no power)."""
        return np.concatenate([self._forward(np.concatenate([inputs[1:], self.ground])), np.zeros(3)])

    def check(self, inputs: np.ndarray) -> np.ndarray:
        """(point, generalised forces) → error of the accelerations of the point."""
        n_q, n_v = self.system.n_q, self.system.n_v
        q, v, _, found, _, effort = np.split(inputs[1:], np.cumsum([n_q, n_v, 3, n_v, 3]))
        change = self._change(q, v, found, effort)
        return np.array([self._share(change, found)])

    def _change(self, q, v, found, effort) -> np.ndarray:
        """Change of accelerations that makes up for what inverse dynamics finds lacking."""
        lacking = effort - self._inverse(np.concatenate([q, v, found, self.ground]))
        return self._forward(np.concatenate([q, np.zeros_like(v), lacking, np.zeros(6)]))

    def _share(self, change, found) -> float:
        return np.abs(change).max() / max(np.abs(found).max(), floor(self.system))


def swept(system: System) -> SweptKernels:
    """Machine code of a large tree, made when it is first asked for."""
    return system.dynamics.on_demand("sweeps", lambda: SweptKernels(system))
