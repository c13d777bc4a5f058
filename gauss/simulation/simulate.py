"""The loop: from a start, step by step, to a trajectory."""

from dataclasses import replace
from functools import partial

import numpy as np

from gauss.backends import Backend, ready
from gauss.dynamics.compile import compile_scene
from gauss.dynamics.conditions import named
from gauss.dynamics.drift import Baumgarte, drift
from gauss.dynamics.laws import Laws
from gauss.dynamics.plan import plan_of
from gauss.dynamics.rules import Plan
from gauss.dynamics.switching import Switching, switching
from gauss.dynamics.timetable import NO_TIMES, Timetable
from gauss.errors import SimulationError, judged_later, known, require
from gauss.integrators import IMPLICIT, LIBRARIES, METHODS, FixedStep, Integrator, RadauGGL
from gauss.scene import Scene
from gauss.simulation.balance import watch_balance
from gauss.simulation.drivers import drive
from gauss.simulation.overlooked import warn_of_switching, warn_of_times
from gauss.simulation.prescribed import beside_jumps
from gauss.simulation.problem import Problem
from gauss.simulation.refusals import refuse
from gauss.simulation.timesteps.stepping import TIME_STEPPING
from gauss.simulation.tolerances import check_tolerances, tolerance
from gauss.simulation.trajectory import Trajectory
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
        What moves.
    duration : float
        How long [s].
    integrator : str or Integrator
        "dop853" and "dopri5": orders 8 and 5, step chosen by ``rtol`` and ``atol``, events of one-sided constraints
        located; "taylor": order and step chosen by them (:class:`gauss.Taylor`), few long steps, the quickest to many digits
        on small scenes; forces must be smooth; "radau5": order 5, implicit, for stiff scenes. Of fixed ``step``: "rk4";
        "semi_implicit_euler"; "verlet" (RATTLE with loops), "variational_midpoint", "gauss4" and "gauss6", symplectic, on
        ball and free joints, too, of orders 2, 2, 4 and 6: without loads that do work, the energy error stays bounded over
        any number of steps, and momenta that belong to symmetries are kept to rounding; "generalised_alpha", of order 2,
        damps high frequencies (see :func:`gauss.generalised_alpha`). "energy_momentum", of order 2, conserves energy to
        rounding with any step, and the momenta of coordinates on which no force acts, but not those of rotations about axes
        of space; "time_stepping", the one that takes friction of contacts, of order 2 where nothing is hit
        or begins to slide or stick, no loops close and nothing rebounds, else of order 1 (see
        :mod:`gauss.simulation.timesteps.stepping`). Of other libraries, for comparison: "scipy_dop853", "scipy_radau",
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
        How accelerations are solved: a name, an object of the form of :class:`gauss.backends.Backend`, or a class that
        makes one for this motion; see :func:`gauss.solve`. "auto": by compiled code where the scene
        allows it (``explain()`` says so), checked every few steps and at the end by inverse dynamics of the scene as it is
        written, and by the certified recursion where joints close loops; where that is not confirmed, the recursion,
        certified at every evaluation, or compiled code that takes more care and knows its error; else the recursion.
    stabilisation : str or Baumgarte
        How drift off the constraints is undone: "projection" of position and velocity in the mass metric after each step;
        "partitioning": dependent coordinates, chosen anew in every step, follow from the others; "baumgarte", or
        :class:`Baumgarte` with gains; "ggl": stabilised equations of index 2, for "radau5"; "none".
    state : State, optional
        Start; the scene's own when not given. It is made consistent.
    times : array_like, optional
        Samples to return [s], counted from the start; every accepted step when not given.
    breaks : sequence of float
        Times when something switches [s], counted from the start, for laws that gauss cannot look into: those that call
        functions which cannot be traced. No step crosses one of them. Conditions of traced laws, on the time or on the
        motion, are found by themselves. Where a prescribed speed jumps, there is an impact: an event of the trajectory.
    verify : bool
        Make the motion again with smaller steps, and estimate its global error from the difference:
        ``stats.global_error``.
    progress : bool
        Show a bar on runs of more than a second, if a terminal is there to show it.
    plan : Plan, optional
        Take this driver and dynamics, where they can do what is asked for, instead of the first row of
        :data:`gauss.dynamics.plan.MOTIONS` that holds, which is in ``stats.plan``.

    Returns
    -------
    Trajectory
        Samples, work of the loads, and what it cost.

    Warns
    -----
    BalanceWarning
        If the energy balance is off by more than a thousandth of the largest energy, by time stepping a twentieth. Compiled
        loops look at it on the way, of other motions a few samples are looked at; :func:`gauss.energy` tells of all.
    SwitchingWarning
        If a law may have switched between two evaluations: a fixed step or the method of a library may pass conditions on
        the motion unseen, and laws that cannot be traced tell nothing between their evaluations.

    Raises
    ------
    SimulationError
        If a prescribed position jumps on the way, before any step is made; if the motion cannot go on: its ``trajectory``
        holds what there is.
    KeyboardInterrupt
        On Ctrl-C; its ``trajectory`` holds what there is, None before the first step.
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

    chosen_plan = _planned(problem, plan)
    again = partial(_again, problem, chosen_plan)
    found = None
    try:
        found = _motion(problem, chosen_plan)
        found = verified(found, method, step, problem.tolerance, again) if verify else found
    except (SimulationError, KeyboardInterrupt) as error:
        reached = found if found is not None else getattr(error, "trajectory", None)
        error.trajectory = None if reached is None else _told(reached, settings, chosen_plan)
        raise
    found = _told(found, settings, chosen_plan)
    watch_balance(found, start)
    warn_of_switching(found, method)
    return found


