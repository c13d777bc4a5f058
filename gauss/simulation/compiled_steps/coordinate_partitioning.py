"""Coordinate partitioning: a step integrates independent coordinates only; the others follow from the constraints.

At the begin of every step the dependent ones are chosen anew, by pivoting on the constraints: near a singularity the choice
changes before it becomes useless (Wehage and Haug, J. Mech. Design 104, 1982; García de Jalón and Bayo, Kinematic and
Dynamic Simulation of Multibody Systems, 1994, 3.4 and 5.2).
"""

from functools import cached_property

import numpy as np

from gauss import math
from gauss.codegen import LDLT, Function, write
from gauss.codegen.kernels import Pivots
from gauss.dynamics.mechanism import Mechanism, dependent_coordinates, loop_residual
from gauss.dynamics.traced_system import Program
from gauss.errors import SimulationError
from gauss.integrators import Point, Rates
from gauss.system import State, retract

NEWTON_STEPS = 3  # each with the constraints of the place that the last one reached
SOFT, ITERATIONS = 1e-8, 3  # redundant rows do no harm, as in :mod:`gauss.dynamics.constrained_aba`


class Partition:
    """Equations of a step whose dependent coordinates follow from the others.

    Parameters
    ----------
    program : Program
        Functions of the system.

    Raises
    ------
    SimulationError
        If a constraint binds velocities only.
    """

    def __init__(self, program: Program):
        self.program, self.system = program, program.system
        rolling = [placed.name for placed in self.system.relations.placed if placed.velocities]
        if rolling:
            raise SimulationError(
                f"constraint {rolling[0]!r} binds velocities, so no coordinate follows from it as stabilisation "
                "'partitioning' needs; use 'projection'."
            )

    def begin(self, point: Point) -> "Step":
        """Equations of the step that begins here."""
        return Step(self, self._dependent([point.state.t], point.state.q))

    @cached_property
    def _dependent(self) -> Function:
        """Function (t, q) → 1 for each coordinate that follows from the others, else 0."""

        def dependent(t, q):
            K, _ = self._constraints(t[0], q)
            return K.ravel()[0].graph.call(Pivots(*K.shape), K.T.ravel())

        return write(dependent, 1, self.system.n_q, name="dependent")

    @cached_property
    def settle(self) -> Function:
        """Function (t, q, v, dependent) → (q, v, gap): dependent coordinates and rates from the constraints."""

        def settle(t, q, v, dependent):
            for _ in range(NEWTON_STEPS):
                K, scale = self._constraints(t[0], q)
                q = retract(self.system, q, -_least(K, dependent, scale * loop_residual(self.system, q, t[0])[0]))
            q = dependent_coordinates(self.system, q, t[0])
            K, scale = self._constraints(t[0], q)
            mechanism = Mechanism(self.system, q, np.zeros(self.system.n_v), t[0])
            v = v - _least(K, dependent, K @ v - scale * mechanism.velocity_rhs)
            v = Mechanism(self.system, q, v, t[0]).dependent_rates()
            gap = np.abs(loop_residual(self.system, q, t[0])[0] * self.program.shares)
            worst = gap[0]
            for entry in gap[1:]:
                worst = math.maximum(worst, entry)
            return q, v, [worst]

        n_q, n_v = self.system.n_q, self.system.n_v
        return write(settle, 1, n_q, n_v, n_v, name="settle_dependent")

    def _constraints(self, t, q):
        """Closing rows K (m, n_v) along the free coordinates, scaled to the size of one, and the scales."""
        mechanism = Mechanism(self.system, q, np.zeros(self.system.n_v), t)
        scale = mechanism.scale
        return np.array([-mechanism.reaction(row) for row in np.diag(scale)]), scale


class Step:
    """Equations during one step.

    Parameters
    ----------
    partition : Partition
        Of which system.
    dependent : ndarray, shape (n_v,)
        1 for coordinates that follow from the others.
    """

    def __init__(self, partition: Partition, dependent: np.ndarray):
        self.partition, self.dependent = partition, dependent
        self.system, self.program = partition.system, partition.program

    def settled(self, state: State) -> tuple[State, object]:
        """State whose dependent coordinates and rates follow, and the gap that is left."""
        found = self.partition.settle([state.t], state.q, state.v, self.dependent)
        q, v, gap = np.split(found, [self.system.n_q, self.system.n_q + self.system.n_v])
        return State(state.t, q, v), gap[0]

    def evaluate(self, state: State) -> Rates:
        """Rates of a state whose dependent coordinates are not looked at."""
        return self.program.evaluate(self.settled(state)[0])


def _least(K: np.ndarray, dependent: np.ndarray, gap: np.ndarray) -> np.ndarray:
    """Displacement of the dependent coordinates, the least, that closes a gap to first order."""
    weighted = K * dependent
    S = weighted @ K.T
    factor = LDLT(S + SOFT * np.eye(len(S)))
    y = factor.solve(gap)
    for _ in range(ITERATIONS - 1):
        y = y + factor.solve(gap - S @ y)
    return weighted.T @ y
