"""Moreau–Jean time stepping: impacts, friction, and drives of limited force within steps of one length.

A step takes the mean accelerations for which every contact and friction law holds at its end: v₁ = v₀ + h a,  q₁ = q₀ ⊕ h (s
v₀ + (1 − s) v₁), with the share s of the old rates; the rates are those of :mod:`gauss.dynamics.contact.moreau_step`, the
laws those of :mod:`gauss.dynamics.contact.contact_step` (Moreau 1988; Jean 1999; Anitescu 2006). The order is 2 while the
active contacts and the sticking ones do not change, for systems without loops and restitution; impacts and stick–slip
transitions leave errors proportional to the step. Where no solution of Coulomb's law is found, the step of the convex
relaxation is taken, and counted.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple, cast

import numpy as np

from gauss.backends import Backend, solve
from gauss.backends.solution import Solution
from gauss.codegen import Entry, Scalar
from gauss.dynamics.assemble import assemble_motion
from gauss.dynamics.contact.moreau_step import MoreauStep, advance_positions, moreau_stepper
from gauss.dynamics.contact.overlaps import START_OVERLAP, left_by_steps
from gauss.dynamics.gap_functions import gaps, set_valued_rows, slips
from gauss.dynamics.kinematics import Kinematics
from gauss.dynamics.laws.switching import Switching
from gauss.dynamics.loads import Applied
from gauss.errors import SimulationError
from gauss.integrators import Cost, FixedStep, Point, Rates
from gauss.simulation.moreau.contact_events import ContactEvents
from gauss.simulation.moreau.contact_warnings import ParadoxWarnings, warn_of_laws
from gauss.simulation.moreau.unseen_contacts import warn_of_unseen_contacts
from gauss.simulation.motion_records import Stats
from gauss.simulation.problem import Problem
from gauss.simulation.python_run import PythonRun
from gauss.simulation.trajectory import Trajectory
from gauss.system import State, System, retract

EQUAL_STEPS = 1e-9  # relative: steps of such lengths are equal


class MoreauRun(PythonRun):
    """Simulation by time stepping while it runs; a Run of which each evaluation is a whole step.

    Parameters
    ----------
    system : System
        What moves.
    backend : str, Backend or class
        How free accelerations are solved.
    step, end : float
        Length of a step, and when to stop [s].
    switching : Switching
        Where laws of the state switch.
    removal : float
        Least time in which penetration is removed [s]; zero: within a step.
    """

    def __init__(
        self,
        system: System,
        backend: str | Backend | type,
        step: float,
        end: float,
        switching=Switching(),  # noqa: B008
        removal: float = 0.0,
    ):
        self.stepper = moreau_stepper(system, backend, removal)
        super().__init__(system, TIME_STEPPING, self.stepper.responses.solver, None, step, end, switching=switching)
        self.h, self.relaxed, self.error = step, 0, 0.0
        self.paradoxes, self.contacts = ParadoxWarnings(), ContactEvents(self.stepper.modes)
        self.modes = self.taken = np.zeros(0)  # of the last step that was computed, and of the last one that was taken
        self.force = np.zeros(self.stepper.unit.size)
        self.share = 0.0  # of the last step

    def collect(self, start: State, samples, progress: bool) -> Trajectory:
        """Trajectory to the end, from a start without penetration."""
        self.stepper.refuse_penetration(start, left_by_steps(self.system, start.v, self.h))
        found = super().collect(start, samples, progress)
        warn_of_laws(self.error, self.relaxed, self.steps)
        warn_of_unseen_contacts(found)
        return found

    def _first(self, start: State) -> Point:
        """Initial point; accelerations without contact forces are checked in every step."""
        rates, share = self.rates_over(start, self.h)
        return Point(start, np.zeros(self.powers), rates, np.array([share, *self.modes]))

    def evaluate(self, state: State) -> Rates:
        """Mean accelerations and powers over a step from a state."""
        return self.rates_over(state, self.h)[0]

    def rates_over(self, state: State, h: float) -> tuple[Rates, float]:
        """Mean accelerations and powers over a step of length h from a state, and the share s of the old rates."""
        step = self.stepper.step(state, h, self.force, last=state.t + h >= self.end, before=self.share)
        self.force, self.share, self.modes = step.force, step.share, step.modes
        self.relaxed += step.error is None
        self.error = max(self.error, step.error or 0.0)
        self.paradoxes.warn(step.paradoxes, state.t, self.stepper.owner)
        return Rates(step.acceleration, step.power), step.share

    def over(self, point: Point, h: float) -> tuple[Rates, float]:
        """Rates of a point over a step of length h, and the share s of the old rates."""
        if point.method_state is None or not np.isclose(h, self.h, rtol=EQUAL_STEPS, atol=0.0):
            found = self.rates_over(point.state, h)
            self.taken = self.modes
            return found
        self.taken = point.method_state[1:]
        return point.rates, float(point.method_state[0])

    def _projected(self, point: Point, t: float | None) -> Point:
        """End of a step, projected onto the constraints, with the rates of the next step."""
        state = self.project(replace(point.state, t=t))
        self.events += self.contacts.of([state.t], self.taken[None])
        if state.t >= self.end:
            return Point(state, point.work, point.rates)
        rates, share = self.rates_over(state, self.h)
        return Point(state, point.work, rates, np.array([share, *self.modes]))

    def _trajectory(self, kept, samples, began: float) -> Trajectory:
        whole = super()._trajectory(kept, samples, began)
        return replace(whole, stats=with_laws(whole.stats, self.h, self.error, self.relaxed), step=self.h)


def accepted_overlap(problem: Problem, controlled: bool = False) -> float:
    """Largest penetration at the start of a problem, relative to the scale of a gap.

    Parameters
    ----------
    problem : Problem
        Initial value problem.
    controlled : bool
        Whether the error of the steps is controlled: then they leave penetration within its tolerance.
    """
    system = problem.system
    if controlled or problem.step is None:
        return START_OVERLAP + problem.tolerance.share(system)
    return left_by_steps(system, problem.start.v, problem.step)


def with_laws(stats: Stats, step: float, error: float, relaxed: int) -> Stats:
    """Statistics with the step, the residual of the laws of contact, and the steps of the convex relaxation."""
    by = f"; {relaxed} steps by the convex relaxation of Coulomb's law" if relaxed else ""
    method = f"time stepping of {step:g} s, laws of contact and friction met to {error:.0e} relative{by}; {stats.method}"
    return stats._replace(method=method, law_error=error)


class KnownRates(NamedTuple):
    """Mean rates over a step that are known already, numbers or expressions."""

    system: System
    rates: Rates
    share: Entry

    def over(self, point: Point, h: Scalar) -> tuple[Rates, Entry]:
        """The rates, and the share s of the old rates."""
        return self.rates, self.share


def time_step(run: MoreauRun | KnownRates, point: Point, h: Entry) -> tuple[Point, Cost]:
    """One step: q₁ = q₀ ⊕ h (s v₀ + (1 − s) v₁)."""
    (rates, share), state = run.over(point, h), point.state
    v = state.v + h * rates.acceleration
    q = retract(run.system, advance_positions(run.system, state, h, share).q, ((1.0 - share) * h) * v)
    return Point(State(state.t + h, q, v), point.work + h * np.asarray(rates.power), rates), Cost(1)


TIME_STEPPING = FixedStep(
    "time_stepping",
    "time stepping with contacts and friction",
    1,
    "Moreau 1988; Anitescu 2006",
    1,
    time_step,
    nonsmooth=True,
)
NONSMOOTH = (TIME_STEPPING,)


def steps_at(trajectory: Trajectory) -> Callable[[int], MoreauStep]:
    """Steps from the samples of a motion by time stepping, by the numbers of these."""
    stepper, step = moreau_stepper(trajectory.system, removal=trajectory.removal), cast(float, trajectory.step)
    return lambda index: stepper.step(trajectory.state(index), step)


def contact_parts(motion: Kinematics, force: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Forces of a step as normal forces (m,) and friction on the first bodies of the contacts (m, 3), world axes [N]."""
    slip, m = slips(motion), len(motion.system.contacts.placed)
    friction = np.zeros((m, 3))
    across = force[m : m + 2 * len(slip.gap)].reshape(-1, 2)
    friction[slip.gap] = np.einsum("ki,kij->kj", across, slip.axes)
    return force[:m], friction


def with_forces(motion: Kinematics, force: np.ndarray, backend: str = "auto") -> Solution:
    """Solution under the forces of a step, with the reactions of the joints.

    Raises
    ------
    SimulationError
        If it is not certified.
    """
    problem = assemble_motion(motion, Applied(motion))
    _, set_valued, _ = set_valued_rows(motion)
    pushed = np.concatenate([gaps(motion).J, slips(motion).J.reshape(-1, set_valued.shape[1]), set_valued]).T @ force
    n = problem.Phi.size
    solution = solve(replace(problem, impressed=problem.impressed + pushed[:n], P=problem.P + pushed[n:]), backend)
    if not solution.status.certified:
        raise SimulationError(f"t = {motion.state.t:.6g} s, backend {solution.backend!r}: {solution.status}.")
    return solution
