"""Rows of the contact problem of a mechanism: normals of near contacts, other gaps, tangents of rough contacts, set-valued.

    K = J_first − J_second from points and normals of the contacts,   ġ = K v,   g̈ = K v̇ + bias

Stops, ropes and gap functions are written out with the mechanism, contacts of shapes come from kernels of their pairs.
"""

from copy import copy
from typing import NamedTuple, cast

import numpy as np

from gauss.codegen.kernels.contact_modes import SLIDING, STICKING
from gauss.dynamics.constraint_scales import gap_scales, set_valued_scales
from gauss.dynamics.contact.contact_changes import ModesOfStep
from gauss.dynamics.contact.contact_step import ContactLaws
from gauss.dynamics.contact.mechanism_kernels import MechanismTerms, other_gaps
from gauss.dynamics.contact.near_detection import NearContacts
from gauss.dynamics.contact.shape_table import ShapeTable
from gauss.scene import JointDryFriction
from gauss.system import System, sides


class StepRows(NamedTuple):
    """Rows of a step: normals of contacts, other gaps, tangents of rough contacts, set-valued elements."""

    gap: np.ndarray  # gap, restitution (m,): gap functions, in their units, and their coefficients of restitution
    restitution: np.ndarray
    K: np.ndarray  # (n, n_v) Jacobian of all rows
    # rate, bias, unit (n,): rates before the step, their derivatives with v̇ = 0, and units, by which forces are divided
    rate: np.ndarray
    bias: np.ndarray
    unit: np.ndarray
    rough: np.ndarray  # (k,) contacts with friction
    friction: np.ndarray  # (k,) their coefficients


