"""Constrained forward dynamics of a subsystem whose loops are eliminated where they close."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from gauss import math
from gauss.codegen import Scalar
from gauss.dynamics.constrained_aba import BaumgarteFeedback, ConstrainedArticulatedBody
from gauss.dynamics.embedded_loops import EmbeddedLoops
from gauss.dynamics.loop_roots import hubs, loop_rows
from gauss.dynamics.mechanism import Mechanism
from gauss.dynamics.rnea import gyroscopic
from gauss.system import Subsystem, System


class EmbeddedArticulatedBody(ConstrainedArticulatedBody):
    """A subsystem in one state with loops of full rank, eliminated once by :class:`EmbeddedLoops`.

    ``subsystem``, ``q``, ``v``, ``relations``: as of :class:`gauss.dynamics.constrained_aba.ConstrainedArticulatedBody`.
    ``dependent``: redundant rows, which follow from the others: their multipliers are zero.
    """

    def __init__(self, subsystem: Subsystem, q, v, relations, dependent: Collection[int] = ()):
        super().__init__(subsystem, q, v, relations)
        rows = loop_rows(self.tree, self.constraints, self._with_loop_forces)
        self.kept = [row for row in range(len(rows)) if row not in dependent]
        rows = [rows[row] for row in self.kept]
        self.embedded = EmbeddedLoops(self.tree, rows, self.hubs(rows))

    def hubs(self, rows) -> dict[int, int]:
        """Links that are eliminated as free bodies, with the roots of their fronts."""
        return hubs(self.tree, rows)

    @property
    def pivots(self) -> list:
        """Pivots of the scaled S in fronts without hubs, 1 for a row as on free bodies; small where K loses rank.

        Fronts with hubs may be singular where K is not: there, :meth:`motion` is not finite.
        """
        return [self.scale[self.kept[row]] ** 2 * pivot for row, pivot in self.embedded.row_pivots.items()]

    def motion(self, tau, forces=None, feedback: BaumgarteFeedback | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Joint accelerations (n_v,), infinite where a front is near singular, and multipliers.

        See :meth:`ConstrainedArticulatedBody.motion`.
        """
        tree, wrenches = self.tree, self._external_wrenches(tau, forces)
        given = {body: gyroscopic(tree.links[body], tree.omegas[body]) for body in tree.joint_kinematics}
        biases = {body: kin.bias for body, kin in tree.joint_kinematics.items()}
        target = 0.0 if feedback is None else feedback.rows
        still = dict.fromkeys(tree.joint_kinematics, np.zeros(6)) | {-1: tree.ground}
        rhs = target - self._rows({}, still, still=False)
        pulled = {body: own - wrenches.get(body, 0.0) for body, own in given.items()}
        rates, accelerations, multipliers = self._solved(pulled, biases, tree.ground, tau, rhs)
        found = self._all_rates(rates, accelerations, still=False) + math.where(self.embedded.is_regular, 0.0, np.inf)
        return found if feedback is None else found + feedback.rates, multipliers

    def response(self, tau, target) -> tuple[np.ndarray, np.ndarray]:
        """Rates (n_v,) x and multipliers y with M x + Kᵀ y = tau and K x = target."""
        wrenches = self._with_loop_forces({}, tau)
        forces = {body: -wrench for body, wrench in wrenches.items()}
        rates, accelerations, multipliers = self._solved(forces, {}, np.zeros(6), tau, target)
        return self._all_rates(rates, accelerations, still=True), multipliers

    def _solved(self, forces, biases, base, tau, rhs):
        """As of :meth:`EmbeddedLoops.solve`, for the right sides and multipliers of all rows."""
        rates, accelerations, found = self.embedded.solve(forces, biases, base, tau, rhs[self.kept])
        multipliers = np.zeros(self.scale.size, dtype=object)
        multipliers[self.kept] = found
        return rates, accelerations, multipliers

    def moving(self, v, relations) -> "EmbeddedArticulatedBody":
        """The same subsystem in the same position at other rates."""
        found = super().moving(v, relations)
        moved = self.embedded.moving(found.tree)
        assert isinstance(found, EmbeddedArticulatedBody) and isinstance(moved, EmbeddedLoops)
        found.embedded = moved
        return found

    def eliminated(self) -> "EmbeddedArticulatedBody":
        """The same: the fronts are factored already."""
        return self

    def nearest(self, v, target) -> np.ndarray:
        """Rates x (n_v,) nearest to v in the mass metric with K x = target: the change is the response to what is left."""
        carried, own = self.tree.carried(v), self._by_joint(v)
        left = target - self._rows(own, carried, still=True)
        change, moved, _ = self._solved({}, {}, np.zeros(6), np.zeros(self.subsystem.n_v), left)
        rates = {joint: own[joint] + more for joint, more in change.items()}
        links = {body: rate + moved.get(body, 0.0) for body, rate in carried.items()}
        return self._all_rates(rates, links, still=True)

    def damped(self, rows) -> np.ndarray:
        """The same rows: those kept are independent where fronts are regular."""
        return rows

    def unprojected(self, residual, rows) -> np.ndarray:
        """Their correction itself; see :meth:`ConstrainedArticulatedBody.unprojected`."""
        return self.response(residual, rows)[0]

    def position_correction(self, phi, slack) -> np.ndarray:
        """Newton step (n_v,); see :meth:`ConstrainedArticulatedBody.position_correction`."""
        return self._with_slack(self.response(np.zeros(self.subsystem.n_v), -phi)[0], slack)


class EmbeddedMechanism(Mechanism):
    """A system in one state whose loops are eliminated where they close.

    ``system``, ``q``, ``v``, ``t``: as of :class:`gauss.dynamics.mechanism.Mechanism`. ``dependent``: redundant rows of each
    subsystem, see :class:`EmbeddedArticulatedBody`; none if empty.
    """

    of_subsystem: type[EmbeddedArticulatedBody] = EmbeddedArticulatedBody

    def __init__(self, system: System, q, v, t: Scalar = 0.0, dependent: Sequence[Collection[int]] = ()):
        self.dependent = dependent
        super().__init__(system, q, v, t)

    def _body(self, index: int, one: Subsystem, q, v, relations) -> EmbeddedArticulatedBody:
        return self.of_subsystem(one, q, v, relations, self.dependent[index] if self.dependent else ())

    @property
    def is_regular(self) -> bool:
        """Whether all fronts are regular, in a state of numbers."""
        return all(bool(body.embedded.is_regular) for body in self.bodies if isinstance(body, EmbeddedArticulatedBody))


class _ByChains(EmbeddedArticulatedBody):
    """The same without hubs."""

    def hubs(self, rows) -> dict[int, int]:
        """None."""
        return {}


class EmbeddedChains(EmbeddedMechanism):
    """The same without hubs: more operations, but no chain needs to meet its own rows."""

    of_subsystem = _ByChains


@dataclass(frozen=True)
class Embedding:
    """Elimination of loops where they close: with or without hubs, and the redundant rows that are left out."""

    mechanism: type[EmbeddedMechanism] = EmbeddedMechanism
    dependent: Sequence[Collection[int]] = ()  # of each subsystem; none if empty

    def __call__(self, system: System, q, v, t: Scalar = 0.0) -> EmbeddedMechanism:
        """The system in one state."""
        return self.mechanism(system, q, v, t, self.dependent)
