"""Contact points of bodies along a motion, and contact forces."""

import warnings
from typing import NamedTuple

import numpy as np

from gauss.analysis import contact_forces, friction_forces
from gauss.errors import NonUniqueReactionWarning
from gauss.scene import Box, Capsule, Collider, Contact, FeaturePair, Points, Sphere
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
        bounds = [_ball_around(scene.shapes[name]) for name in (contact.shape, contact.other)]
        near = [k for k, at in enumerate(pictures.motions) if not _are_apart(bounds, at, NEAR * size)]
        for place, force in zip(places, _forces(motion, contact, places).transpose(1, 0, 2), strict=True):
            points, gap = np.zeros((len(pictures.t), 3)), np.full(len(pictures.t), np.inf)
            for k in near:
                gap[k], points[k], _ = place.touch(pictures.motions[k])
            smooth = np.stack([np.interp(pictures.t, motion.t, part) for part in force.T], axis=1)
            found.append(TouchingPoint(points, smooth, gap < NEAR * size))
    return found


def _ball_around(shape: Collider) -> tuple[str, np.ndarray, float] | None:
    """Body, centre [m] in its frame, and radius [m] of a ball around a shape with corners; None of other shapes."""
    if not isinstance(shape, Box | Capsule | Points | Sphere):
        return None
    corners = np.reshape(np.asarray(shape.corners, dtype=float), (-1, 3))
    centre = corners.mean(axis=0)
    return shape.body, centre, float(np.linalg.norm(corners - centre, axis=1).max()) + shape.radius


def _are_apart(bounds: list, at, distance: float) -> bool:
    """Whether the balls around two shapes are farther apart than a distance: most pairs of many bodies never meet."""
    if None in bounds:
        return False
    (one, x, radius), (other, y, other_radius) = bounds
    return np.linalg.norm(at.position(one, x) - at.position(other, y)) > radius + other_radius + distance


def _forces(motion: Trajectory, contact: Contact, places: list[FeaturePair]) -> np.ndarray:
    """Forces on the first body of a contact (samples, places, 3) [N]."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NonUniqueReactionWarning)  # a picture sizes nothing
        normal = contact_forces(motion, contact.name)
        along = np.zeros((*normal.shape, 3))
        for k, place in np.argwhere(normal).tolist():  # most places of many bodies bear nothing most of the time
            along[k, place] = places[place].touch(motion.motions[k]).normal
        sliding = friction_forces(motion, contact.name) if motion.step is not None else 0.0
    return normal[..., None] * along + sliding
