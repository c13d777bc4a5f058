"""Parts of a step of free bodies: its result, and the bodies as they begin it."""

from typing import NamedTuple

import numpy as np

from gauss.dynamics.contact.contact_changes import ModesOfStep
from gauss.dynamics.contact.near_contacts import NearContacts
from gauss.dynamics.contact.paradox import Paradox


class FreeBodyStep(NamedTuple):
    """Result of one step."""

    q: np.ndarray  # q (n_q,), v (n_v,): coordinates and rates at its end
    v: np.ndarray
    contacts: NearContacts  # near contacts
    force: np.ndarray  # (m, 3) mean forces with impulses along normals and tangents [N]
    power: np.ndarray  # (3,) mean power of drives, of forces on bodies, and of dissipation, which is that of contacts [W]
    error: float | None  # error of the laws, relative; None for the convex relaxation
    paradoxes: list[Paradox]  # none: contacts of many free bodies are not examined for Painlevé's paradox
    modes: ModesOfStep | None  # elements that bear a force; None where their modes are those of the last step


class BegunStep(NamedTuple):
    """Bodies after the share of a step: columns for bodies, and their velocities before and after it without contacts.

    Coordinates, poses of all bodies with the ground last, velocities, masses, rates of the joints.
    """

    q: np.ndarray
    bodies: np.ndarray
    both: np.ndarray
    mass: np.ndarray
    v: np.ndarray
