"""Machine code of a large tree: sweeps along it, with its loads given from outside."""

import numpy as np

from gauss.assembly import forward_sweep, inverse_sweep
from gauss.simulation.program import floor
from gauss.system import System
from gauss.tracing import Kernel


class SweptKernels:
    """Forward dynamics and their check, called as the kernels of a :class:`gauss.simulation.program.Program` are.

    Parameters
    ----------
    system : System
        A tree.
    """

    def __init__(self, system: System):
        self.system = system
        self.ground = np.concatenate([np.zeros(3), -np.array(system.scene.gravity)])
        self._forward, self._inverse = (Kernel(sweep(system), batch=False) for sweep in (forward_sweep, inverse_sweep))

    def forward(self, inputs: np.ndarray) -> np.ndarray:
        """(t, q, v, generalised forces) → (q̈, no power)."""
        return np.concatenate([self._forward(np.concatenate([inputs[1:], self.ground])), np.zeros(3)])

    def check(self, inputs: np.ndarray) -> np.ndarray:
        """(point, generalised forces) → error of the accelerations of the point."""
        n_q, n_v = self.system.n_q, self.system.n_v
        q, v, _, found, _, effort = np.split(inputs[1:], np.cumsum([n_q, n_v, 3, n_v, 3]))
        lacking = effort - self._inverse(np.concatenate([q, v, found, self.ground]))
        change = self._forward(np.concatenate([q, np.zeros(n_v), lacking, np.zeros(6)]))
        return np.array([np.abs(change).max() / max(np.abs(found).max(), floor(self.system))])
