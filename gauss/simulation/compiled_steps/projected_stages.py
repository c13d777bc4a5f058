"""Fixed steps where rows of the constraints fade: all stages are moved onto the constraints before they are evaluated.

Stages of a fixed step are off the constraints by h³ or so. Where rows fade, as in a parallelogram that is flat, that puts
accelerations off by it over the square of what is left of a row, and no two stages of a step by the same.
"""

from collections.abc import Callable
from functools import reduce

from gauss import math
from gauss.codegen import Scalar, write
from gauss.codegen.kernels import CheckedSwitch
from gauss.dynamics.traced_system import Program
from gauss.integrators import Rates
from gauss.system import State

WEAK = 0.003  # pivot of closing rows, 1 on free bodies, below which rows fade


def passing(program: Program, steps: Callable) -> CheckedSwitch:
    """Step of a method that is made with closed stages if a row fades at one of them.

    Parameters
    ----------
    program : Program
        The system.
    steps : callable
        What begins a step at a point → function of (x, h) for a step of these equations.
    """
    size = program.layout.size

    def open_stages(x, h):
        watching = Watching(program)
        return *steps(lambda point: watching)(x, h), [watching.weakest]

    closed = write(steps(lambda point: LoopConstraintBlock(program)), size, 1, name="closed_step")
    return CheckedSwitch(write(open_stages, size, 1, name="step"), closed, WEAK)


class Watching:
    """Equations that remember the pivots of closing rows that they met."""

    def __init__(self, program: Program):
        self.program, self.system, self.met = program, program.system, []

    @property
    def weakest(self) -> Scalar:
        """Weakest pivot but for the end of the step, which is moved onto the constraints anyway."""
        return reduce(math.minimum, self.met[:-1], 1.0)

    def evaluate(self, state: State) -> Rates:
        """Rates of a state."""
        n, found = self.system.n_v, self.program.monitored_rates([state.t], state.q, state.v)
        self.met.append(found[-2])
        return Rates(found[:n], found[n : n + 3])


class LoopConstraintBlock:
    """Equations of states that are moved onto the constraints first."""

    def __init__(self, program: Program):
        self.program, self.system = program, program.system

    def evaluate(self, state: State) -> Rates:
        """Rates of a state."""
        return self.program.on_constraints(state)[1]
