"""Control record of a compiled loop: named doubles shared by Python and machine code."""

import ctypes
from enum import IntEnum
from typing import ClassVar

import numpy as np


class LoopStatus(IntEnum):
    """Why a loop returned."""

    DONE = 0
    PAUSED = 1  # the budget of steps is used up; call again
    TOO_SMALL = 2  # the step fell below its lower bound
    UNCONFIRMED = 3  # the check did not confirm the accelerations of a state
    OFF_CONSTRAINTS = 4  # projection failed after a fixed step
    UNSOLVED = 5  # the equations of an implicit step were not solved
    NOT_FINITE = 6  # a number of the state is not finite


class Numbers(ctypes.Structure):
    """Base of records of doubles in contiguous memory; see :func:`numbers`."""

    defaults: ClassVar[dict[str, float]]

    def __init__(self, **given: float):
        super().__init__(**(self.defaults | given))

    @classmethod
    def names(cls) -> list[str]:
        """Names in the order of the memory."""
        return [field[0] for field in cls._fields_]


def numbers(kind: type[Numbers]) -> type[Numbers]:
    """Class decorator: annotated attributes become fields, their values defaults."""
    names = kind.__annotations__
    kind.defaults = {name: getattr(kind, name) for name in names if getattr(kind, name, 0.0)}  # memory begins as zeros
    kind._fields_ = [(name, ctypes.c_double) for name in names]
    return kind


@numbers
class Control(Numbers):
    """Settings and counters of a loop.

    Parameters
    ----------
    h : float
        Next step to try [s].
    end : float
        End time [s].
    largest, smallest : float
        Bounds of the step [s].
    rtol, atol, atol_rates : float
        Relative tolerance of the local error; absolute tolerances of coordinates and of rates.
    acceleration_tolerance : float
        Largest error of the accelerations of a confirmed state, relative to the largest acceleration.
    every : float
        Steps between checks of the accelerations.
    constraint_tolerance : float
        Largest constraint residual of a projected state [rad, m].
    order : float
        Order of a method of variable order.
    steps, rejected, evaluations, factorisations : float
        Counters.
    refused : float
        Steps rejected since the last accepted one.
    unseen : float
        Fixed steps that may have passed switching surfaces of laws undetected.
    worst : float
        Largest error of the accelerations in the checks.
    constraint_residual : float
        Residual of the loop constraints at the last check, relative to the largest acceleration.
    kinetic, lowest, highest, magnitude, initial, balance, off, jump, when : float
        Energy record, see :mod:`gauss.codegen.kernels.energy_record`.
    rows : float
        Samples written.
    notes, notes_at : float
        Steps noted, see :class:`gauss.codegen.kernels.Notes`, and where the first one is written, in numbers.
    sample, samples : float
        Index of the next sample, or of the next grid time, and number of samples; with none, every step is a sample.
    status : float
        See :class:`LoopStatus`.
    """

    h: float = 0.0
    end: float = 0.0
    largest: float = np.inf
    smallest: float = 0.0
    rtol: float = 0.0
    atol: float = 0.0
    atol_rates: float = 0.0
    acceleration_tolerance: float = 1e-9
    every: float = 1.0
    constraint_tolerance: float = 1e-10
    order: float = 0.0
    steps: float = 0.0
    rejected: float = 0.0
    evaluations: float = 0.0
    factorisations: float = 0.0
    refused: float = 0.0
    unseen: float = 0.0
    worst: float = 0.0
    constraint_residual: float = 0.0
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
    notes: float = 0.0
    notes_at: float = 0.0
    sample: float = 0.0
    samples: float = 0.0
    status: float = 0.0
