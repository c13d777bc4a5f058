"""What a step of a mechanism with contacts begins with, what it solves, and what it finds."""

from typing import NamedTuple

import numpy as np

from gauss.dynamics.contact.contact_changes import ModesOfStep
from gauss.dynamics.contact.mechanism_kernels import MechanismTerms
from gauss.dynamics.contact.mechanism_rows import StepRows
from gauss.dynamics.contact.near_contacts import NearContacts
from gauss.dynamics.contact.paradox import Paradox


class MechanismStep(NamedTuple):
    """Result of one step.

    Attributes
    ----------
    q, v : ndarray, shape (n_q,), (n_v,)
        Coordinates and rates at its end.
    contacts : NearContacts or None
        Near contacts; None of a step by machine code.
    force : ndarray, shape (m, 3), or None
        Mean forces with impulses along their normals and tangents [N].
    others : ndarray, shape (g + s,), or None
        Those of other unilateral constraints, and of set-valued elements [N, N m].
    power : ndarray, shape (3,)
        Mean power of drives, of forces on bodies, and of dissipation [W].
    error : float or None
        Error of the laws in units of the scene; None for the convex relaxation.
    paradoxes : list of Paradox
        Contacts with undetermined forces.
    modes : ModesOfStep or None
        Elements that bear a force; None of a step by machine code.
    """

    q: np.ndarray
    v: np.ndarray
    contacts: NearContacts | None
    force: np.ndarray | None
    others: np.ndarray | None
    power: np.ndarray
    error: float | None
    paradoxes: list[Paradox]
    modes: ModesOfStep | None


class FreeStep(NamedTuple):
    """Terms after the share of a step, compliance H, accelerations without forces, with loads, and power of these.

    Where damping of joints is implicit, ``implicit`` (n_v,) are the inertias that it adds, and the power leaves it out.
    """

    q: np.ndarray
    terms: MechanismTerms
    H: np.ndarray
    offset: np.ndarray
    acceleration: np.ndarray
    power: np.ndarray
    implicit: np.ndarray | None


class OpenStep(NamedTuple):
    """A step before its contact problem is solved.

    Attributes
    ----------
    begun : FreeStep
        The bodies.
    near, rows : NearContacts, StepRows
        Near contacts, and rows of all gaps and set-valued elements.
    after : ndarray, shape (n,)
        Rates of the rows after the step without forces, less the least that gaps may have; in units of the rows.
    """

    begun: FreeStep
    near: NearContacts
    rows: StepRows
    after: np.ndarray
