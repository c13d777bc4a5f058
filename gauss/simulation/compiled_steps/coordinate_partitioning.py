"""Coordinate partitioning: a step integrates the independent coordinates; the dependent ones follow from g(q) = 0, K v = C.

The dependent coordinates are selected anew at the start of every step, by pivoting on K, so that the partition changes
before its Jacobian becomes singular (Wehage and Haug, J. Mech. Design 104, 1982; García de Jalón and Bayo, Kinematic and
Dynamic Simulation of Multibody Systems, 1994, 3.4 and 5.2).
"""

from functools import cached_property

import numpy as np

from gauss import math
from gauss.codegen import LDLT, Function, Scalar, write
from gauss.codegen.kernels import Pivots
from gauss.dynamics.mechanism import Mechanism, dependent_coordinates, loop_residual
from gauss.dynamics.traced_system import Program
from gauss.errors import SimulationError
from gauss.integrators import Point, Rates
from gauss.system import State, retract

NEWTON_STEPS = 3  # each with the Jacobian at the last iterate
REGULARISATION = 1e-8  # relative: redundant constraints stay solvable, as in :mod:`gauss.dynamics.constrained_aba`
REFINEMENTS = 2  # remove the regularisation from the solution


class PartitionedSystem:
    """Partition of the coordinates of a system, selected at the start of every step.

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

    def begin(self, point: Point) -> "PartitionedEquations":
        """Equations of the step that begins here."""
        return PartitionedEquations(self, self._dependent([point.state.t], point.state.q))

    @cached_property
    def _dependent(self) -> Function:
        """Function (t, q) → 1 for each dependent coordinate, else 0."""

        def dependent(t, q):
            K, _ = self._constraints(t[0], q)
            return K.ravel()[0].graph.call(Pivots(*K.shape), K.T.ravel())

        return write(dependent, 1, self.system.n_q, name="dependent")

    @cached_property
    def complete(self) -> Function:
        """Function (t, q, v, dependent) → (q, v, residual): dependent coordinates and rates from the constraints."""

        def complete(t, q, v, dependent):
            for _ in range(NEWTON_STEPS):
                K, scale = self._constraints(t[0], q)
                q = retract(self.system, q, -_least(K, dependent, scale * loop_residual(self.system, q, t[0])[0]))
            q = dependent_coordinates(self.system, q, t[0])
            K, scale = self._constraints(t[0], q)
            mechanism = Mechanism(self.system, q, np.zeros(self.system.n_v), t[0])
            v = v - _least(K, dependent, K @ v - scale * mechanism.velocity_rhs)
            v = Mechanism(self.system, q, v, t[0]).dependent_rates()
            residuals = np.abs(loop_residual(self.system, q, t[0])[0] * self.program.shares)
            worst = residuals[0]
            for entry in residuals[1:]:
                worst = math.maximum(worst, entry)
            return q, v, [worst]

        n_q, n_v = self.system.n_q, self.system.n_v
        return write(complete, 1, n_q, n_v, n_v, name="complete")

    def _constraints(self, t, q):
        """Constraint Jacobian K (m, n_v) along the free coordinates, its rows scaled to 1, and the scales."""
        mechanism = Mechanism(self.system, q, np.zeros(self.system.n_v), t)
        scale = mechanism.scale
        return np.array([-mechanism.reaction(row) for row in np.diag(scale)]), scale


class PartitionedEquations:
    """Equations of motion within one step, in its independent coordinates.

    Parameters
    ----------
    partition : PartitionedSystem
        The system.
    dependent : ndarray, shape (n_v,)
        1 for dependent coordinates, else 0.
    """

    def __init__(self, partition: PartitionedSystem, dependent: np.ndarray):
        self.partition, self.dependent = partition, dependent
        self.system, self.program = partition.system, partition.program

    def completed(self, state: State) -> tuple[State, Scalar]:
        """State with dependent coordinates and rates from the independent ones, and the remaining constraint residual."""
        found = self.partition.complete([state.t], state.q, state.v, self.dependent)
        q, v, residual = np.split(found, [self.system.n_q, self.system.n_q + self.system.n_v])
        return State(state.t, q, v), residual[0]

    def evaluate(self, state: State) -> Rates:
        """Rates of a state, from its independent coordinates."""
        return self.program.evaluate(self.completed(state)[0])


def _least(K: np.ndarray, dependent: np.ndarray, residual: np.ndarray) -> np.ndarray:
    """Least displacement of the dependent coordinates that removes a residual to first order."""
    weighted = K * dependent
    S = weighted @ K.T
    factor = LDLT(S + REGULARISATION * np.eye(len(S)))
    y = factor.solve(residual)
    for _ in range(REFINEMENTS):
        y = y + factor.solve(residual - S @ y)
    return weighted.T @ y
