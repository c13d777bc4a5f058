"""Machine code of a large tree: forward and inverse dynamics by tree recursions, which check each other."""

import numpy as np

from gauss.codegen import Kernel
from gauss.codegen.kernels import CorrectedRecursion
from gauss.dynamics.kernel_program import added_forces, tree_correction
from gauss.dynamics.store import cached_on_disk
from gauss.system import System


class TreeRecursionKernels:
    """Forward dynamics and their check, called as :class:`gauss.dynamics.traced_system.Kernels` are."""

    project = None  # a tree has no loop constraints

    def __init__(self, system: System):
        self.system, correction = system, tree_correction(system)
        self.ground = correction.ground
        self._forward, self._correction = Kernel(correction.forward, batch=False), Kernel(correction, batch=False)

    def forward(self, inputs: np.ndarray) -> np.ndarray:
        """(t, q, v, generalised forces) → (q̈, no power), or the same in columns."""
        columns = inputs.shape[1:]
        ground = np.broadcast_to(self.ground.reshape(-1, *(1 for _ in columns)), (6, *columns))
        return np.concatenate([self._forward(np.concatenate([inputs[1:], ground])), np.zeros((3, *columns))])

    def check(self, inputs: np.ndarray) -> np.ndarray:
        """(point, generalised forces) → error of the accelerations of the point."""
        n_q, n_v = self.system.n_q, self.system.n_v
        q, v, _, found, _, effort = np.split(inputs[1:], np.cumsum([n_q, n_v, 3, n_v, 3]))
        return self._correction(np.concatenate([q, v, found, effort]))[n_v:]


def tree_recursion_kernels(system: System) -> TreeRecursionKernels:
    """Machine code of a large tree, made on first request."""
    return cached_on_disk(system, (TreeRecursionKernels,), lambda: TreeRecursionKernels(system))


def corrected_recursion(system: System, loads) -> CorrectedRecursion:
    """(q, v, τ, t) → as :func:`gauss.dynamics.traced_refinement.refined_once`, of a large tree under loads."""
    return CorrectedRecursion(tree_correction(system), added_forces(system, loads))
