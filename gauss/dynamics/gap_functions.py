"""Gap functions d of unilateral constraints: ḋ = A v + B q̇ − C and d̈ = A a + B q̈ − D.

A closed gap requires d̈ ≥ 0, hence G = −[A B], h = −D: the compulsion with such rows is the exact statement of frictionless
unilateral constraints (Gauss 1829; Moreau 1963). Closed gaps are those with d = 0 and ḋ ≤ 0.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from gauss.backends.compulsion import Compulsion
from gauss.codegen import Kernel, trace, write
from gauss.dynamics.constraint_scales import gap_scales
from gauss.dynamics.kinematics import Kinematics, kinematics
from gauss.errors import SceneError
from gauss.scene import Contact, FeaturePair
from gauss.system import Relations, State, System, guards, sides
from gauss.system.relations import place_residuals

TOUCHING = 1e-8  # distance over its scale below which a gap is closed; integration leaves about 1e-10
RESTING = 1e-8  # opening rate over its scale and the fastest rate, below which a gap does not open


class Gaps(NamedTuple):
    """Gap functions of one state, in the order of ``system.contacts``."""

    width: np.ndarray  # width, rate (m,): d [m, rad] and ḋ
    rate: np.ndarray
    J: np.ndarray  # (m, 6n + p) gradients [A B] with respect to (v, q̇)
    C: np.ndarray  # C, D (m,): ḋ = J (v, q̇) − C and d̈ = J (a, q̈) − D
    D: np.ndarray


class Slips(NamedTuple):
    """Tangential velocities of contacts with friction, in the order of ``system.slips``."""

    gap: np.ndarray  # (k,) gap of each
    friction: np.ndarray  # (k,) coefficient of friction
    rate: np.ndarray  # (k, 2) slip velocity along two tangential directions [m/s]
    J: np.ndarray  # (k, 2, 6n + p) its gradients with respect to (v, q̇)
    D: np.ndarray  # (k, 2) the slip acceleration is J (a, q̈) − D
    axes: np.ndarray  # (k, 2, 3) the two directions, in world axes


def gaps(motion: Kinematics) -> Gaps:
    """Gap functions of a state."""
    J, C, D, width = stacked_rows(motion, motion.system.contacts)
    velocities = np.concatenate([motion.quasi_velocities(), motion.state.v])
    return Gaps(width, J @ velocities - C, J, C, D)


def slips(motion: Kinematics) -> Slips:
    """Tangential velocities of a state."""
    system = motion.system
    J, C, D, _ = stacked_rows(motion, system.slips)
    velocities = np.concatenate([motion.quasi_velocities(), motion.state.v])
    places = {placed.name: i for i, placed in enumerate(system.contacts.placed)}
    gap = np.array([places[placed.name] for placed in system.slips.placed], dtype=int)
    rough = [contact for contact in system.scene.contacts.values() for _ in contact.sides(system.scene)]
    friction = np.array([rough[i].friction for i in gap])
    rate, J = (J @ velocities - C).reshape(-1, 2), J.reshape(-1, 2, velocities.size)
    axes = [_directions(system, contact, rows) for contact, rows in zip((rough[i] for i in gap), J, strict=True)]
    return Slips(gap, friction, rate, J, D.reshape(-1, 2), np.array(axes).reshape(-1, 2, 3))


def _directions(system: System, contact: Contact, rows: np.ndarray) -> np.ndarray:
    """Tangential directions (2, 3): gradients with respect to the velocity of the first body."""
    first, second = (system.frame(system.scene.shapes[name].body).body for name in (contact.shape, contact.other))
    body, sign = (first, 1.0) if first >= 0 else (second, -1.0)
    place = 6 * body + 3
    return sign * rows[:, place : place + 3]


def set_valued_rows(motion: Kinematics):
    """Slip rates (g,) of the set-valued elements, gradients J (g, 6n + p), and D of the slip accelerations J (a, q̈) − D."""
    J, C, D, _ = stacked_rows(motion, motion.system.set_valued)
    return J @ np.concatenate([motion.quasi_velocities(), motion.state.v]) - C, J, D


def stacked_rows(motion: Kinematics, relations: Relations):
    """Gradients with respect to (v, q̇), C, D and position residuals of relations, stacked."""
    system = motion.system
    size = sum(placed.size for placed in relations.placed)
    J = np.zeros((size, system.Phi.size + system.n_v))
    C, D, gap = (np.zeros(size) for _ in range(3))
    start = 0
    for placed, rows in zip(relations.placed, relations.rows(motion), strict=True):
        own = slice(start, start + placed.size)
        for body, A in zip(placed.bodies, rows.A, strict=True):
            J[own, 6 * body : 6 * body + 6] = A
        for joint, B in zip(placed.joints, rows.B, strict=True):
            columns = system.joints[joint].v
            J[own, system.Phi.size + columns.start : system.Phi.size + columns.stop] = B
        C[own], D[own], gap[own] = rows.C, rows.D, rows.gap
        start += placed.size
    return J, C, D, gap


def closed(system: System, found: Gaps, v: np.ndarray) -> np.ndarray:
    """Closed gaps: those that touch and do not open, for rates v."""
    sizes = gap_scales(system)
    return np.flatnonzero((found.width <= TOUCHING * sizes) & (found.rate <= RESTING * system.scale.fastest(v) * sizes))


def with_contacts(motion: Kinematics, compulsion: Compulsion) -> Compulsion:
    """Compulsion with the rows G x ≤ h of the closed gaps.

    SceneError if there is friction of contacts or of joints, a clutch, a limited drive or a lossy gear: these are no rows.
    """
    system = motion.system
    if system.slips.placed or system.set_valued.placed or system.losses:
        rough = [contact.name for contact in system.scene.contacts.values() if getattr(contact, "friction", 0.0)]
        raise SceneError(
            f"{', '.join(dict.fromkeys([*system.scene.set_valued, *rough, *system.losses]))}: friction, clutches, limited "
            "drives and losses are no rows of a compulsion; simulate() solves them, and reactions(), contact_forces() and "
            "set_valued_forces() tell of its motion."
        )
    if not system.contacts.placed:
        return compulsion
    found = gaps(motion)
    return with_gaps(compulsion, found, closed(system, found, motion.state.v))


def with_gaps(compulsion: Compulsion, found: Gaps, which: np.ndarray) -> Compulsion:
    """Compulsion with the rows G x ≤ h of some gaps."""
    return replace(compulsion, G=-found.J[which], h=-found.D[which])


def gap_kernel(system: System) -> Kernel:
    """Machine code of (t, q, v) → gap functions of all gaps and then of all guards, and their rates, (2 m,)."""
    watched = place_residuals(system, [*sides(system.scene), *guards(system.scene)])

    def flat(t, q, v):
        return [watched.values(kinematics(system, State(t[0], q, v)))]

    function = write(flat, 1, system.n_q, system.n_v)
    return Kernel(function, batch=False)


def margin_kernel(system: System, places: Sequence[FeaturePair]) -> Kernel:
    """Machine code of (t, q, v) → margins of places with fixed features (k,) [m]; a place is left where one is negative."""

    def flat(t, q, v):
        motion = kinematics(system, State(t[0], q, v))
        return [[place.margin(motion) for place in places]]

    return trace(flat, 1, system.n_q, system.n_v, batch=False)
