"""Moreau–Jean time stepping in machine code; Python repeats the steps whose contact problem the machine code does not solve.

These are steps without admissible forces, with undetermined forces of rigid bodies, without a contact normal, or with too
deep penetration: their treatment and messages are those of :mod:`gauss.dynamics.contact.moreau_step`.
"""

from dataclasses import replace
from functools import cached_property

import numpy as np

from gauss.codegen.kernels import Due, Fixed, Loop, LoopStatus
from gauss.dynamics.contact.moreau_step import moreau_stepper
from gauss.dynamics.contact.step_modes import UNKNOWN
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.stabilisation import Drift
from gauss.errors import GaussError, SimulationError
from gauss.integrators import Point, method_state_of
from gauss.simulation.compiled_fixed_run import CompiledFixedRun
from gauss.simulation.held_inputs import driven_as
from gauss.simulation.moreau.compiled_step import compiled_steps, method_state_size
from gauss.simulation.moreau.contact_events import ContactEvents
from gauss.simulation.moreau.contact_warnings import warn_of_laws
from gauss.simulation.moreau.moreau_jean import KnownRates, MoreauRun, accepted_overlap, time_step, with_laws
from gauss.simulation.moreau.unseen_contacts import warn_of_unseen_contacts
from gauss.simulation.problem import Problem
from gauss.simulation.trajectory import Trajectory
from gauss.system import System


class CompiledMoreauRun(CompiledFixedRun):
    """One motion by Moreau–Jean time stepping in machine code.

    Parameters
    ----------
    problem : Problem
        Initial value problem of a system with unilateral or set-valued elements, from a start without penetration.
    laws : Laws
        Loads of the system without these elements.
    dynamics : str
        From which the functions of that system come.
    removal : float
        Least time in which penetration is removed [s]; zero: within a step.
    """

    def __init__(self, problem: Problem, laws: Laws, dynamics: str = "compiled", removal: float = 0.0):
        self.whole, self.stepper = problem, moreau_stepper(problem.system, removal=removal, laws=laws)
        self.stepper.refuse_penetration(problem.start, accepted_overlap(problem, bool(removal)))
        self.contacts, self.forces = ContactEvents(self.stepper.modes), self.stepper.lossy.size
        self.codes = self.stepper.modes.codes
        super().__init__(problem._replace(system=self.stepper.smooth, laws=laws, drift=Drift()), dynamics)

    def _beside(self) -> tuple:
        return (self.whole.system,)  # with the elements that the stepper adds

    def prepared(self) -> Loop:
        """Machine code of the steps."""
        return self._loop_of((self.method_key, self.stepper.removal), lambda: self._functions().compile())

    def collect(self) -> Trajectory:
        """Trajectory to the end.

        Raises
        ------
        SimulationError
            If the motion cannot continue; its ``trajectory`` holds the motion so far.
        """
        self.run()
        fallback = lambda start, samples: self.python_steps.collect(start, samples, False)  # noqa: E731
        found = replace(self.finished(fallback), system=self.whole.system, step=self.step)
        warn_of_laws(self._law_error(), self.relaxed, found.stats.steps)
        warn_of_unseen_contacts(found)
        return found

    @property
    def relaxed(self) -> int:
        """Steps by the convex relaxation of Coulomb's law; Python makes all of them."""
        return self.python_steps.relaxed if "python_steps" in vars(self) else 0

    def _law_error(self) -> float:
        """Largest residual of the laws of contact and friction so far; a law that raises at the start leaves no point."""
        if "point" not in vars(self):
            return 0.0
        return float(method_state_of(self.layout.point(self.point))[self.forces + 1])

    @cached_property
    def python_steps(self) -> MoreauRun:
        """Steps in Python."""
        return MoreauRun(self._driven_system(), "auto", self.step, self.end, self.switching, self.stepper.removal)

    def _driven_system(self) -> System:
        """System with drives by the present inputs."""
        if self.held is None:
            return self.whole.system
        laws = {name: lambda t, k=k: self.inputs[k] for k, name in enumerate(self.held.names)}
        return driven_as(self.whole.system, laws)

    def _initial_method_state(self) -> tuple[np.ndarray, int]:
        size = method_state_size(self.stepper)
        return np.append(np.zeros(size), np.full(self.codes, float(UNKNOWN))), size + self.codes

    def _room(self) -> np.ndarray:
        """Room of samples; behind it are notes of as many steps."""
        modes, row = self.stepper.modes, self.layout.row
        samples, note = self.budget * row, 1 + self.codes + len(modes.elements)
        room, self.control.notes_at = np.empty(samples + self.budget * note), samples
        self.notes = room[samples:].reshape(self.budget, note)
        return room[:samples].reshape(self.budget, row)

    def _gather(self, out: np.ndarray):
        """Keep samples, and the events of the steps that the loop has noted."""
        super()._gather(out)
        notes, self.control.notes = self.notes[: int(self.control.notes)], 0.0
        self.events += self.contacts.of(notes[:, 0], notes[:, 1:])

    def _functions(self) -> Fixed:
        return compiled_steps(self.stepper, self.program)

    def _advance(self, pairs: np.ndarray, out: np.ndarray):
        super()._advance(pairs, out)
        while self.control.status == LoopStatus.UNSOLVED:
            t, due = pairs[int(self.control.sample)]
            self._python_step(t, due, out)

    def _python_step(self, t: float, due: float, out: np.ndarray):
        control = self.control
        try:
            reached = self.repeated(self.point, t)
        except GaussError as error:
            self._gather(out)
            raise SimulationError(str(error), self.trajectory()) from error
        if due != Due.STEP:
            out[int(control.rows)] = reached[: self.layout.row]
            control.rows += 1
        if due != Due.OFF_GRID_SAMPLE:
            self.point, control.steps = reached, control.steps + 1
            self.notes[int(control.notes)] = [t, *self.python_steps.modes]
            control.notes += 1
        control.sample, control.constraint_residual = control.sample + 1, np.inf  # unchecked
        if int(control.sample) in self.holds:
            self._hold(self.holds[int(control.sample)])
        control.status = LoopStatus.PAUSED

    def repeated(self, packed: np.ndarray, t: float) -> np.ndarray:
        """Point after a step from a point to a time [s], in Python.

        Raises
        ------
        GaussError
            If the motion cannot continue.
        """
        run, begin = self.python_steps, self.layout.point(packed)
        h, method_state, n = t - begin.state.t, method_state_of(begin), self.forces
        run.force, run.share = method_state[:n], float(method_state[n])
        rates, share = run.rates_over(begin.state, h)
        found, _ = time_step(KnownRates(run.system, rates, share), begin, h)
        state = run.project(replace(found.state, t=t))
        kept = *run.force, share, max(method_state[n + 1], run.error), *run.modes[: self.codes]
        return self._pack(Point(state, found.work, rates, np.array(kept)))

    def _is_confirmed(self) -> bool:
        point = self.layout.point(self.point)
        self.point = self._pack(replace(point, rates=self.evaluated(point.state)))
        return super()._is_confirmed()

    def trajectory(self) -> Trajectory:
        """Motion so far."""
        found = super().trajectory()
        stats = with_laws(found.stats, self.step, self._law_error(), self.relaxed)
        return replace(found, system=self.whole.system, stats=stats, step=self.step)
