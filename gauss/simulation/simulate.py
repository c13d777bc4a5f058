"""Simulation of a motion: check the arguments, select the plan, and let its driver compute the trajectory."""

from contextlib import nullcontext
from dataclasses import replace
from functools import partial

import numpy as np

from gauss.arguments import named_arguments
from gauss.backends import Backend
from gauss.codegen import gc_pause, one_tier
from gauss.codegen.tiers import AUTO, Run
from gauss.dynamics.conditions import own_backend
from gauss.dynamics.evaluation_cost import warn_of_slow_route
from gauss.dynamics.laws.switching import NO_SWITCHING
from gauss.dynamics.laws.switching_times import NO_TIMES, Timetable
from gauss.dynamics.plan import plan_of
from gauss.dynamics.rules import Plan
from gauss.dynamics.stabilisation import Baumgarte
from gauss.dynamics.store import is_first_use
from gauss.errors import SimulationError, judged_later, require
from gauss.integrators import FixedStep, Integrator
from gauss.interruption import interruption_keeps
from gauss.scene import Scene
from gauss.simulation.arguments import checked_problem, described, held_inputs
from gauss.simulation.constraint_surfaces import across_surfaces
from gauss.simulation.drivers import DRIVERS
from gauss.simulation.energy_balance import watch_balance
from gauss.simulation.history import History
from gauss.simulation.moreau.sleeping import Sleeping, checked_sleeping
from gauss.simulation.prescribed import beside_jumps
from gauss.simulation.problem import Problem
from gauss.simulation.trajectory import Trajectory
from gauss.simulation.undetected_switching import warn_of_switching
from gauss.simulation.verify import verified
from gauss.system import State, System

SLEEPING_PLAN = Plan("time stepping", "pair kernels")  # of motions whose bodies sleep


