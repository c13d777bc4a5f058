"""Simulation of a motion: arguments are checked, the plan is selected, and its driver computes the trajectory."""

from dataclasses import replace
from functools import partial

import numpy as np

from gauss.backends import Backend, ready
from gauss.dynamics.compile_scene import compile_scene
from gauss.dynamics.conditions import named
from gauss.dynamics.laws.switching import Switching, switching
from gauss.dynamics.laws.switching_times import NO_TIMES, Timetable
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.plan import plan_of
from gauss.dynamics.rules import Plan
from gauss.dynamics.stabilisation import Baumgarte, drift
from gauss.errors import SimulationError, did_you_mean, judged_later, require
from gauss.integrators import IMPLICIT, LIBRARIES, METHODS, FixedStep, Integrator, RadauGGL
from gauss.scene import Scene
from gauss.simulation.drivers import drive
from gauss.simulation.energy_balance import watch_balance
from gauss.simulation.moreau.moreau_jean import TIME_STEPPING
from gauss.simulation.prescribed import beside_jumps
from gauss.simulation.problem import Problem
from gauss.simulation.refusals import refuse
from gauss.simulation.tolerances import check_tolerances, tolerance
from gauss.simulation.trajectory import Trajectory
from gauss.simulation.undetected_switching import warn_of_switching, warn_of_times
from gauss.simulation.verify import verified
from gauss.system import State, System, refuse_changed

