"""All contacts of shapes at one sample of a motion: where, how far apart, with which forces, and how fast they slide."""

import warnings
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from gauss.analysis.contact_forces import NOT_UNIQUE, by_pair_kernels, forces_at
from gauss.backends import Backend
from gauss.dynamics.contact.contact_geometry import contact_geometry
from gauss.dynamics.contact.contact_stepper import lent_stepper
from gauss.dynamics.gap_functions import TOUCHING
from gauss.dynamics.kinematics import kinematics
from gauss.errors import NonUniqueReactionWarning, StateError, require
from gauss.scene import Contact
from gauss.shapes import Shaped
from gauss.simulation import Trajectory
from gauss.simulation.trajectory import is_index

NEAR = 1e-3  # of the scene's length: what touches is nearer, and what a step of time stepping may close


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
    step that follows the sample. Points, normals and gaps are those that this step evaluates: at the sample, or where there
    is no impact half a step later.

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
        If single forces are not unique, as of :func:`gauss.contact_forces`; not with time stepping, which does not look.

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
    if not is_index(sample, len(trajectory)):
        raise StateError(f"contact_points: expected a sample from 0 to {len(trajectory) - 1}, got {sample!r:.80}.")
    index = range(len(trajectory))[sample]
    rows = _of_step(trajectory, index) if by_pair_kernels(trajectory) else _of_gaps(trajectory, index, backend)
    system, shapes = trajectory.system, trajectory.system.scene.shapes
    kept = (rows.normal_force != 0.0) | (rows.gap <= TOUCHING * system.scale.length)
    contacts = [contact for contact, keep in zip(rows.contacts, kept, strict=True) if keep]
    point, normal, gap, force, friction = (part[kept] for part in rows[1:])
    bodies = tuple((shapes[one.shape].body, shapes[one.other].body) for one in contacts)
    motion = kinematics(system, trajectory.state(index))
    rates = [motion.velocity_at(a, x) - motion.velocity_at(b, x) for (a, b), x in zip(bodies, point, strict=True)]
    rate = np.reshape(rates, (-1, 3))
    slip = rate - (rate * normal).sum(axis=1)[:, None] * normal
    names = tuple(one.name for one in contacts)
    return ContactPoints(float(trajectory.t[index]), names, bodies, point, normal, gap, force, friction, slip)


class _Rows(NamedTuple):
    """Near contacts, as of :class:`ContactPoints`."""

    contacts: list[Contact]
    point: np.ndarray
    normal: np.ndarray
    gap: np.ndarray
    normal_force: np.ndarray
    friction: np.ndarray


def _of_step(trajectory: Trajectory, index: int) -> _Rows:
    """Contacts of the step that follows a sample, where it evaluates them."""
    assert trajectory.step is not None
    with lent_stepper(trajectory.system, removal=trajectory.removal) as stepper:
        stepper.forget()
        step, table = stepper.step_over(trajectory.state(index), trajectory.step), stepper.table
    near, force = step.contacts, step.force
    assert near is not None and force is not None  # a step by Python
    sides = table.sides(near.key)[:, None]
    friction = sides * (force[:, 1:, None] * near.axes[:, 1:]).sum(axis=1)
    contacts = [table.contacts[law] for law in near.law.tolist()]
    return _Rows(contacts, near.place, sides * near.axes[:, 0], near.gap, force[:, 0], friction)


def _of_gaps(trajectory: Trajectory, index: int, backend) -> _Rows:
    """Near contacts at a sample, with the forces of their gaps."""
    system = trajectory.system
    geometry = contact_geometry(system)
    found = geometry.find(kinematics(system, trajectory.state(index)), NEAR * system.scale.length)
    normal, friction, ambiguous = forces_at(trajectory, index, backend)
    if ambiguous:
        warnings.warn(NOT_UNIQUE.format("single contacts"), NonUniqueReactionWarning, stacklevel=3)
    contacts = [geometry.contact_of(place)[0] for place in found.place.tolist()]
    return _Rows(contacts, found.point, found.normal, found.width, normal[found.place], friction[found.place])