@named_arguments
@interruption_keeps("trajectory")
def simulate(
    scene: Scene | System,
    duration: float,
    *,
    integrator: str | Integrator = "dop853",
    step: float | None = None,
    rtol: float = 1e-12,
    atol: float | tuple[float, float] | dict | None = None,
    backend: str | Backend | type = "auto",
    stabilisation: str | Baumgarte = "projection",
    state: State | None = None,
    times=None,
    breaks=(),
    control=None,
    rate: float | None = None,
    sleeping: bool | Sleeping = False,
    verify: bool = False,
    progress: bool = True,
    plan: Plan | None = None,
) -> Trajectory:
    """Simulate a motion.

    Parameters
    ----------
    scene : Scene or System
        Scene, or a compiled one.
    duration : float
        Simulated time [s].
    integrator : str or Integrator
        "dop853" and "dopri5": orders 8 and 5, step-size control by ``rtol`` and ``atol``, events of unilateral
        constraints located; "taylor": order and step chosen by them (:class:`gauss.Taylor`), few long steps, the quickest
        to many digits
        on small scenes; forces must be smooth; "radau5": order 5, implicit, for stiff scenes. With fixed ``step``: "rk4";
        "semi_implicit_euler"; "verlet" (RATTLE with loops), "variational_midpoint", "gauss4" and "gauss6", symplectic, on
        ball and free joints, too, of orders 2, 2, 4 and 6: without loads that do work, the energy error stays bounded over
        any number of steps, and the momenta of symmetries are conserved to rounding; "generalised_alpha", of order 2,
        damps high frequencies (see :func:`gauss.generalised_alpha`). "energy_momentum", of order 2, conserves energy to
        rounding with any step, and the momenta of coordinates on which no force acts, but not those of rotations about axes
        of space; "time_stepping" (Moreau–Jean), the one for friction of contacts, of order 2 without impacts, stick–slip
        transitions, loops and restitution, else of order 1 (see
        :mod:`gauss.simulation.moreau.moreau_jean`); without ``step`` it chooses its steps by ``rtol``, 1e-7 or more (see
        :mod:`gauss.simulation.moreau.error_control`). Of other libraries, for comparison: "scipy_dop853", "scipy_radau",
        "scipy_lsoda", and with scikit-sundae "cvode_adams", "cvode_bdf", and "ida", which meets constraints by multipliers,
        stabilised (index 2).
    step : float, optional
        Step of a fixed-step method, largest step of an adaptive one [s].
    rtol, atol : float
        Local error of coordinates and rates: atol (rad, m, rad/s, m/s) + rtol · size. A pair of atol is for coordinates and
        for rates. A dict gives a number or a pair for kinds of coordinates, "angle" and "length", and for joints by name:
        ``atol={"length": 1e-6, "wrist": (1e-8, 1e-6)}``. What is not given is 1e-12 of the scale of the scene, its length
        and 1 rad, and these in its time (``system.scale``; :meth:`gauss.System.explain` prints it); by time stepping
        ``rtol`` of it.
    backend : str, Backend or class
        Solver of the accelerations: a name, an object of the form of :class:`gauss.backends.Backend`, or a class that
        makes one for this motion; see :func:`gauss.solve`. "auto": compiled code where the scene allows it (``explain()``
        says so), checked every few steps and at the end by inverse dynamics of the scene as given, and by the certified
        recursion where joints close loops. Where a check fails, the recursion, certified at every evaluation, or compiled
        code with iterative refinement and an error bound; else the recursion.
    stabilisation : str or Baumgarte
        Constraint stabilisation: "projection" of position and velocity in the mass metric after each step; "partitioning":
        dependent coordinates, chosen anew in every step, follow from the independent ones; "baumgarte", or
        :class:`Baumgarte` with gains; "ggl": stabilised equations of index 2, for "radau5"; "none".
    state : State, optional
        Initial state; that of the scene when not given. It is projected onto the constraints.
    times : array_like, optional
        Samples to return [s], counted from the start; every accepted step when not given.
    breaks : sequence of float
        Switching times of opaque (untraceable) laws [s], counted from the start. No step crosses one. Conditions of traced
        laws, on time or state, are located without it. A jump of a prescribed speed is an impact: an event of the
        trajectory.
    control : callable or array_like, shape (k, n_u), optional
        Law of the inputs of the scene (:meth:`gauss.Scene.input`), ``law(t, q, v)`` → values (n_u,) [N m, N]: any Python
        callable, called once for each sample and free to keep a state; or a table with a row for each sample. The values
        are held from one sample to the next (zero-order hold), where steps end, and cut off at the limits of the inputs. The
        system of the trajectory has drives by these values for its inputs. Without it the inputs are zero.
    rate : float, optional
        Samples of the law in a second [Hz]; the first is at the start.
    sleeping : bool or Sleeping
        By time stepping with contacts of shapes: islands of bodies that touch each other, with all that joints and loads
        connect with them, sleep once they have been slow for a while (:class:`Sleeping`), and cost little until another
        body pushes them, or an input that acts on them changes. What a law of time or a prescribed motion acts on never
        sleeps. Their kinetic energy counts as dissipated; events "sleeps" and "wakes" name the bodies.
    verify : bool
        Repeat the motion with smaller steps, and estimate its global error from the difference: ``stats.global_error``.
    progress : bool
        In a terminal, show a progress bar on runs of more than a second, and a line while code is made for as long.
    plan : Plan, optional
        Driver and dynamics to be used, if their conditions hold, instead of the first row of
        :data:`gauss.dynamics.plan.MOTIONS` whose conditions hold; ``stats.plan`` tells which it was. Its ``tier`` chooses
        between quick and optimised machine code.

    Returns
    -------
    Trajectory
        Samples, work of the loads, and statistics.

    Warns
    -----
    BalanceWarning
        If the energy balance is off by more than a thousandth of the largest energy, by time stepping a twentieth. Compiled
        loops record it along the motion, other motions are checked at a few samples; :func:`gauss.energy` checks all.
    SwitchingWarning
        If a law may have switched between two evaluations: fixed steps and methods of libraries do not locate conditions on
        the state, and nothing is known of opaque laws between evaluations. If the value of a law depends on what it keeps
        from one call for the next.
    SlowRouteWarning
        Once for each system, if an element of the scene makes the motion a hundred times slower than machine code.

    Raises
    ------
    SimulationError
        Before the first step, if a prescribed position jumps, or a law is random and steps are adaptive; later, if a
        constraint jumps at a condition on the state that the motion crosses, if the motion cannot continue, or the control
        law returns a value that is no finite number: its ``trajectory`` holds the motion so far.
    StateError
        If the state does not fit the system, or a loop that cannot move has another pose than in the scene.
    KeyboardInterrupt
        On Ctrl-C; its ``trajectory`` holds the motion so far, None before the first step.
    """
    if plan is not None:
        require(plan, (Plan,), "simulate: plan")
    later = isinstance(scene, System) and not is_first_use(scene)
    with nullcontext() if later else gc_pause(), one_tier(AUTO if plan is None else plan.tier, progress) as run:
        problem = checked_problem(
            scene, duration, integrator, step, rtol, atol, backend, stabilisation, state, times, breaks, progress
        )
        if control is not None or rate is not None or sleeping is not False:
            problem = _held_or_sleeping(problem, control, rate, sleeping)
        settings, history = described(problem, duration, integrator, rtol, atol), _history(problem)
        wanted = SLEEPING_PLAN if problem.sleeping is not None and plan is None else plan
        found = _simulated(problem, plan_of(problem.question, wanted), settings, verify, run)
    _watch(found, problem, history)
    if plan is None:
        _warn_of_plan(found, problem)
    return found


