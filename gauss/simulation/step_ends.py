"""Ends of the steps that one call of a stepping object makes, in an array that machine code reads."""

import numpy as np

from gauss.codegen.kernels import Due
from gauss.simulation.memory_limit import refuse_beyond_memory

STEP_NUMBERS = 6  # in memory for each step of a call
FEW_STEPS = 16  # so many times are written one by one in less time than as arrays


class StepEnds:
    """Ends of steps of one length [s].

    ``grid`` (room, 2): times [s], and :attr:`Due.UNCHECKED`, as steps are checked every few ones, not where a call ends;
    ``times`` (room,): the times, a view.
    """

    def __init__(self, step: float):
        self.step = step
        self.make_room(1)

    def make_room(self, n: int):
        """Hold the ends of n steps; SimulationError if they do not fit into memory."""
        refuse_beyond_memory(STEP_NUMBERS * n, f"n: the times of {n:.3g} steps", "give fewer steps a call")
        self.grid = np.column_stack([np.zeros(n), np.full(n, float(Due.UNCHECKED))])
        self.times, self._numbers = self.grid[:, 0], self.grid.data.cast("B").cast("d")

    def write(self, begin: float, first: int, n: int):
        """Write the ends of n steps of a motion that began at a time [s], from step ``first`` on."""
        h, last = self.step, first + n
        if n > FEW_STEPS:
            self.times[:n] = begin + h * np.arange(first, last)
        else:
            for k in range(n):
                self._numbers[2 * k] = begin + h * (first + k)
