"""Steps of some trees of a mechanism while the others sleep: these stand still, and have no contacts among themselves.

What sleeps at once is a group of coordinates that move by themselves (:mod:`gauss.dynamics.contact.coordinate_groups`): a
tree of joints, with the trees that loads, ropes and loops connect with it. Its rates are left out of the compliance, its
stops and dry frictions out of the rows of the step.
"""

from copy import copy

import numpy as np

from gauss.dynamics.contact.compiled_mechanism_step import KnownForces, MechanismMemory
from gauss.dynamics.contact.contact_changes import ModeRecord
from gauss.dynamics.contact.coordinate_groups import bodies_of_groups, coordinate_groups
from gauss.dynamics.contact.mechanism_kernels import MechanismKernels
from gauss.dynamics.contact.mechanism_step import MechanismStepper
from gauss.dynamics.contact.near_detection import NearDetection
from gauss.dynamics.contact.step_parts import MechanismStep
from gauss.linked_groups import linked_groups
from gauss.system import State


class TreeSleepers:
    """What may sleep of a mechanism.

    Parameters
    ----------
    whole : MechanismStepper
        Stepper of all bodies.

    Attributes
    ----------
    rates : list of ndarray of int
        Rates of each group.
    bodies : list of tuple of str
        Its bodies.
    able : ndarray of bool, shape (n,)
        Whether it may sleep: no law of time acts on it, and no prescribed motion.
    """

    def __init__(self, whole: MechanismStepper):
        self.whole, self.rows = whole, whole.rows
        self.groups = coordinate_groups(whole.system, whole.smooth, whole.carriers, whole.held)
        self.count, of_rate = self.groups.timed.size, self.groups.of_rate
        self.rates = [np.flatnonzero(of_rate == k) for k in range(self.count)]
        self.able = ~self.groups.timed
        self.of_body = np.append(self.groups.of_carrier, -1)
        self.rests = np.append(self.groups.of_carrier < 0, True)
        self.gaps, self.laws = len(self.rows.others), len(whole.table.contacts)
        self.bodies = bodies_of_groups(whole.smooth, self.groups)
        self.length = whole.system.scale.length / whole.system.scale.coordinates

    def known_of_none(self) -> KnownForces:
        """Forces on nothing."""
        return KnownForces(np.zeros(0, dtype=np.int64), np.zeros((0, 3)), np.zeros(0), 0.0)

    def speeds(self, v: np.ndarray, state: State) -> np.ndarray:
        """Speeds (k, n) of each group in states near a given one, of rates (k, n_v) [m/s].

        That of the fastest point of its shapes; of rates that move no shape, of points one length of the scene away.
        """
        whole, found = self.whole, np.zeros((len(v), self.count))
        J = whole.kernels.terms(state.t, state.q, state.v, whole.inputs).J[: whole.n]
        twists = np.einsum("bij,kj->bki", J, v)
        points = np.linalg.norm(twists[..., 3:], axis=2) + np.linalg.norm(twists[..., :3], axis=2) * whole.reach[:-1, None]
        for group, speed in zip(self.groups.of_carrier, points, strict=True):
            if group >= 0:
                found[:, group] = np.maximum(found[:, group], speed)
        moves = np.abs(J).reshape(-1, v.shape[1]).any(axis=0)
        for rate in np.flatnonzero(~moves):
            group = self.groups.of_rate[rate]
            found[:, group] = np.maximum(found[:, group], np.abs(v[:, rate]) * self.length[rate])
        return found

    def kinetic_energies(self, state: State) -> np.ndarray:
        """Kinetic energy (n,) of each group [J]."""
        whole = self.whole
        M = whole.kernels.terms(state.t, state.q, state.v, whole.inputs).M
        return np.array([0.5 * state.v[rates] @ M[np.ix_(rates, rates)] @ state.v[rates] for rates in self.rates])

    def _groups_of(self, key: np.ndarray) -> np.ndarray:
        """Groups (m, 2) of the bodies of contacts by their keys; −1 of those that stand still."""
        return self.of_body[self.whole.table.bodies(key)]

    def islands(self, known: KnownForces) -> np.ndarray:
        """Number (n,) of the island of each group, by contacts and stops that bear a force; −1 of groups without one."""
        pairs = self._groups_of(known.key[known.force[:, 0] > 0.0])
        stopped = self.groups.of_row[: self.gaps][known.others[: self.gaps] > 0.0]
        root = linked_groups(self.count, pairs[(pairs >= 0).all(axis=1)].tolist())
        held = np.unique(np.concatenate([pairs.ravel(), stopped]))
        found = np.full(self.count, -1)
        found[held[held >= 0]] = root[held[held >= 0]]
        return found

    def _asleep_rows(self, asleep: np.ndarray) -> np.ndarray:
        return np.append(asleep, False)[self.groups.of_row]

    def split(self, known: KnownForces, asleep: np.ndarray) -> tuple[KnownForces, KnownForces]:
        """Forces on groups that are awake, and on those asleep, of the known forces of all."""
        rests, rows = np.append(asleep, False)[self._groups_of(known.key)].any(axis=1), self._asleep_rows(asleep)
        return (
            KnownForces(known.key[~rests], known.force[~rests], known.others[~rows], known.share),
            KnownForces(known.key[rests], known.force[rests], known.others[rows], known.share),
        )

    def joined(self, awake: KnownForces, resting: KnownForces, asleep: np.ndarray) -> KnownForces:
        """Known forces of all groups, from those of :meth:`split`."""
        key, rows = np.concatenate([awake.key, resting.key]), self._asleep_rows(asleep)
        order, others = np.argsort(key), np.empty(rows.size)
        others[~rows], others[rows] = awake.others, resting.others
        return KnownForces(key[order], np.concatenate([awake.force, resting.force])[order], others, awake.share)

    def stepper(self, asleep: np.ndarray, state: State) -> MechanismStepper:
        """Stepper of the groups (n,) that are awake."""
        whole = self.whole
        made, table = copy(whole), copy(whole.table)
        made.asleep, made.table = np.append(asleep, False)[self.of_body], table
        table.law, still = table.law.copy(), (self.rests | made.asleep)[table.body]
        sleeps = made.asleep[table.body]
        table.law[np.outer(still, still) & (sleeps[:, None] | sleeps)] = 0
        rows = np.flatnonzero(~self._asleep_rows(asleep))
        made.rows = whole.rows.chosen(rows, table)
        assert isinstance(whole.kernels, MechanismKernels)  # opaque laws are refused
        made.kernels = whole.kernels.of_rows(rows, len(made.rows.others))
        made.compliance = whole.compliance.without(np.isin(self.groups.of_rate, np.flatnonzero(asleep)))
        made.detection = NearDetection(table, whole.n + 1, whole.system.scale.length, whole.detection.code)
        made.record = ModeRecord(len(made.rows.elements))
        made.memory = None if whole.memory is None else MechanismMemory(made)
        made.connect()
        return made

    def places(self, asleep: np.ndarray) -> np.ndarray:
        """Numbers of the elements of the stepper of those awake among the elements of the scene."""
        rows = np.flatnonzero(~self._asleep_rows(asleep))
        return np.concatenate([np.arange(self.laws), self.laws + rows])

    def pushed(self, stepper: MechanismStepper, step: MechanismStep) -> np.ndarray:
        """Groups asleep that contacts of a step push."""
        assert step.contacts is not None and step.force is not None  # a step by Python
        bodies = step.contacts.bodies[step.force[:, 0] > 0.0].ravel()
        return np.unique(self.of_body[bodies[stepper.asleep[bodies]]])

    def closed(self, known: KnownForces, asleep: np.ndarray) -> np.ndarray:
        """Whether elements of the scene bear a force on the groups asleep, or are their dry frictions."""
        found = np.zeros(len(self.rows.elements), dtype=bool)
        found[: self.laws] = self.whole.table.closed(known.key, known.force)
        rows = np.flatnonzero(self._asleep_rows(asleep))
        found[self.laws + rows] = (known.others > 0.0) | (rows >= self.gaps)
        return found

    def reached(self, before: np.ndarray, inputs: np.ndarray) -> np.ndarray:
        """Groups that changed inputs act on."""
        return np.flatnonzero(self.groups.inputs[before != inputs].any(axis=0))
