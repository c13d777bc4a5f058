"""Changes of the contact mode from step to step: which contacts, stops and set-valued elements close, open, stick and slip.

The mode of an element is 0 while it bears no force, 1 while it sticks, or bears a force without friction, and 2 while one of
its points slides. Machine code keeps the same record: :mod:`gauss.codegen.kernels.contact_modes`.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from gauss.codegen.kernels.contact_modes import SLIDING, STICKING
from gauss.codegen.kernels.step_memory import CHANGE
from gauss.dynamics.contact.shape_table import ShapeTable

COUNTS = 4  # closed elements, elements with forces in a step, changes, finished steps


class ModeChange(NamedTuple):
    """Change of one element in a step."""

    step: int  # number of the step, from 0
    element: int  # the element: contacts of the scene, then other gaps, then set-valued elements
    before: int  # before, after: its modes
    after: int
    hit: bool  # whether it had an impact in the step
    lost: float  # energy lost in it during the step [J]


class RecordedChanges:
    """Changes that machine code recorded: its numbers, which become changes when they are asked for.

    Parameters
    ----------
    numbers : ndarray, shape (k CHANGE,)
        Copy of the record.
    modes : ndarray
        Modes of the elements before the steps.
    """

    __slots__ = ("modes", "numbers")

    def __init__(self, numbers: np.ndarray, modes: np.ndarray):
        self.numbers, self.modes = numbers, modes

    def __len__(self) -> int:
        return self.numbers.size // CHANGE

    def __iter__(self) -> Iterator[ModeChange]:
        modes = self.modes.tolist()
        for step, element, mode, hit, lost in self.numbers.reshape(-1, CHANGE).tolist():
            k, after = int(element), int(mode)
            yield ModeChange(int(step), k, modes[k], after, hit > 0.0, lost)
            modes[k] = after


class ModesOfStep(NamedTuple):
    """Elements that bear a force in a step; one may occur several times."""

    element: np.ndarray  # element, mode (k,): elements, and their modes
    mode: np.ndarray
    hit: np.ndarray  # (k,) whether they had an impact
    lost: np.ndarray  # (k,) energy lost in them [J]


class ModeRecord:
    """Modes of all elements of a scene after the last step.

    Parameters
    ----------
    size : int
        Number of elements.

    Attributes
    ----------
    modes, next_modes, closed, fresh, counts : ndarray of int
        Arrays that machine code shares.
    """

    def __init__(self, size: int):
        self.modes, self.next_modes, self.closed, self.fresh = np.zeros((4, max(size, 1)), dtype=np.int64)
        self.counts = np.zeros(COUNTS, dtype=np.int64)
        self.last: tuple[np.ndarray, np.ndarray] | None = None

    def forget(self):
        """Begin with open contacts."""
        self.modes[:], self.counts[:], self.last = 0, 0, None

    def is_same(self, key: np.ndarray, modes: np.ndarray) -> bool:
        """Whether contacts have the keys and modes of the last step, which are kept: then nothing changes."""
        last, self.last = self.last, (key, modes)
        return last is not None and np.array_equal(modes, last[1]) and np.array_equal(key, last[0])

    def take(self, modes: np.ndarray):
        """Begin with modes as of :meth:`kept`."""
        self.modes[:], self.last = modes, None
        closed = np.flatnonzero(modes)
        self.closed[: closed.size], self.counts[0] = closed, closed.size

    def kept(self) -> np.ndarray:
        """Copy of the modes."""
        return self.modes.copy()

    def update(self, found: ModesOfStep) -> list[ModeChange]:
        """Changes of a step by Python."""
        elements, place = np.unique(found.element, return_inverse=True)
        mode, hit, lost = np.zeros(elements.size, dtype=np.int64), np.zeros(elements.size), np.zeros(elements.size)
        np.maximum.at(mode, place, found.mode)
        np.maximum.at(hit, place, found.hit)
        np.add.at(lost, place, found.lost)
        opened = np.setdiff1d(self.closed[: self.counts[0]], elements)
        changes = [ModeChange(0, int(one), int(self.modes[one]), 0, False, 0.0) for one in opened]
        for k in np.flatnonzero(self.modes[elements] != mode):
            one = int(elements[k])
            changes.append(ModeChange(0, one, int(self.modes[one]), int(mode[k]), bool(hit[k]), float(lost[k])))
        self.modes[opened], self.modes[elements] = 0, mode
        self.closed[: elements.size], self.counts[0] = elements, elements.size
        return changes


def modes_of_contacts(table: ShapeTable, law: np.ndarray, force: np.ndarray, speed: np.ndarray, slow: float) -> np.ndarray:
    """Modes of contacts by their numbers in the scene, forces (m, 3), and sliding speeds after the step."""
    slides = (table.friction[law] > 0.0) & (speed > slow)
    return np.where(force[:, 0] > 0.0, np.where(slides, SLIDING, STICKING), 0)
