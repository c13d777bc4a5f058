"""All contacts of shapes at one sample of a motion: where, how far apart, with which forces, and how fast they slide."""

import warnings
from dataclasses import dataclass

import numpy as np

from gauss.analysis.contact_forces import NOT_UNIQUE, forces_at
from gauss.backends import Backend
from gauss.dynamics.contact.contact_geometry import ContactGeometry, NearGaps, contact_geometry
from gauss.dynamics.gap_functions import TOUCHING
from gauss.dynamics.kinematics import Kinematics, kinematics
from gauss.errors import NonUniqueReactionWarning, StateError, require
from gauss.shapes import Shaped
from gauss.simulation import Trajectory

NEAR, WIDER, ATTEMPTS = 1e-3, 10.0, 3  # distance of contacts looked for first, of the scene's length; growth; how often


@dataclass(frozen=True, eq=False)
class ContactPoints:
    """Contacts of shapes at one sample of a motion, n of them.

    Parameters
    ----------
    t : float
        When [s].
    names : tuple of str
        Contact of the scene of each point.
    bodies : tuple of tuple of str
        Its two bodies, or "ground".
    point, normal : ndarray, shape (n, 3)
        Where [m], and the unit normal out of the second body, in world axes.
    gap : ndarray, shape (n,)
        Contact distance, negative for penetration [m].
    normal_force : ndarray, shape (n,)
        Normal force [N].
    friction : ndarray, shape (n, 3)
        Friction force on the first body, in world axes [N].
    slip : ndarray, shape (n, 3)
        Tangential velocity of the first body relative to the second at the point, in world axes [m/s].
    """

    t: float
    names: tuple[str, ...]
    bodies: tuple[tuple[str, str], ...]
    point: Shaped[np.ndarray, "n 3"]
    normal: Shaped[np.ndarray, "n 3"]
    gap: Shaped[np.ndarray, " n"]
    normal_force: Shaped[np.ndarray, " n"]
    friction: Shaped[np.ndarray, "n 3"]
    slip: Shaped[np.ndarray, "n 3"]

    @property
    def force(self) -> Shaped[np.ndarray, "n 3"]:
        """Force on the first body, normal force and friction, in world axes [N]."""
        return self.normal_force[:, None] * self.normal + self.friction

    def __len__(self):
        return len(self.names)

    def __repr__(self):
        return f"ContactPoints({len(self)} points of {len(set(self.names))} contacts at {self.t:.6g} s)"


def contact_points(trajectory: Trajectory, sample: int = -1, backend: str | Backend | type = "auto") -> ContactPoints:
    """All contacts of shapes at one sample that are closed or bear a force, in one pass; other samples are not computed.

    Forces are those of :func:`gauss.contact_forces` and :func:`gauss.friction_forces`: with time stepping means over the
    step that follows the sample.

    Parameters
    ----------
    trajectory : Trajectory
        The motion.
    sample : int
        Number of the sample; negative ones count from the end. That at a time: ``np.searchsorted(trajectory.t, t)``.
    backend : str, Backend or class
        Solver of a motion without time stepping, see :func:`gauss.solve`.

    Returns
    -------
    ContactPoints
        One row for each contact point; none where nothing touches.

    Warns
    -----
    NonUniqueReactionWarning
        If single forces are not unique, as of :func:`gauss.contact_forces`.

    Raises
    ------
    StateError
        If there is no such sample.
    SimulationError
        If the sample has no certified solution.

    Examples
    --------
    >>> import gauss
    >>> scene = gauss.load("block_on_incline")
    >>> motion = gauss.simulate(scene, 0.1, integrator="time_stepping", step=1e-3)
    >>> found = gauss.contact_points(motion, 50)
    >>> found
    ContactPoints(4 points of 1 contacts at 0.05 s)
    """
    require(trajectory, (Trajectory,), "contact_points")
    require(sample, (int, np.integer), "contact_points: sample")
    if not -len(trajectory) <= sample < len(trajectory):
        raise StateError(f"contact_points: expected a sample from 0 to {len(trajectory) - 1}, got {sample}.")
    system, index = trajectory.system, range(len(trajectory))[sample]
    normal, friction, ambiguous = forces_at(trajectory, index, backend)
    if ambiguous:
        warnings.warn(NOT_UNIQUE.format("single contacts"), NonUniqueReactionWarning, stacklevel=2)
    geometry, motion = contact_geometry(system), kinematics(system, trajectory.state(index))
    bearing = (normal != 0.0) | (friction != 0.0).any(axis=1)
    found = _near(geometry, motion, np.intersect1d(np.flatnonzero(bearing), geometry.places))
    kept = bearing[found.place] | (found.width <= TOUCHING * system.scale.length)
    place, gap, point, along = (part[kept] for part in found)
    contacts = [geometry.contact_of(one)[0] for one in place.tolist()]
    shapes = system.scene.shapes
    bodies = tuple((shapes[one.shape].body, shapes[one.other].body) for one in contacts)
    rates = [motion.velocity_at(a, x) - motion.velocity_at(b, x) for (a, b), x in zip(bodies, point, strict=True)]
    rate = np.reshape(rates, (-1, 3))
    slip = rate - (rate * along).sum(axis=1)[:, None] * along
    names = tuple(one.name for one in contacts)
    return ContactPoints(float(trajectory.t[index]), names, bodies, point, along, gap, normal[place], friction[place], slip)


def _near(geometry: ContactGeometry, motion: Kinematics, bearing: np.ndarray) -> NearGaps:
    """Near gaps of a state, those that bear a force among them, even where these close within the step alone."""
    reach = NEAR * motion.system.scale.length
    for _ in range(ATTEMPTS):
        found = geometry.find(motion, reach)
        missing = np.setdiff1d(bearing, found.place)
        if not missing.size:
            return found
        reach *= WIDER
    for place in missing.tolist():  # before the step other features are the nearest ones
        contact, number = geometry.contact_of(place)
        touch = contact.places(motion.system.scene)[number].touch(motion)
        found = NearGaps(*(np.append(part, [one], axis=0) for part, one in zip(found, (place, *touch), strict=True)))
    return found