class MechanismRows:
    """Rows of one system.

    Attributes
    ----------
    others : list
        Gap functions that are no contacts of shapes.
    elements : list of str
        Names of the contacts, of these gap functions, and of the set-valued elements.
    limit, lossy : ndarray, shape (s,)
        Limits of the set-valued elements in their units, and whether their work is heat.
    contact_unit, other_unit, set_unit : float, ndarray, ndarray
        Units of the rows.
    """

    def __init__(self, system: System, table: ShapeTable):
        self.table, scene = table, system.scene
        others = {side.name for side in other_gaps(system)}
        gaps = sides(scene)
        mine = np.array([side.name in others for side in gaps], dtype=bool)
        self.others = [side for side in gaps if side.name in others]
        self.other_places, self.contact_places = np.flatnonzero(mine), np.flatnonzero(~mine)
        self.gap_count = len(gaps)
        scales = gap_scales(system)[mine] if mine.any() else np.zeros(0)
        time, length = system.scale.time, system.scale.length
        self.contact_unit, self.other_unit = time / length, time / scales
        self.set_unit = time / set_valued_scales(system)
        self.other_restitution = np.array([side.whole.restitution for side in self.others])
        self.restitution = np.concatenate([table.restitution, self.other_restitution])
        elements = cast(list[JointDryFriction], [*scene.set_valued.values()])  # others are refused
        self.coefficients = np.unique(self.restitution)
        self.limit = np.array([element.limit for element in elements]) / self.set_unit
        self.elements = [
            *(contact.name for contact in table.contacts),
            *(side.name for side in self.others),
            *scene.set_valued,
        ]
        self.lossy = np.array([element.lossy for element in elements], dtype=bool)

    def chosen(self, rows: np.ndarray, table: ShapeTable) -> "MechanismRows":
        """Rows of some of the other gaps and set-valued elements, by their numbers in order, with another table."""
        made, g = copy(self), len(self.others)
        gaps, elements = rows[rows < g], rows[rows >= g] - g
        made.table, made.others = table, [self.others[k] for k in gaps]
        made.other_places, made.other_unit = self.other_places[gaps], self.other_unit[gaps]
        made.other_restitution, made.set_unit = self.other_restitution[gaps], self.set_unit[elements]
        made.limit, made.lossy = self.limit[elements], self.lossy[elements]
        laws = len(table.contacts)
        made.elements = [*self.elements[:laws], *(self.elements[laws + k] for k in rows)]
        return made

    def of(self, terms: MechanismTerms, near: NearContacts) -> StepRows:
        """Rows of a state."""
        g, m = len(self.others), near.gap.size
        contacts = (near.J[..., :6] @ terms.J[near.bodies]).sum(axis=1)
        rates = (near.J[..., :6] @ terms.bodies[12:18].T[near.bodies][..., None]).sum(axis=1)[..., 0]
        rough = np.flatnonzero(self.table.friction[near.law])
        unit = np.full(m, self.contact_unit)
        units = np.concatenate([unit, self.other_unit, np.full(2 * rough.size, self.contact_unit), self.set_unit])

        def stacked(own, others):
            return np.concatenate([own[:, 0], others[:g], own[rough, 1:].reshape(-1, *own.shape[2:]), others[g:]])

        K = stacked(contacts, terms.K)
        return StepRows(
            np.concatenate([near.gap, terms.gap]) * units[: m + g],
            np.concatenate([self.table.restitution[near.law], self.other_restitution]),
            K * units[:, None],
            stacked(rates, terms.rate) * units,
            stacked(near.bias, terms.bias) * units,
            units,
            rough,
            self.table.friction[near.law[rough]],
        )

    def laws(self, rows: StepRows, active: np.ndarray) -> tuple[np.ndarray, ContactLaws]:
        """Active rows, and their laws."""
        m, count = active.size, int(active.sum())
        order = np.cumsum(active) - 1
        kept = np.flatnonzero(active[rows.rough])
        across = (m + 2 * kept[:, None] + np.arange(2)).ravel()
        s = self.limit.size
        which = np.concatenate([np.flatnonzero(active), across, np.arange(rows.rate.size - s, rows.rate.size)])
        places = count + np.arange(across.size).reshape(-1, 2)
        last = count + across.size + np.arange(s)
        laws = ContactLaws(np.arange(count), places, order[rows.rough[kept]], rows.friction[kept], last, self.limit)
        return which, laws

    def start(self, near: NearContacts, rows: StepRows, known) -> np.ndarray:
        """Forces (n,) of the last step in units of the rows; zero of new contacts."""
        found, others, g = near.known_forces(known.key, known.force), known.others, len(self.others)
        return np.concatenate([found[:, 0], others[:g], found[rows.rough, 1:].ravel(), others[g:]]) / rows.unit

    def split(self, rows: StepRows, near: NearContacts, force: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Forces (m, 3) of contacts, and (g + s,) of other constraints."""
        m, g, end = near.gap.size, len(self.others), force.size - self.limit.size
        contacts = np.zeros((m, 3))
        contacts[:, 0] = force[:m]
        contacts[rows.rough, 1:] = force[m + g : end].reshape(-1, 2)
        return contacts, np.concatenate([force[m : m + g], force[end:]])

    def modes(self, rows: StepRows, near: NearContacts, force, after, lost, hits, slow: float) -> ModesOfStep:
        """Elements that bear a force in a step.

        Parameters
        ----------
        force, lost : ndarray, shape (n,)
            Forces, and their work [J].
        after : ndarray, shape (n,)
            Rates of the rows after the step, as the laws take them.
        hits : ndarray of bool, shape (m,)
            Gaps with an impact.
        slow : float
            Speed below which a contact sticks, in units of the scene.
        """
        g, m, contacts = len(self.others), near.gap.size, len(self.table.contacts)
        tangents = m + g + 2 * np.arange(rows.rough.size)
        mode, heat = np.full(m + g, STICKING), -lost[: m + g]
        mode[rows.rough[np.hypot(after[tangents], after[tangents + 1]) > slow]] = SLIDING
        heat[rows.rough] -= lost[tangents] + lost[tangents + 1]
        element = np.concatenate([near.law, contacts + np.arange(g)])
        pushed, end = np.flatnonzero(force[: m + g] > 0.0), force.size - self.limit.size
        slips = np.where(np.abs(after[end:]) > slow, SLIDING, STICKING)
        return ModesOfStep(
            np.concatenate([element[pushed], contacts + g + np.arange(slips.size)]),
            np.concatenate([mode[pushed], slips]),
            np.concatenate([np.asarray(hits, dtype=float)[pushed], np.zeros(slips.size)]) > 0.0,
            np.concatenate([heat[pushed], -lost[end:]]),
        )

    def name(self, near: NearContacts, row: int) -> str:
        """Name of the gap of a row."""
        m = near.gap.size
        return self.table.contacts[near.law[row]].name if row < m else self.others[row - m].name

    def normal_forces(self, key: np.ndarray, force: np.ndarray, others: np.ndarray) -> np.ndarray:
        """Normal forces (g,) of all gaps of the scene by the keys of contacts [N]."""
        normal = np.zeros(self.gap_count)
        normal[self.other_places] = others[: len(self.others)]
        if key.size:
            normal[self.contact_places[self.table.gap_places(key)]] = force[:, 0]
        return normal

    def of_gaps(self, near: NearContacts, force: np.ndarray, others: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Normal forces (g,) of all gaps of the scene, and friction (g, 3) on the first bodies, world axes [N]."""
        normal, friction = self.normal_forces(near.key, force, others), np.zeros((self.gap_count, 3))
        if near.gap.size:
            places = self.contact_places[self.table.gap_places(near.key)]
            across = (force[:, 1:, None] * near.axes[:, 1:]).sum(axis=1)
            friction[places] = across * self.table.sides(near.key)[:, None]
        return normal, friction