INTEGRATORS = METHODS | {method.name: method for method in (*LIBRARIES, *IMPLICIT, TIME_STEPPING)}


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
        "dop853" and "dopri5": orders 8 and 5, step chosen by ``rtol`` and ``atol``, events of one-sided constraints
        located; "taylor": order and step chosen by them (:class:`gauss.Taylor`), few long steps, the quickest to many digits
        on small scenes; forces must be smooth; "radau5": order 5, implicit, for stiff scenes. With fixed ``step``: "rk4";
        "semi_implicit_euler"; "verlet" (RATTLE with loops), "variational_midpoint", "gauss4" and "gauss6", symplectic, on
        ball and free joints, too, of orders 2, 2, 4 and 6: without loads that do work, the energy error stays bounded over
        any number of steps, and the momenta of symmetries are conserved to rounding; "generalised_alpha", of order 2,
        damps high frequencies (see :func:`gauss.generalised_alpha`). "energy_momentum", of order 2, conserves energy to
        rounding with any step, and the momenta of coordinates on which no force acts, but not those of rotations about axes
        of space; "time_stepping" (Moreau–Jean), the one for friction of contacts, of order 2 without impacts, stick–slip
        transitions, loops and restitution, else of order 1 (see
        :mod:`gauss.simulation.moreau.moreau_jean`). Of other libraries, for comparison: "scipy_dop853", "scipy_radau",
        "scipy_lsoda", and with scikit-sundae "cvode_adams", "cvode_bdf", and "ida", which meets constraints by multipliers,
        stabilised (index 2).
    step : float, optional
        Step of a fixed-step method, largest step of an adaptive one [s].
    rtol, atol : float
        Local error of coordinates and rates: atol (rad, m, rad/s, m/s) + rtol · size. A pair of atol is for coordinates and
        for rates. A dict gives a number or a pair for kinds of coordinates, "angle" and "length", and for joints by name:
        ``atol={"length": 1e-6, "wrist": (1e-8, 1e-6)}``. What is not given is 1e-12 of the scale of the scene, its length
        and 1 rad, and these in its time (``system.scale``; :meth:`gauss.System.explain` prints it).
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
    verify : bool
        Repeat the motion with smaller steps, and estimate its global error from the difference: ``stats.global_error``.
    progress : bool
        Show a progress bar on runs of more than a second, in a terminal.
    plan : Plan, optional
        Driver and dynamics to be used, if their conditions hold, instead of the first row of
        :data:`gauss.dynamics.plan.MOTIONS` whose conditions hold; ``stats.plan`` tells which it was.

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
        the state, and nothing is known of opaque laws between evaluations.

    Raises
    ------
    SimulationError
        Before the first step, if a prescribed position jumps; later, if the motion cannot continue: its ``trajectory`` holds
        the motion so far.
    KeyboardInterrupt
        On Ctrl-C; its ``trajectory`` holds the motion so far, None before the first step.
    """
    require(scene, (Scene, System), "simulate")
    if state is not None:
        require(state, (State,), "simulate: state")
    if backend != "auto":
        made = ready(backend)
        backend = backend if isinstance(backend, str) else made
    system = scene if isinstance(scene, System) else compile_scene(scene)
    check_arguments(duration, integrator, step, rtol, atol)
    refuse_changed(system)
    start = _start(system) if state is None else system.projected(state)
    samples = sample_times(times, start.t, duration)
    method, known_breaks = chosen(integrator), check_breaks(breaks, start.t, duration)
    settings = {"duration": duration, "integrator": method.name, "step": step, "rtol": rtol, "atol": atol}
    settings |= {"backend": named(backend), "stabilisation": stabilisation}
    against, laws = drift(system, stabilisation, start), Laws(system)
    problem = Problem(
        system,
        laws,
        method,
        tolerance(system, rtol, atol),
        step,
        backend,
        stabilisation,
        against,
        _switching(system, laws, start, start.t + duration, known_breaks),
        start,
        start.t + duration,
        samples,
        progress,
    )
    if system.n_v:
        refuse(problem)
    if stabilisation == "ggl" and system.closes:
        problem = problem._replace(method=RadauGGL())
    warn_of_times(system, problem.switching.times)

    if plan is not None:
        require(plan, (Plan,), "simulate: plan")
    plan = plan_of(problem.question, plan)
    again = partial(_again, problem, plan)
    found = None
    try:
        found = _motion(problem, plan)
        found = verified(found, method, step, problem.tolerance, again) if verify else found
    except (SimulationError, KeyboardInterrupt) as error:
        reached = found if found is not None else getattr(error, "trajectory", None)
        error.trajectory = None if reached is None else _recorded(reached, settings, plan)
        raise
    found = _recorded(found, settings, plan)
    watch_balance(found, start)
    warn_of_switching(found, method)
    return found


def _motion(problem: Problem, plan: Plan) -> Trajectory:
    """Trajectory of a problem by a plan, with the jumps of prescribed velocities at its samples."""

    def made(start: State, samples) -> Trajectory:
        same = start is problem.start and samples is problem.samples
        return drive(problem if same else problem._replace(start=start, samples=samples), plan)

    with judged_later():
        return beside_jumps(problem.switching, problem.start, problem.end, problem.samples, made)


def _again(problem: Problem, plan: Plan, step, allowed, samples, mesh=()) -> Trajectory:
    """The motion with another step, tolerance and samples, and with steps that end at the times of a mesh."""
    switching = problem.switching
    if len(mesh):
        switching = switching._replace(times=switching.times.join(Timetable(NO_TIMES.switches, np.asarray(mesh))))
    return _motion(problem._replace(step=step, tolerance=allowed, samples=samples, switching=switching), plan)


def _recorded(found: Trajectory, settings: dict, plan: Plan) -> Trajectory:
    """Trajectory with its settings and its plan."""
    return replace(found, settings=settings, stats=found.stats._replace(plan=plan))


def _switching(system: System, laws: Laws, start: State, end: float, breaks: np.ndarray) -> Switching:
    """Switching of a motion, cached for motions over the same time; opaque laws are sampled anew."""
    make = lambda: switching(system, laws, start, end, breaks)  # noqa: E731
    if system.dynamics is None or laws.called:
        return make()
    return system.dynamics.on_demand((switching, laws.key, start.t, end, tuple(breaks)), make)


def check_breaks(breaks, start: float, duration: float) -> np.ndarray:
    """Times of breaks [s], checked.

    Raises
    ------
    SimulationError
        If they are no finite numbers.
    """
    if isinstance(breaks, tuple) and not breaks:
        return NO_TIMES.switches
    try:
        times = np.unique(start + np.asarray(breaks, dtype=float).reshape(-1))
    except (TypeError, ValueError):
        raise SimulationError(f"breaks: expected times [s], got {breaks!r}.") from None
    if not np.isfinite(times).all():
        raise SimulationError(f"breaks: expected finite times [s], got {breaks!r}.")
    return times[(times > start) & (times < start + duration)]


def _start(system: System) -> State:
    """Initial state of the scene, cached."""
    return system.initial_state() if system.dynamics is None else system.dynamics.on_demand((_start,), system.initial_state)


def chosen(integrator: str | Integrator) -> Integrator:
    """Integrator of a name; an integrator is returned as it is.

    Raises
    ------
    SimulationError
        If there is none.
    """
    if isinstance(integrator, str) and integrator in INTEGRATORS:
        return INTEGRATORS[integrator]
    if not isinstance(integrator, Integrator):
        raise SimulationError(f"no integrator {integrator!r}. {did_you_mean(str(integrator), INTEGRATORS)}")
    return integrator


def check_arguments(duration, integrator, step, rtol, atol):
    """Raise a SimulationError if an argument of a simulation is invalid."""
    method = chosen(integrator)
    check_tolerances(duration=duration, rtol=rtol, atol=atol, **({} if step is None else {"step": step}))
    if isinstance(method, FixedStep) and step is None:
        raise SimulationError(f"integrator {method.name!r} has a fixed step: give step= [s], for instance step=1e-3.")


def sample_times(times, start: float, duration: float):
    """Times of the samples [s], checked; None for every accepted step."""
    if times is None:
        return None
    try:
        samples = start + np.asarray(times, dtype=float)
    except (TypeError, ValueError):
        raise SimulationError(f"times: expected increasing numbers [s], got {times!r}.") from None
    end = start + duration
    increasing = samples.ndim == 1 and samples.size > 0 and bool((samples[1:] > samples[:-1]).all())
    if not (increasing and samples[0] >= start and samples[-1] <= end * (1 + 1e-12)):  # False for NaN, too
        raise SimulationError(f"times: expected increasing times between 0 and the duration {duration} s.")
    return np.minimum(samples, end)
