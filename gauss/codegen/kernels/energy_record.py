"""Record of the energy balance that a compiled loop keeps: wherever it checks accelerations, it looks at the energies, too.

A look is (kinetic energy, potential energy, total, magnitude): the total is T + V − work of drives and loads + dissipated,
and the magnitude is what rounding of the potential energy is measured against. The balance is the total less that at the
start; an exact motion keeps it at zero.
"""

import numpy as np

from gauss.codegen import Function, write

LOOK = 4  # numbers of a look
ENERGIES = ("kinetic", "lowest", "highest", "magnitude", "initial", "balance", "off", "jump", "when")


def opened(look) -> list:
    """Record of a motion of which only the start was looked at: entries named :data:`ENERGIES`.

    Largest kinetic energy; least and largest potential energy; largest magnitude; total at the start; balance at the latest
    look, and the largest so far; its largest change from one look to the next, and the time at the end of that [s].
    """
    kinetic, potential, total, magnitude = look
    return [kinetic, potential, potential, magnitude, total, 0.0, 0.0, 0.0, 0.0]


def updated(record, t, look, where=np.where) -> list:
    """Record after another look at a time; numbers, arrays of them, or expressions, with what chooses between these."""
    kinetic, lowest, highest, magnitude, initial, balance, off, jump, when = record
    now = look[2] - initial
    change, size = np.abs(now - balance), np.abs(now)
    return [
        where(look[0] <= kinetic, kinetic, look[0]),
        where(lowest <= look[1], lowest, look[1]),
        where(look[1] <= highest, highest, look[1]),
        where(look[3] <= magnitude, magnitude, look[3]),
        initial,
        now,
        where(size <= off, off, size),  # also what is no number
        where(change <= jump, jump, change),
        where(change <= jump, when, t),
    ]


def update() -> Function:
    """Function (record, t, look) → record, for loops."""

    def after(record, t, look):
        return updated(record, t[0], look, t[0].graph.select)

    return write(after, len(ENERGIES), 1, LOOK, name="update_energies")
