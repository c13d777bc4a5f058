"""Parts of a step of free bodies: its result, and the bodies as they begin it."""

from typing import NamedTuple

import numpy as np

from gauss.dynamics.contact.contact_changes import ModesOfStep
from gauss.dynamics.contact.near_contacts import NearContacts
from gauss.dynamics.contact.paradox import Paradox


class FreeBodyStep(NamedTuple):
    """Result of one step.

    Attributes
    ----------
    q, v : ndarray, shape (n_q,), (n_v,)
        Coordinates and rates at its end.
    contacts : NearContacts
        Near contacts.
    force : ndarray, shape (m, 3)
        Mean forces with impulses along normals and tangents [N].
    power : ndarray, shape (3,)
        Mean power of drives, of forces on bodies, and of dissipation, which is that of contacts [W].
    error : float or None
        Error of the laws, relative; None for the convex relaxation.
    paradoxes : list of Paradox
        None: contacts of many free bodies are not examined for Painlevé's paradox.
    modes : ModesOfStep or None
        Elements that bear a force; None where their modes are those of the last step.
    """

    q: np.ndarray
    v: np.ndarray
    contacts: NearContacts
    force: np.ndarray
    power: np.ndarray
    error: float | None
    paradoxes: list[Paradox]
    modes: ModesOfStep | None


class BegunStep(NamedTuple):
    """Bodies after the share of a step: columns for bodies, and their velocities before and after it without contacts.

    Coordinates, poses of all bodies with the ground last, velocities, masses, rates of the joints.
    """

    q: np.ndarray
    bodies: np.ndarray
    both: np.ndarray
    mass: np.ndarray
    v: np.ndarray
