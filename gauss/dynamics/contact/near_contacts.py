"""Contacts that are near at one instant: near pairs of shapes, near pairs of their features, rows of the contact problem."""

from typing import NamedTuple

import numpy as np

from gauss.dynamics.contact.pair_kernels import CYCLIC, POSE, SIZES
from gauss.dynamics.contact.shape_table import ShapeTable
from gauss.errors import SimulationError

COLUMN = POSE + SIZES + 3  # pose and sizes of a part, centre of mass of its body
# Rows of a column for each axis of a box that counts as its first, and those that distances depend on.
TURNED = np.array([[*(3 * i + a for i in range(3) for a in axes), *range(9, POSE)] for axes in CYCLIC])
COLUMNS = np.concatenate([TURNED, POSE + CYCLIC, np.tile(np.arange(POSE + 3, COLUMN), (3, 1))], axis=1)


class NearContacts(NamedTuple):
    """Contacts of one instant, m of them."""

    key: np.ndarray  # (m,) pair of parts and of their features: the same contact has the same key at all times
    law: np.ndarray  # (m,) contact of the scene
    bodies: np.ndarray  # (m, 2) bodies; −1 is the ground
    gap: np.ndarray  # (m,) contact distances [m]
    place: np.ndarray  # place (m, 3), axes (m, 3, 3): points [m]; normals and two tangents as rows, in world axes
    axes: np.ndarray
    J: np.ndarray  # (m, 2, 3, 8) rows for the twists (ω, u) of both bodies; the last two columns are zero
    bias: np.ndarray  # (m, 3) accelerations along normal and tangents while the rates are constant [m/s²]


class Overlap(NamedTuple):
    """Shapes in each other of which no pair of features says so: a contact of the scene, and how deep [m]."""

    law: int
    depth: float


def confirmed(near: NearContacts, overlaps: list[Overlap], table: ShapeTable, t: float) -> NearContacts:
    """Contacts of a state, whose shapes are not too deep in each other, and meet where they have normals.

    SimulationError if they are, or do not: it names the contact.
    """
    if overlaps:
        law, depth = overlaps[0]
        raise SimulationError(
            f"t = {t:.6g} s: shapes are {depth:.3g} m in each other, and no gap of {table.contacts[law].name!r} leads out; "
            "move them apart with scene.start, or shorten the step."
        )
    sloped = np.isfinite(near.J).all(axis=(1, 2, 3))
    if not sloped.all():
        name = table.contacts[near.law[int(np.flatnonzero(~sloped)[0])]].name
        raise SimulationError(f"t = {t:.6g} s: {name!r} has no slope; its shapes meet where they have no normal.")
    return near