def _planned(problem: Problem, wanted: Plan | None) -> Plan:
    if wanted is not None:
        require(wanted, (Plan,), "simulate: plan")
    return plan_of(problem.question, wanted)


def _motion(problem: Problem, plan: Plan) -> Trajectory:
    """Motion of a problem by its plan."""

    def made(start: State, samples) -> Trajectory:
        same = start is problem.start and samples is problem.samples
        return drive(problem if same else problem._replace(start=start, samples=samples), plan)

    with judged_later():
        return beside_jumps(problem.switching, problem.start, problem.end, problem.samples, made)


def _again(problem: Problem, plan: Plan, step, allowed, samples, mesh=()) -> Trajectory:
    """The same motion with another step and tolerance, at other times, with steps that end at the times of a mesh."""
    heeded = problem.switching
    if len(mesh):
        heeded = heeded._replace(times=heeded.times.join(Timetable(NO_TIMES.switches, np.asarray(mesh))))
    return _motion(problem._replace(step=step, tolerance=allowed, samples=samples, switching=heeded), plan)


def _told(found: Trajectory, settings: dict, plan: Plan) -> Trajectory:
    """Motion with how it was made."""
    return replace(found, settings=settings, stats=found.stats._replace(plan=plan))


def _switching(system: System, laws: Laws, start: State, end: float, breaks: np.ndarray) -> Switching:
    """What steps heed, kept for motions over the same time; opaque laws are asked anew."""
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
    """Start of the scene, assembled once for all runs."""
    return system.initial_state() if system.dynamics is None else system.dynamics.on_demand((_start,), system.initial_state)


def chosen(integrator: str | Integrator) -> Integrator:
    """Return the method of a name; a method is returned as it is.

    Raises
    ------
    SimulationError
        If there is none.
    """
    if isinstance(integrator, str) and integrator in INTEGRATORS:
        return INTEGRATORS[integrator]
    if not isinstance(integrator, Integrator):
        raise SimulationError(f"no integrator {integrator!r}. {known(str(integrator), INTEGRATORS)}")
    return integrator


def check_arguments(duration, integrator, step, rtol, atol):
    """Raise a SimulationError if an argument of a simulation makes no sense."""
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
    if not (increasing and samples[0] >= start and samples[-1] <= end * (1 + 1e-12)):  # NaN compares to nothing
        raise SimulationError(f"times: expected increasing times between 0 and the duration {duration} s.")
    return np.minimum(samples, end)
