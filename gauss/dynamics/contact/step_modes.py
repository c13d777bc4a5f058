"""Contact modes of the elements of a scene after a step of Moreau–Jean time stepping; numbers or expressions.

Elements are contacts of shapes with all their points, other gaps, and set-valued elements, with the modes of
:mod:`gauss.dynamics.contact.contact_changes`. The modes, and whether an element had an impact in the step, are octal digits
of a few numbers, the codes, for every number more in the point of a motion costs time in each step.
"""

from functools import reduce
from typing import TYPE_CHECKING

import numpy as np

from gauss import math
from gauss.codegen.kernels.contact_modes import SLIDING, STICKING
from gauss.dynamics.contact.contact_changes import ModeChange
from gauss.dynamics.contact_terms import ContactTerms
from gauss.scene import Contact
from gauss.system import sides

if TYPE_CHECKING:
    from gauss.dynamics.contact.moreau_step import MoreauStepper

UNKNOWN = -1  # mode of an element, and code, before the first step
IMPACT, BASE = 4, 8  # of a digit: added to the mode where there was an impact; number of digits
DIGITS = 17  # of a code: 8^17 is the largest power of 8 below 2^53


class StepModes:
    """Modes of the elements of one scene.

    Attributes
    ----------
    elements : list of str
        Names of the elements.
    first_set_valued : int
        First set-valued element.
    """

    def __init__(self, stepper: "MoreauStepper"):
        scene, self.stepper = stepper.system.scene, stepper
        contacts = [name for name, contact in scene.contacts.items() if isinstance(contact, Contact)]
        names = [side.whole.name if isinstance(side.whole, Contact) else side.name for side in sides(scene)]
        others = [name for name in names if name not in contacts]
        self.first_set_valued = len(contacts) + len(others)
        self.elements = [*contacts, *others, *scene.set_valued]
        self.of_gap = [self.elements.index(name) for name in names]
        self.tangents = {int(gap): rows for gap, rows in zip(stepper.laws.under, stepper.laws.across, strict=True)}

    @property
    def codes(self) -> int:
        """Number of codes."""
        return -(-len(self.elements) // DIGITS)

    def after(self, touch: ContactTerms, free, added, force, v, h, rest, share) -> np.ndarray:
        """Codes (c,), then the energies that the elements have lost (n,) [J].

        Parameters
        ----------
        touch : ContactTerms
            Contact terms of the step, in units of the scene.
        free, added : ndarray, shape (n_v,)
            Accelerations without contact forces, and those by them.
        force : ndarray, shape (n,)
            Contact forces in units of the scene.
        v : ndarray, shape (n_v,)
            Rates before the step.
        h, rest, share : float
            As of :meth:`gauss.dynamics.contact.moreau_step.MoreauStepper.without_forces`.
        """
        stepper, total, count = self.stepper, free + added, len(self.elements)
        work = force * (touch.J @ (v + 0.5 * h * total))  # as in MoreauStepper.over: in machine code, the same operations
        slow, hits = stepper.slow(v), stepper.hits(touch, free, h, rest, share)
        parts: list[list[list]] = [[[] for _ in range(count)] for _ in range(3)]
        modes, impacts, works = parts

        def sliding(rows):
            rates = [touch.rate[row] + h * (touch.J[row] @ total + (1.0 - share) * touch.bias[row]) for row in rows]
            return math.where(math.sqrt(sum(rate * rate for rate in rates)) > slow, SLIDING, STICKING)

        for gap, element in enumerate(self.of_gap):
            rows = self.tangents.get(gap, ())
            modes[element].append(math.where(force[gap] > 0.0, sliding(rows) if len(rows) else STICKING, 0.0))
            impacts[element].append(math.where(force[gap] > 0.0, IMPACT * hits[gap], 0.0))
            works[element] += [work[row] for row in (gap, *rows)]
        for row, element in zip(stepper.laws.set_valued, range(self.first_set_valued, count), strict=True):
            modes[element], impacts[element], works[element] = [sliding([row])], [0.0], [work[row]]
        losses = [-h * sum(own) for own in works]
        digits = [reduce(math.maximum, one) + reduce(math.maximum, other) for one, other in zip(modes, impacts, strict=True)]
        codes = [
            sum(digit * float(BASE**k) for k, digit in enumerate(digits[first : first + DIGITS]))
            for first in range(0, count, DIGITS)
        ]
        return np.array([*codes, *losses], dtype=object)


def changes_of(rows: np.ndarray, modes: np.ndarray) -> list[ModeChange]:
    """Changes in some steps, from the modes before them, which become those after them.

    Parameters
    ----------
    rows : ndarray, shape (k, c + n)
        Results of :meth:`StepModes.after`.
    modes : ndarray of int, shape (n,)
        Modes before.
    """
    n = modes.size
    codes, lost = np.split(rows, [rows.shape[1] - n], axis=1)
    place = np.arange(n)
    digits = codes.astype(np.int64)[:, place // DIGITS] // BASE ** (place % DIGITS) % BASE
    now, hit = digits % IMPACT, digits // IMPACT
    before = np.concatenate([modes[None], now])[: len(rows)]
    if len(rows):
        modes[:] = now[-1]
    return [
        ModeChange(int(k), int(e), int(before[k, e]), int(now[k, e]), bool(hit[k, e]), float(lost[k, e]))
        for k, e in zip(*np.nonzero(before != now), strict=True)
    ]
