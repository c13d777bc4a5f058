"""Gaps of one-sided constraints: how wide they are, how fast they change, and their rows at the level of accelerations.

The row of a gap, differentiated like that of a relation, gives ḋ = A v + B q̇ − C and d̈ = A a + B q̈ − D. A closed gap asks
for d̈ ≥ 0, hence G = −[A B], h = −D: the compulsion with such rows is the exact statement of frictionless unilateral
constraints (Gauss 1829; Moreau 1963). Which gaps are closed is a question of positions and velocities.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from gauss.assembly.kinematics import Motion, kinematics
from gauss.compulsion import Compulsion
from gauss.system import State, System
from gauss.tracing import Kernel, trace

TOUCHING = 1e-8  # [m, rad]: a gap this narrow is closed; integration leaves about 1e-10
RESTING = 1e-8  # [m/s, rad/s], times 1 + the fastest rate: a gap that opens no faster than this does not open


class Gaps(NamedTuple):
    """Gaps of one instant, in the order of ``system.contacts``.

    Attributes
    ----------
    width, rate : ndarray, shape (m,)
        d [m, rad] and ḋ.
    J : ndarray, shape (m, 6n + p)
        Slopes [A B] over (v, q̇).
    C, D : ndarray, shape (m,)
        ḋ = J (v, q̇) − C and d̈ = J (a, q̈) − D.
    """

    width: np.ndarray
    rate: np.ndarray
    J: np.ndarray
    C: np.ndarray
    D: np.ndarray


def gaps(motion: Motion) -> Gaps:
    """Gaps where a motion is."""
    system, velocities = motion.system, np.concatenate([motion.quasi_velocities(), motion.state.v])
    placed = system.contacts.placed
    J = np.zeros((len(placed), velocities.size))
    C, D, width = (np.zeros(len(placed)) for _ in range(3))
    for i, (contact, rows) in enumerate(zip(placed, system.contacts.rows(motion), strict=True)):
        for body, A in zip(contact.bodies, rows.A, strict=True):
            J[i, 6 * body : 6 * body + 6] = A
        for joint, B in zip(contact.joints, rows.B, strict=True):
            columns = system.joints[joint].v
            J[i, system.Phi.size + columns.start : system.Phi.size + columns.stop] = B
        C[i], D[i], width[i] = rows.C[0], rows.D[0], rows.gap[0]
    return Gaps(width, J @ velocities - C, J, C, D)


def closed(found: Gaps, speed: float) -> np.ndarray:
    """Numbers of the gaps that are closed: touching and not opening, where rates go up to ``speed``."""
    return np.flatnonzero((found.width <= TOUCHING) & (found.rate <= RESTING * (1.0 + speed)))


def with_contacts(motion: Motion, compulsion: Compulsion) -> Compulsion:
    """Compulsion with the rows G x ≤ h of the gaps that are closed."""
    if not motion.system.contacts.placed:
        return compulsion
    found = gaps(motion)
    return with_gaps(compulsion, found, closed(found, np.abs(motion.state.v).max(initial=0.0)))


def with_gaps(compulsion: Compulsion, found: Gaps, which: np.ndarray) -> Compulsion:
    """Compulsion with the rows G x ≤ h of some gaps."""
    return replace(compulsion, G=-found.J[which], h=-found.D[which])


def gap_kernel(system: System) -> Kernel:
    """Machine code for (t, q, v) → widths and rates of all gaps, (2 m,)."""

    def flat(t, q, v):
        motion = kinematics(system, State(t[0], q, v))
        velocities, widths, rates = motion.quasi_velocities(), [], []
        for contact, rows in zip(system.contacts.placed, system.contacts.rows(motion), strict=True):
            rate = -rows.C[0]
            for body, A in zip(contact.bodies, rows.A, strict=True):
                rate = rate + A[0] @ velocities[6 * body : 6 * body + 6]
            for joint, B in zip(contact.joints, rows.B, strict=True):
                rate = rate + B[0] @ v[system.joints[joint].v]
            widths.append(rows.gap[0])
            rates.append(rate)
        return widths, rates

    return trace(flat, 1, system.n_q, system.n_v, batch=False)
