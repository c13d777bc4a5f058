"""Time stepping in machine code while it runs; Python takes the steps that have to be looked at.

That is where no forces were found that obey the laws, where those of rigid bodies are not determined, where shapes have no
normal or are lost in each other: what follows from it is said once, in :mod:`gauss.dynamics.contact.moreau_step`.
"""

from dataclasses import replace
from functools import cached_property
from types import SimpleNamespace

import numpy as np

from gauss.codegen.kernels import Due, Fixed, LoopStatus
from gauss.dynamics.contact.moreau_step import moreau_stepper
from gauss.dynamics.laws.switching_functions import Switching
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.stabilisation import Drift
from gauss.errors import GaussError, SimulationError
from gauss.integrators import FixedStep, Point
from gauss.simulation.compiled_run import CompiledRun, finished
from gauss.simulation.moreau.compiled_step import strides
from gauss.simulation.moreau.moreau_jean import TIME_STEPPING, SteppedRun, in_words, time_step
from gauss.simulation.trajectory import Trajectory
from gauss.system import State, System


class CompiledSteps(CompiledRun):
    """One simulation by time stepping in machine code.

    Parameters
    ----------
    system : System
        With one-sided constraints, friction or grips.
    laws : Laws
        Its loads, all of which are traced.
    start : State
        Consistent start, outside of everything it may touch.
    end, step : float
        When to stop, and the length of a step [s].
    samples : ndarray or None
        Times to return; every step when None.
    """

    def __init__(self, system: System, laws: Laws, start: State, end: float, step: float, samples, switching: Switching):
        self.whole, self.stepper, self.step = system, moreau_stepper(system), step
        self.stepper.refuse_penetration(start)
        super().__init__(self.stepper.smooth, laws, start, end, samples, Drift(), TIME_STEPPING, switching)

    def run(self, progress: bool) -> Trajectory:
        """Trajectory of all steps.

        Raises
        ------
        SimulationError
            If the motion cannot go on; its ``trajectory`` holds what there is.
        """
        self.fixed(TIME_STEPPING, self.step, progress)
        certified = lambda start, samples: self.by_hand.collect(start, samples, False)  # noqa: E731
        return replace(finished(self, certified), system=self.whole, step=self.step)

    @cached_property
    def by_hand(self) -> SteppedRun:
        """The same in Python."""
        return SteppedRun(self.whole, "auto", self.step, self.end, self.switching)

    def _remembered(self, method) -> tuple[np.ndarray, int]:
        size = self.stepper.lossy.size + 1
        return np.zeros(size), size

    def _fixed(self, method: FixedStep) -> Fixed:
        return strides(self.stepper, self.program)

    def _advance(self, pairs: np.ndarray, out: np.ndarray):
        super()._advance(pairs, out)
        while self.control.status == LoopStatus.UNSOLVED:
            self._step_by_hand(*pairs[int(self.control.sample)], out)

    def _step_by_hand(self, t: float, due: float, out: np.ndarray):
        control, run, begin = self.control, self.by_hand, self.layout.point(self.point)
        run.force, h = begin.memory[:-1], t - begin.state.t
        try:
            rates, share = run.rates_over(begin.state, h)
            found, _ = time_step(SimpleNamespace(system=run.system, over=lambda point, h: (rates, share)), begin, h)
            state = run.settle(replace(found.state, t=t))
        except GaussError as error:
            self._gather(out)
            raise SimulationError(str(error), self.trajectory()) from error
        memory = np.append(run.force, max(begin.memory[-1], run.error))
        reached = self.layout.pack(Point(state, found.work, rates, memory))
        if due != Due.STEP:
            out[int(control.rows)] = reached[: self.layout.row]
            control.rows += 1
        if due != Due.OFF_GRID_SAMPLE:
            self.point, control.steps = reached, control.steps + 1
        control.sample, control.constraint_residual = control.sample + 1, np.inf  # nothing has been checked here
        control.status = LoopStatus.PAUSED

    def _is_confirmed(self) -> bool:
        point = self.layout.point(self.point)
        self.point = self.layout.pack(replace(point, rates=self._evaluate(point.state)))
        return super()._is_confirmed()

    def trajectory(self) -> Trajectory:
        """Return the rows gathered so far."""
        found = super().trajectory()
        relaxed = self.by_hand.relaxed if "by_hand" in vars(self) else 0
        method = in_words(self.step, float(self.point[-1]), relaxed, found.stats.method)
        return replace(found, system=self.whole, stats=found.stats._replace(method=method), step=self.step)
