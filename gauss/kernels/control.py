"""What a compiled loop is told and what it tells: one array of numbers with names."""

from dataclasses import dataclass, fields
from enum import IntEnum
from functools import cache

import numpy as np


class Status(IntEnum):
    """Why a loop returned."""

    DONE = 0
    PAUSED = 1  # the budget of steps is used up; call again
    TOO_SMALL = 2  # the step fell below its least size
    DISTRUSTED = 3  # a state was reached whose accelerations are not confirmed
    OFF = 4  # a fixed step left the constraints and could not be brought back
    UNSOLVED = 5  # the equations of an implicit step of fixed length were not solved


class Numbers:
    """Base of dataclasses of numbers that machine code reads and writes, all kept as doubles in one array."""

    @classmethod
    @cache
    def names(cls) -> list[str]:
        """Names in the order of the array."""
        return [field.name for field in fields(cls)]

    def pack(self) -> np.ndarray:
        """Array of all numbers."""
        return np.array([getattr(self, name) for name in self.names()], dtype=float)

    def update(self, packed: np.ndarray):
        """Take the numbers of an array over."""
        for name, value in zip(self.names(), packed.tolist(), strict=True):
            setattr(self, name, value)


@dataclass
class Control(Numbers):
    """Settings and counters of a loop, all kept as doubles in one array.

    Parameters
    ----------
    h : float
        Step to try next [s].
    end : float
        When to stop [s].
    largest, smallest : float
        Bounds of the step [s].
    rtol, atol, atol_rates : float
        Local error allowed; the absolute one of coordinates and of rates.
    trust : float
        Largest error of the accelerations with which a state is confirmed, relative to the largest of them.
    every : float
        Every so many steps the accelerations are checked.
    closed : float
        Largest gap [rad, m] of a state that meets the constraints.
    steps, rejected, evaluations, factorisations : float
        Counters.
    refused : float
        Steps rejected since the last one that was accepted.
    worst : float
        Largest error of the accelerations found by the checks.
    rows : float
        Rows written.
    sample, samples : float
        Next sample, or place in the grid of a fixed step, and number of samples; with none, every step is written.
    status : float
        See :class:`Status`.
    """

    h: float = 0.0
    end: float = 0.0
    largest: float = np.inf
    smallest: float = 0.0
    rtol: float = 0.0
    atol: float = 0.0
    atol_rates: float = 0.0
    trust: float = 1e-9
    every: float = 1.0
    closed: float = 1e-10
    steps: float = 0.0
    rejected: float = 0.0
    evaluations: float = 0.0
    factorisations: float = 0.0
    refused: float = 0.0
    worst: float = 0.0
    rows: float = 0.0
    sample: float = 0.0
    samples: float = 0.0
    status: float = 0.0
