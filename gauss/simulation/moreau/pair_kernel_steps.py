"""Steps of a simulator by kernels of pairs of shapes: its point holds the mean accelerations of the last step."""

from math import inf, isfinite

import numpy as np

from gauss.codegen.kernels import Control, LoopStatus
from gauss.dynamics.conditions import smooth_question
from gauss.dynamics.contact.compiled_step_memory import KEPT_STEPS
from gauss.dynamics.contact.contact_stepper import lent_stepper
from gauss.dynamics.contact.mechanism_step import MechanismStepper
from gauss.dynamics.contact.overlap_resolution import resolved
from gauss.dynamics.programs import CalledProgram
from gauss.dynamics.traced_system import Program
from gauss.errors import GaussError, SimulationError
from gauss.integrators import FixedStep, Point, Rates
from gauss.simulation.moreau.contact_motion import ContactMotion
from gauss.simulation.moreau.moreau_jean import accepted_overlap
from gauss.simulation.problem import Problem
from gauss.system import State


class PairKernelSteps:
    """Steps of one motion, called as the machine code of a loop of fixed steps.

    Parameters
    ----------
    problem : Problem
        Initial value problem, from a start without penetration.

    Attributes
    ----------
    control : Control
        Record of the calls.
    program : Program
        Functions of the system without unilateral and set-valued elements; the method state are the normal forces of all
        gaps, if an output of the scene depends on them.
    """

    kind = "pair kernels"

    def __init__(self, problem: Problem):
        assert isinstance(problem.method, FixedStep)
        held = problem.held is not None
        self.method, self.control = problem.method, Control()
        self.motion, ask = ContactMotion(problem.system, held), smooth_question(problem.question)
        self.motion.stepper.refuse_penetration(problem.start, accepted_overlap(problem))
        self.motion.stepper.check(problem.start)
        measured = any(output.kind == "contact_force" for output in problem.system.scene.outputs.values())
        self.gaps = self.motion.stepper.gap_count if measured else 0
        program = CalledProgram if ask.laws.called else Program
        self.program = program(ask.system, ask.laws, memory=self.gaps, inputs=held)
        self.layout, self.key = self.program.layout, (ask.laws.key, held, self.gaps)
        self.ends, self.rows = np.empty(0), np.empty((0, 0))  # of a call
        self.inputs = np.zeros(len(self.layout.parameters))
        row, end, n_v = self.layout.row, 1 + self.layout.n_q, self.layout.n_v
        self.rates = slice(end, row)  # and work
        mean = row + n_v + 3  # end of the mean accelerations and powers of a point; behind them gap forces, inputs last
        inputs = slice(self.layout.size - self.inputs.size, None)
        self.point_parts = slice(row), slice(row, mean), slice(mean, mean + self.gaps), inputs

    def prepared_steps(self) -> "PairKernelSteps":
        """The steps themselves: they are called as machine code is."""
        return self

    @property
    def fastest(self) -> float:
        """Largest speed of a point of a shape at the end of the last step [m/s], infinite where it is not known."""
        stepper = self.motion.stepper
        memory = stepper.memory if isinstance(stepper, MechanismStepper) else None
        return inf if memory is None else memory.fastest

    def arrays(self, point: np.ndarray, confirmed: np.ndarray, grid: np.ndarray, out: np.ndarray) -> tuple:
        """Arguments of :meth:`call`: views, which take a call less time than to make them."""
        return *(point[part] for part in self.point_parts), grid[:, 0]

    def separated(self, state: State) -> State:
        """State whose shapes do not overlap."""
        stepper = self.motion.stepper
        if isinstance(stepper, MechanismStepper):
            return resolved(stepper, state)
        with lent_stepper(self.motion.system, True) as other:
            return resolved(other, state)

    def begun(self, start: State) -> np.ndarray:
        """Point (layout.size,) of a new motion."""
        self.motion.begin(start)
        rates = Rates(np.zeros(start.v.size), np.zeros(3))
        return self.layout.pack(Point(start, np.zeros(3), rates, np.zeros(self.gaps)), self.inputs)

    def call(self, reached: np.ndarray, mean: np.ndarray, forces: np.ndarray, inputs: np.ndarray, times: np.ndarray, n: int):
        """Make n steps from a point, of which the first arguments are parts, to some times [s]."""
        motion, rates = self.motion, self.rates
        motion.reached = row = reached.copy()
        motion.events = []  # of the steps of this call alone: a motion from Python may have no end
        motion.hold(inputs)
        try:
            rows = motion.filled(*self._arrays_of(times[:n]))
        except GaussError:
            self.control.status = float(LoopStatus.UNSOLVED)
            return
        self.control.status = float(LoopStatus.DONE if len(rows) == n else LoopStatus.UNSOLVED)
        row = rows[-2] if len(rows) > 1 else row
        last = rows[-1]
        if not isfinite(last.dot(last)) and not np.isfinite(last).all():
            self.control.status = float(LoopStatus.NOT_FINITE)
            return
        reached[:] = last
        np.subtract(last[rates], row[rates], out=mean)  # of rates and work
        mean /= last[0] - row[0]
        if self.gaps:
            forces[:] = motion.stepper.gap_forces()

    def _arrays_of(self, ends: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Ends of steps (n,), and rows for what is reached: those of the call before, where few steps are as many."""
        if ends.size != self.ends.size:
            found = np.array(ends), np.empty((ends.size, self.layout.row))
            if ends.size <= KEPT_STEPS:
                self.ends, self.rows = found
            return found
        self.ends[:] = ends
        return self.ends, self.rows

    def repeated(self, point: np.ndarray, t: float) -> np.ndarray:
        """Point after a step to a time [s].

        Raises
        ------
        SimulationError
            If the motion cannot continue.
        """
        try:
            self.motion.advance(np.array([t]))
        except GaussError as error:
            raise SimulationError(str(error)) from error
        reached = point.copy()
        reached[: self.layout.row] = self.motion.reached
        return reached

    def kept(self):
        """What the motion continues from, beside its point."""
        return self.motion.kept()

    def take(self, kept):
        """Continue from what was kept."""
        self.motion.take(kept)
