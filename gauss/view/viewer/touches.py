"""Contact points of bodies along a motion, and contact forces."""

import warnings
from typing import NamedTuple

import numpy as np

from gauss.analysis import contact_forces, friction_forces
from gauss.errors import NonUniqueReactionWarning
from gauss.scene import Contact, FeaturePair
from gauss.simulation import Trajectory

NEAR = 1e-3  # of the size of a mechanism: what is no farther apart is drawn as touching


class TouchingPoint(NamedTuple):
    """One place where bodies may touch, in every picture."""

    points: np.ndarray  # points, forces (k, 3): where [m], and the force on the first body [N]; world axes
    forces: np.ndarray
    closed: np.ndarray  # (k,) whether it is closed


def touches(motion: Trajectory, pictures: Trajectory, size: float) -> list[TouchingPoint]:
    """Places of all contacts.

    Parameters
    ----------
    motion : Trajectory
        The motion as it was computed: only there contacts are closed to the last digits, so that forces can be found.
    pictures : Trajectory
        The same at the times of the pictures.
    size : float
        Size of the mechanism [m].
    """
    scene, found = motion.system.scene, []
    for contact in scene.contacts.values():
        if not isinstance(contact, Contact):
            continue
        places = contact.places(scene)
        for place, force in zip(places, _forces(motion, contact, places).transpose(1, 0, 2), strict=True):
            here = [place.touch(at) for at in pictures.motions]
            gap = np.array([touch.gap for touch in here], dtype=float)
            smooth = np.stack([np.interp(pictures.t, motion.t, part) for part in force.T], axis=1)
            found.append(TouchingPoint(np.array([touch.place for touch in here], dtype=float), smooth, gap < NEAR * size))
    return found


def _forces(motion: Trajectory, contact: Contact, places: list[FeaturePair]) -> np.ndarray:
    """Forces on the first body of a contact (samples, places, 3) [N]."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NonUniqueReactionWarning)  # a picture sizes nothing
        normal = contact_forces(motion, contact.name)
        along = np.zeros((*normal.shape, 3))
        for k in np.flatnonzero(normal.any(axis=1)):  # most pairs of many bodies bear nothing most of the time
            along[k] = [place.touch(motion.motions[k]).normal for place in places]
        sliding = friction_forces(motion, contact.name) if motion.step is not None else 0.0
    return normal[..., None] * along + sliding
