"""What a step of a mechanism with contacts begins with, what it solves, and what it finds."""

from typing import NamedTuple

import numpy as np

from gauss.dynamics.contact.contact_changes import ModesOfStep
from gauss.dynamics.contact.mechanism_kernels import MechanismTerms
from gauss.dynamics.contact.mechanism_rows import StepRows
from gauss.dynamics.contact.near_contacts import NearContacts
from gauss.dynamics.contact.paradox import Paradox


class MechanismStep(NamedTuple):
    """Result of one step."""

    q: np.ndarray  # q (n_q,), v (n_v,): coordinates and rates at its end
    v: np.ndarray
    contacts: NearContacts | None  # near contacts; None of a step by machine code
    force: np.ndarray | None  # mean forces with impulses along their normals and tangents [N]
    others: np.ndarray | None  # those of other unilateral constraints, and of set-valued elements [N, N m]
    power: np.ndarray  # (3,) mean power of drives, of forces on bodies, and of dissipation [W]
    error: float | None  # error of the laws in units of the scene; None for the convex relaxation
    paradoxes: list[Paradox]  # contacts with undetermined forces
    modes: ModesOfStep | None  # elements that bear a force; None of a step by machine code


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
    """A step before its contact problem is solved."""

    begun: FreeStep  # the bodies
    near: NearContacts  # near, rows: near contacts, and rows of all gaps and set-valued elements
    rows: StepRows
    # (n,) rates of the rows after the step without forces, less the least that gaps may have; in units of the rows
    after: np.ndarray
