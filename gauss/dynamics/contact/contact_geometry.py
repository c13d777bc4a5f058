"""Gaps, points and normals of all contacts of shapes in one state of any system, by one call of the kernels of pairs."""

from threading import Lock
from typing import NamedTuple

import numpy as np

from gauss.dynamics.contact.near_detection import NearDetection, near_pairs
from gauss.dynamics.contact.shape_table import ShapeTable
from gauss.dynamics.kinematics import Kinematics
from gauss.dynamics.store import cached
from gauss.scene import Contact
from gauss.system import System, sides


class NearGaps(NamedTuple):
    """Gaps of contacts of shapes that are not wider than asked for, m of them, in the order of the scene."""

    place: np.ndarray  # (m,) their places among the gaps of the scene
    width: np.ndarray  # (m,) contact distances [m]
    point: np.ndarray  # point, normal (m, 3): where [m], and out of the second shape; world axes
    normal: np.ndarray


class ContactGeometry:
    """Contacts of the shapes of a system.

    Parameters
    ----------
    system : System
        The system.

    Attributes
    ----------
    table : ShapeTable
        Its shapes.
    places : ndarray of int
        Places of the gaps of contacts of shapes among all gaps of the scene.
    """

    def __init__(self, system: System):
        self.table, n = ShapeTable(system), system.structure.n_bodies
        self.table.body = np.where(self.table.body < 0, n, self.table.body)
        self.places = np.array(
            [k for k, side in enumerate(sides(system.scene)) if isinstance(side.whole, Contact)], dtype=int
        )
        self.detection = NearDetection(self.table, n + 1, system.scale.length, near_pairs())
        self.detection.connect()
        self.lock = Lock()  # the arrays that machine code writes are those of one call

    def find(self, motion: Kinematics, reach: float) -> NearGaps:
        """Gaps of a state that are not wider than a reach [m]."""
        bodies = np.zeros((24, len(motion.x)))
        for k, parts in enumerate(zip(motion.R, motion.x, motion.W, motion.u, strict=True)):
            bodies[:18, k] = np.concatenate([np.ravel(part) for part in parts])
        with self.lock:
            near, _ = self.detection.find(bodies, reach)
        place = self.places[self.table.gap_places(near.key)] if near.key.size else np.zeros(0, dtype=int)
        order = np.argsort(place)
        normal = near.axes[:, 0] * self.table.sides(near.key)[:, None]
        return NearGaps(*(part[order] for part in (place, near.gap, near.place, normal)))

    def contact_of(self, place: int) -> tuple[Contact, int]:
        """Contact of a gap by its place among those of the scene, and the number of the gap in that contact."""
        gap = int(np.searchsorted(self.places, place))
        number = int(np.searchsorted(self.table.gaps, gap, side="right")) - 1
        return self.table.contacts[number], gap - int(self.table.gaps[number])


def contact_geometry(system: System) -> ContactGeometry:
    """Contacts of the shapes of a system, made once for it."""
    return cached(system, (contact_geometry,), lambda: ContactGeometry(system))
