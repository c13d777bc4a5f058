"""Fixed steps near singular configurations: all stages are projected onto the constraints before they are evaluated.

Stages of a fixed step have a constraint residual of the order h³. Near a configuration with rank-deficient constraint
Jacobian, as a flat parallelogram, accelerations are off by this residual over the square of the smallest pivot, in each
stage by another amount.
"""

from collections.abc import Callable
from functools import reduce

from gauss import math
from gauss.codegen import Scalar, write
from gauss.codegen.kernels import CheckedSwitch
from gauss.dynamics.traced_system import Program
from gauss.integrators import Rates
from gauss.system import State

SMALL_PIVOT = 0.003  # pivot of the constraints over that on free bodies, below which stages are projected


def with_projected_stages(program: Program, steps: Callable) -> CheckedSwitch:
    """Step of a method, repeated with projected stages where a pivot of the constraints is small at one of them.

    Parameters
    ----------
    program : Program
        The system.
    steps : callable
        (point → equations of the step that begins there) → step, a function of (x, h).
    """
    size = program.layout.size

    def unprojected(x, h):
        monitor = PivotMonitor(program)
        return *steps(lambda point: monitor)(x, h), [monitor.smallest]

    projected = write(steps(lambda point: ProjectedEquations(program)), size, 1, name="projected_step")
    return CheckedSwitch(write(unprojected, size, 1, name="step"), projected, SMALL_PIVOT)


class PivotMonitor:
    """Equations of motion that record the smallest pivots of the constraints of the evaluated states."""

    def __init__(self, program: Program):
        self.program, self.system = program, program.system
        self.pivots: list[Scalar] = []

    @property
    def smallest(self) -> Scalar:
        """Smallest pivot of all stages but the end of the step, which is projected anyway."""
        return reduce(math.minimum, self.pivots[:-1], 1.0)

    def evaluate(self, state: State) -> Rates:
        """Rates of a state."""
        rates, (smallest, _) = self.program.split_rates(self.program.monitored_rates([state.t], state.q, state.v))
        self.pivots.append(smallest)
        return rates


class ProjectedEquations:
    """Equations of motion of states that are projected onto the constraints first."""

    def __init__(self, program: Program):
        self.program, self.system = program, program.system

    def evaluate(self, state: State) -> Rates:
        """Rates of a state."""
        return self.program.on_constraints(state)[1]