def _held_or_sleeping(problem: Problem, control, rate: float | None, sleeping: bool | Sleeping) -> Problem:
    """Problem with the inputs of a control law, and with bodies that sleep."""
    problem = problem._replace(held=held_inputs(problem, control, rate))
    return problem._replace(sleeping=checked_sleeping(sleeping, problem))


def _history(problem: Problem) -> History | None:
    """State of the opaque laws before a motion, none of which may be random in adaptive steps; None without such laws."""
    if not problem.laws.called:
        return None
    history = History(problem.laws)
    if not isinstance(problem.method, FixedStep):
        history.refuse_random(problem.system, problem.start)
    return history


def _watch(found: Trajectory, problem: Problem, history: History | None):
    """Warn where a motion may be wrong: by its energy balance, and by its laws where there are any."""
    watch_balance(found, problem.start)
    if found.stats.unseen or found.stats.opaque:
        warn_of_switching(found, problem.method)
    if history is not None:
        history.warn(found)


def _warn_of_plan(found: Trajectory, problem: Problem):
    """Warn of a plan that is slow because of an element of the scene."""
    chosen = found.stats.plan
    if chosen is not None and chosen.rejected and not own_backend(problem.question):
        warn_of_slow_route(problem.system, chosen, found.stats.evaluations)


def _simulated(problem: Problem, plan: Plan, settings: dict, verify: bool, run: Run) -> Trajectory:
    """Trajectory with its settings and its plan; an error carries the motion so far."""
    found = None
    try:
        found = _motion(problem, plan)
        found = verified(found, problem, partial(_again, problem, plan)) if verify else found
    except (SimulationError, KeyboardInterrupt) as error:
        reached = found if found is not None else getattr(error, "trajectory", None)
        recorded = None if reached is None else _recorded(problem, reached, settings, plan.ran(run.ran))
        error.trajectory = recorded  # type: ignore[union-attr]  # documented: Ctrl-C keeps the motion so far
        raise
    return _recorded(problem, found, settings, plan.ran(run.ran))


def _motion(problem: Problem, plan: Plan) -> Trajectory:
    """Trajectory of a problem by the driver of a plan, in pieces where constraints jump between modes."""
    if problem.switching is NO_SWITCHING:  # nor has it constraints that might
        with judged_later():
            return DRIVERS[plan.driver](problem, plan)

    def drive(piece: Problem) -> Trajectory:
        return _beside_jumps(plan if piece.system is problem.system else _plan_of_mode(piece, plan), piece)

    with judged_later():
        return across_surfaces(problem, drive)


def _plan_of_mode(piece: Problem, whole: Plan) -> Plan:
    """Plan of a mode: that of the whole motion where its conditions hold, else the first whose do."""
    try:
        return plan_of(piece.question, whole)
    except SimulationError:
        return plan_of(piece.question)


def _beside_jumps(plan: Plan, problem: Problem) -> Trajectory:
    """Trajectory of a problem by the driver of a plan, with the jumps of prescribed velocities at its samples."""

    def driven(start: State, end: float, samples) -> Trajectory:
        same = start is problem.start and end == problem.end and samples is problem.samples
        return DRIVERS[plan.driver](problem if same else problem._replace(start=start, end=end, samples=samples), plan)

    return beside_jumps(problem.switching, problem.start, problem.end, problem.samples, driven)


def _again(problem: Problem, plan: Plan, step, tolerance, samples, mesh=()) -> Trajectory:
    """The motion with another step, tolerance and samples, and with steps that end at the times of a mesh."""
    switching = problem.switching
    if len(mesh):
        switching = switching._replace(times=switching.times.join(Timetable(NO_TIMES.switches, np.asarray(mesh))))
    return _motion(problem._replace(step=step, tolerance=tolerance, samples=samples, switching=switching), plan)


def _recorded(problem: Problem, found: Trajectory, settings: dict, plan: Plan) -> Trajectory:
    """Trajectory with its settings and its plan, and with the system of its inputs."""
    if found.stats.sleep is not None:
        plan = replace(plan, sleepers=len(found.stats.sleep.able))
    return found.recorded(found.system if problem.held is None else problem.held.recorded(), settings, plan)
