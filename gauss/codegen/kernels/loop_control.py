"""What a compiled loop is told and what it tells: numbers with names, which Python and machine code share."""

import ctypes
from enum import IntEnum

import numpy as np


class Status(IntEnum):
    """Why a loop returned."""

    DONE = 0
    PAUSED = 1  # the budget of steps is used up; call again
    TOO_SMALL = 2  # the step fell below its least size
    DISTRUSTED = 3  # a state was reached whose accelerations are not confirmed
    OFF = 4  # a fixed step left the constraints and could not be brought back
    UNSOLVED = 5  # the equations of an implicit step of fixed length were not solved


class Numbers(ctypes.Structure):
    """Base of records of doubles in one piece of memory; see :func:`numbers`."""

    def __init__(self, **given: float):
        super().__init__(**(self.defaults | given))

    @classmethod
    def names(cls) -> list[str]:
        """Names in the order of the memory."""
        return [name for name, _ in cls._fields_]


def numbers(kind: type[Numbers]) -> type[Numbers]:
    """Make a record of what a class annotates; what is given there stands where nothing else is said."""
    names = kind.__annotations__
    kind.defaults = {name: getattr(kind, name) for name in names if hasattr(kind, name)}
    kind._fields_ = [(name, ctypes.c_double) for name in names]
    return kind


@numbers
class Control(Numbers):
    """Settings and counters of a loop.

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
    order : float
        Order of a method that may have any.
    steps, rejected, evaluations, factorisations : float
        Counters.
    refused : float
        Steps rejected since the last one that was accepted.
    unseen : float
        Steps of fixed length that may have passed switching surfaces of laws unseen.
    worst : float
        Largest error of the accelerations found by the checks.
    lacking : float
        What closing rows lack, relative to the largest acceleration, where that was checked last.
    kinetic, lowest, highest, magnitude, initial, balance, off, jump, when : float
        Record of the energies, see :mod:`gauss.codegen.kernels.energy_record`.
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
    order: float = 0.0
    steps: float = 0.0
    rejected: float = 0.0
    evaluations: float = 0.0
    factorisations: float = 0.0
    refused: float = 0.0
    unseen: float = 0.0
    worst: float = 0.0
    lacking: float = 0.0
    kinetic: float = 0.0
    lowest: float = 0.0
    highest: float = 0.0
    magnitude: float = 0.0
    initial: float = 0.0
    balance: float = 0.0
    off: float = 0.0
    jump: float = 0.0
    when: float = 0.0
    rows: float = 0.0
    sample: float = 0.0
    samples: float = 0.0
    status: float = 0.0
