"""Recorded rows of couplings, (q̇_driven − r q̇_driver) / √(1 + r²) = 0, a block of rows at a time.

The force of a unit multiplier is Kᵀ: one along the driven joint, −r along the driver, both scaled.
"""

import numpy as np

from gauss.codegen.kernels import CallRecorder, Operand
from gauss.system import Subsystem
from gauss.system.elimination_cost import coupling_blocks


class CouplingCalls:
    """Couplings of a subsystem in a call graph.

    Attributes: ``members``: indices of the couplings of each block, {block: array}; blocks are numbered after the joints.
    ``scale``: factors of the rows, {block: (m,)}. ``unit_forces``: forces of unit multipliers along joints, {block: {joint:
    (1, m)}}. ``no_wrenches``: zero wrenches (6, m), {m: wrenches}, as slots: the kernels of all links take them as they take
    others.
    """

    def __init__(self, subsystem: Subsystem, recorder: CallRecorder):
        self.subsystem, self.recorder = subsystem, recorder
        self.members = dict(enumerate(coupling_blocks(subsystem), start=len(subsystem.joints)))
        ratios = np.array([coupling.ratio for coupling in subsystem.couplings])
        factors = 1.0 / np.sqrt(1.0 + ratios * ratios)
        self.scale = {block: recorder.operand(recorder.keep(factors[some])) for block, some in self.members.items()}
        self.unit_forces = {block: self._forces(some, ratios, factors) for block, some in self.members.items()}
        sizes = {len(some) for some in self.members.values()}
        self.no_wrenches = {m: recorder.operand(recorder.keep(np.zeros(6 * m)).reshape(6, m)) for m in sizes}

    def _forces(self, members, ratios, factors) -> dict[int, Operand]:
        """Forces (1, m) along each joint of a block, as parameters: one function serves all of a shape."""
        forces: dict[int, np.ndarray] = {}
        for column, index in enumerate(members):
            coupling = self.subsystem.couplings[index]
            for joint, factor in ((coupling.driven, 1.0), (coupling.driver, -ratios[index])):
                own = forces.setdefault(self.subsystem.index(joint), np.zeros(len(members)))
                own[column] = factor * factors[index]
        return {joint: self.recorder.operand(self.recorder.keep(own)[None, :]) for joint, own in forces.items()}

    def less_forces(self, tau, multipliers: dict) -> np.ndarray:
        """Record generalised forces (n_v,) less those of the multipliers, {block: (m,)}."""
        tau = tau.copy()
        for block, along in self.unit_forces.items():
            for joint, forces in along.items():
                place = self.subsystem.joints[joint].v
                (own,) = self.recorder.call(
                    "less coupling", lambda tau, forces, y: (tau - forces @ y,), tau[place], forces, multipliers[block]
                )
                tau[place] = self.recorder.array(own)
        return tau

    def values(self, rates) -> dict[int, Operand]:
        """Record the left sides (m,) of the rows of each block, given joint rates or accelerations (n_v,)."""
        found = {}
        for block, along in self.unit_forces.items():
            value = self.recorder.operand(np.zeros(len(self.members[block])).astype(object))
            for joint, forces in along.items():
                own = rates[self.subsystem.joints[joint].v]
                (value,) = self.recorder.call("coupled", lambda x, forces, own: (x + own @ forces,), value, forces, own)
            found[block] = value
        return found

    def position_residuals(self, q) -> dict[int, np.ndarray]:
        """Record q_driven − r q_driver − offset (m,) [rad, m] of each block, given coordinates (n_q,)."""
        found = {}
        for block, members in self.members.items():
            rows = [self._position_residual(self.subsystem.couplings[index], q) for index in members]
            found[block] = np.concatenate(rows)
        return found

    def _position_residual(self, coupling, q) -> np.ndarray:
        own, other = (q[self.subsystem.joint(name).q] for name in (coupling.driven, coupling.driver))
        numbers = self.recorder.keep([coupling.ratio, coupling.offset])
        (residual,) = self.recorder.call("coupled coordinates", lambda x, y, n: (x - n[0] * y - n[1],), own, other, numbers)
        return self.recorder.array(residual)
