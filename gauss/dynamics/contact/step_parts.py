"""What a step of free bodies or of a mechanism with contacts begins with, what it solves, and what it finds."""

from typing import NamedTuple

import numpy as np

from gauss.dynamics.contact.contact_changes import ModesOfStep
from gauss.dynamics.contact.mechanism_kernels import MechanismTerms
from gauss.dynamics.contact.mechanism_rows import StepRows
from gauss.dynamics.contact.near_detection import NearContacts
from gauss.dynamics.contact.paradox import Paradox


class FreeBodyStep(NamedTuple):
    """Result of one step of free bodies."""

    q: np.ndarray  # q (n_q,), v (n_v,): coordinates and rates at its end
    v: np.ndarray
    contacts: NearContacts  # near contacts
    force: np.ndarray  # (m, 3) mean forces with impulses along normals and tangents [N]
    power: np.ndarray  # (3,) mean power of drives, of forces on bodies, and of dissipation, which is that of contacts [W]
    error: float | None  # error of the laws, relative; None for the convex relaxation
    paradoxes: list[Paradox]  # none: contacts of many free bodies are not examined for Painlevé's paradox
    modes: ModesOfStep | None  # elements that bear a force; None where their modes are those of the last step


class BegunStep(NamedTuple):
    """Free bodies after the share of a step, n moving ones in columns."""

    q: np.ndarray  # (7, n) coordinates
    bodies: np.ndarray  # (24, k) poses, velocities and their rates of all bodies, the ground last
    both: np.ndarray  # (k, 8, 2) velocities before the step, and after it without contacts; rows end with two zeros
    mass: np.ndarray  # (n, 20) inertia, its inverse, mass, its inverse
    v: np.ndarray  # (n_v,) rates of the joints before the step


class MechanismStep(NamedTuple):
    """Result of one step of a mechanism."""

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
    """Terms of a mechanism after the share of a step, and what follows from them without contact forces."""

    q: np.ndarray  # (n_q,) coordinates
    terms: MechanismTerms
    H: np.ndarray  # (n_v, n_v) compliance
    offset: np.ndarray  # (n_v,) accelerations by the biases of loops
    acceleration: np.ndarray  # (n_v,)
    power: np.ndarray  # (3,) of the loads [W]; it leaves implicit damping out
    implicit: np.ndarray | None  # (n_v,) inertias that implicit damping of joints adds; None where it is not stiff


class OpenStep(NamedTuple):
    """A step before its contact problem is solved."""

    begun: FreeStep  # the bodies
    near: NearContacts  # near, rows: near contacts, and rows of all gaps and set-valued elements
    rows: StepRows
    # (n,) rates of the rows after the step without forces, less the least that gaps may have; in units of the rows
    after: np.ndarray
