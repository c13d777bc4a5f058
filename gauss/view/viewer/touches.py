"""Contact points of bodies along a motion, and contact forces."""

import warnings
from typing import NamedTuple

import numpy as np

from gauss.analysis import contact_forces, contact_points, friction_forces
from gauss.analysis.contact_forces import by_pair_kernels
from gauss.dynamics.contact.contact_geometry import ContactGeometry, contact_geometry
from gauss.errors import NonUniqueReactionWarning
from gauss.scene import Contact
from gauss.simulation import Trajectory

NEAR = 1e-3  # of the size of a mechanism: what is no farther apart is drawn as touching


class TouchingPoint(NamedTuple):
    """One place where bodies touch, in every picture."""

    points: np.ndarray  # points, forces (k, 3): where [m], and the force on the first body [N]; world axes
    forces: np.ndarray
    closed: np.ndarray  # (k,) whether it is closed


def touches(motion: Trajectory, pictures: Trajectory, size: float) -> list[TouchingPoint]:
    """Places that are closed in some picture.

    Parameters
    ----------
    motion : Trajectory
        The motion as it was computed: only there contacts are closed to the last digits, so that forces can be found.
    pictures : Trajectory
        The same at the times of the pictures.
    size : float
        Size of the mechanism [m].
    """
    return _of_steps(motion, pictures.t) if by_pair_kernels(motion) else _of_gaps(motion, pictures, NEAR * size)


def _of_steps(motion: Trajectory, times: np.ndarray) -> list[TouchingPoint]:
    """Contacts of the samples that are nearest to some times [s], one after the other; a place has many in its time."""
    samples = np.searchsorted(0.5 * (motion.t[1:] + motion.t[:-1]), times).tolist()
    found = {k: contact_points(motion, k) for k in dict.fromkeys(samples)}
    count = max((len(one) for one in found.values()), default=0)
    points, forces = np.zeros((2, count, len(samples), 3))
    closed = np.zeros((count, len(samples)), dtype=bool)
    for picture, k in enumerate(samples):
        here = slice(len(found[k]))
        points[here, picture], forces[here, picture], closed[here, picture] = found[k].point, found[k].force, True
    return [TouchingPoint(*place) for place in zip(points, forces, closed, strict=True)]


def _of_gaps(motion: Trajectory, pictures: Trajectory, reach: float) -> list[TouchingPoint]:
    """Gaps that are not wider than a reach [m] in some picture."""
    if not any(isinstance(contact, Contact) for contact in motion.system.scene.contacts.values()):
        return []
    geometry = contact_geometry(motion.system)
    near = [geometry.find(at, reach) for at in pictures.motions]
    gaps = np.unique(np.concatenate([one.place for one in near]))
    points, closed = np.zeros((len(gaps), len(near), 3)), np.zeros((len(gaps), len(near)), dtype=bool)
    for picture, one in enumerate(near):
        row = np.searchsorted(gaps, one.place)
        points[row, picture], closed[row, picture] = one.point, True
    forces = _forces(motion, geometry, gaps)
    smooth = np.array([[np.interp(pictures.t, motion.t, part) for part in force.T] for force in forces])
    drawn = np.moveaxis(smooth.reshape(len(gaps), 3, len(near)), 1, 2)
    return [TouchingPoint(*place) for place in zip(points, drawn, closed, strict=True)]


def _forces(motion: Trajectory, geometry: ContactGeometry, gaps: np.ndarray) -> np.ndarray:
    """Forces on the first bodies of contacts at some gaps (g, samples, 3) [N]; none of a scene that is not simulated.

    Gaps of a scene that is not simulated need not have a closed form.
    """
    found = np.zeros((len(gaps), len(motion), 3))
    if not motion.stats.steps:
        return found
    named = [geometry.contact_of(gap) for gap in gaps.tolist()]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NonUniqueReactionWarning)  # a picture sizes nothing
        for row, (contact, number) in enumerate(named):
            place = contact.places(motion.system.scene)[number]
            normal = contact_forces(motion, contact.name)[:, number]
            for k in np.flatnonzero(normal).tolist():  # most places bear nothing most of the time
                found[row, k] = normal[k] * place.touch(motion.motions[k]).normal
            if motion.step is not None:
                found[row] += friction_forces(motion, contact.name)[:, number]
    return found
