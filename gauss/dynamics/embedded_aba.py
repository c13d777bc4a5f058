"""Constrained forward dynamics of a subsystem whose loops are eliminated where they close."""

import numpy as np

from gauss.dynamics.constrained_aba import BaumgarteFeedback, ConstrainedArticulatedBody
from gauss.dynamics.embedded_loops import EmbeddedLoops
from gauss.dynamics.loop_roots import hubs, loop_rows
from gauss.dynamics.mechanism import Mechanism
from gauss.dynamics.rnea import gyroscopic
from gauss.system import Subsystem


class EmbeddedArticulatedBody(ConstrainedArticulatedBody):
    """A subsystem in one state with loops of full rank, eliminated once by :class:`EmbeddedLoops`.

    Parameters
    ----------
    subsystem, q, v, relations
        As of :class:`gauss.dynamics.constrained_aba.ConstrainedArticulatedBody`.
    """

    def __init__(self, subsystem: Subsystem, q, v, relations):
        super().__init__(subsystem, q, v, relations)
        rows = loop_rows(self.tree, self.constraints, self._with_loop_forces)
        self.embedded = EmbeddedLoops(self.tree, rows, hubs(self.tree, rows))

    @property
    def pivots(self) -> list:
        """Pivots of the fronts over the diagonal entries that they come from; small where a front is near singular."""
        return self.embedded.relative_pivots

    def motion(self, tau, forces=None, feedback: BaumgarteFeedback | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Joint accelerations (n_v,) and multipliers; see :meth:`ConstrainedArticulatedBody.motion`."""
        tree, wrenches = self.tree, self._external_wrenches(tau, forces)
        given = {body: gyroscopic(tree.links[body], tree.omegas[body]) for body in tree.joint_kinematics}
        biases = {body: kin.bias for body, kin in tree.joint_kinematics.items()}
        target = 0.0 if feedback is None else feedback.rows
        still = dict.fromkeys(tree.joint_kinematics, np.zeros(6)) | {-1: tree.ground}
        rhs = target - self._rows({}, still, still=False)
        pulled = {body: own - wrenches.get(body, 0.0) for body, own in given.items()}
        rates, accelerations, multipliers = self.embedded.solve(pulled, biases, tree.ground, tau, rhs)
        found = self._all_rates(rates, accelerations, still=False)
        return found if feedback is None else found + feedback.rates, multipliers

    def response(self, tau, target) -> tuple[np.ndarray, np.ndarray]:
        """Rates (n_v,) x and multipliers y with M x + Kᵀ y = tau and K x = target."""
        wrenches = self._with_loop_forces({}, tau)
        forces = {body: -wrench for body, wrench in wrenches.items()}
        rates, accelerations, multipliers = self.embedded.solve(forces, {}, np.zeros(6), tau, target)
        return self._all_rates(rates, accelerations, still=True), multipliers


class EmbeddedMechanism(Mechanism):
    """A system in one state whose loops are eliminated where they close; its loop constraints must be independent."""

    of_subsystem = EmbeddedArticulatedBody
