"""The loop: from a start, step by step, to a trajectory."""

from dataclasses import replace

import numpy as np

from gauss.backends import Backend, ready
from gauss.dynamics.careful import CarefulSolver
from gauss.dynamics.compile import compile_scene
from gauss.dynamics.consistent import project
from gauss.dynamics.drift import Baumgarte, Drift, drift
from gauss.dynamics.laws import Laws, asks_where
from gauss.dynamics.looped import looped
from gauss.dynamics.program import Program
from gauss.dynamics.solver import Solver
from gauss.dynamics.swept import swept
from gauss.dynamics.switching import Switching, switching
from gauss.dynamics.timetable import NO_TIMES, Timetable
from gauss.dynamics.traced import Traced
from gauss.errors import SimulationError, judged_later, known, require
from gauss.integrators import (
    EXPLICIT,
    IMPLICIT,
    LIBRARIES,
    METHODS,
    FixedStep,
    Integrator,
    Library,
    RadauGGL,
    RadauIIA,
    Tolerance,
)
from gauss.scene import Scene
from gauss.simulation.balance import watch_balance
from gauss.simulation.compiled import CompiledRun, finished
from gauss.simulation.library_run import certified_rates, compiled_rates, compiled_settling, library_run
from gauss.simulation.overlooked import warn_of_switching, warn_of_times
from gauss.simulation.phases.phased import PhasedRun
from gauss.simulation.prescribed import beside_jumps
from gauss.simulation.residual_run import ResidualEquations
from gauss.simulation.run import Run
from gauss.simulation.still import still
from gauss.simulation.timesteps.stepped import stepped as stepped_motion
from gauss.simulation.timesteps.stepping import TIME_STEPPING
from gauss.simulation.tolerances import check_tolerances, tolerance
from gauss.simulation.trajectory import Trajectory
from gauss.simulation.verify import verified
from gauss.system import LARGE, State, System, has_large_loops, is_large, obstacles, refuse_changed

INTEGRATORS = METHODS | {method.name: method for method in (*LIBRARIES, *IMPLICIT, TIME_STEPPING)}
WIDEST = 128  # rates of a system whose whole step is compiled; longer steps are put together by Python


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
    allowed, method, known_breaks = (
        tolerance(system, rtol, atol),
        chosen(integrator),
        check_breaks(breaks, start.t, duration),
    )
    settings = {"duration": duration, "integrator": method.name, "step": step, "rtol": rtol, "atol": atol}
    settings |= {"backend": getattr(backend, "name", backend), "stabilisation": stabilisation}

    def moved(step, allowed, samples, mesh=()) -> Trajectory:
        with judged_later():
            return _moved(
                system,
                method,
                allowed,
                step,
                backend,
                stabilisation,
                start,
                start.t + duration,
                samples,
                progress,
                known_breaks,
                mesh,
            )

    found = None
    try:
        found = moved(step, allowed, samples)
        found = verified(found, method, step, allowed, moved) if verify else found
    except (SimulationError, KeyboardInterrupt) as error:
        reached = found if found is not None else getattr(error, "trajectory", None)
        error.trajectory = None if reached is None else replace(reached, settings=settings)
        raise
    found = replace(found, settings=settings)
    watch_balance(found, start)
    warn_of_switching(found, method)
    return found


def _moved(
    system: System,
    method: Integrator,
    tolerance: Tolerance,
    step: float | None,
    backend: str,
    stabilisation: str | Baumgarte,
    start: State,
    end: float,
    samples,
    progress: bool,
    breaks: np.ndarray,
    mesh=(),
) -> Trajectory:
    """Motion from a consistent start, by compiled code where the scene and the method allow it."""
    if not system.n_v:
        return still(system, method, step, start, end, samples)
    against = drift(system, stabilisation, start)
    if stabilisation == "ggl":
        if not isinstance(method, RadauIIA):
            raise SimulationError(f"integrator {method.name!r} knows no stabilisation 'ggl'; use 'radau5'.")
        method = RadauGGL() if system.closes else method
    mechanical = method.implicit if isinstance(method, Library) else method.mechanical
    if against.partitioned and (mechanical or isinstance(method, Library)):
        raise SimulationError(f"integrator {method.name!r} knows no stabilisation by partitioning; use 'projection'.")

    laws = Laws(system)
    heeded = _switching(system, laws, start, end, breaks)
    warn_of_times(system, heeded.times)
    if len(mesh):
        heeded = heeded._replace(times=heeded.times.join(Timetable(NO_TIMES.switches, np.asarray(mesh))))

    def made(start: State, samples) -> Trajectory:
        return _made(
            system, method, tolerance, step, backend, stabilisation, start, end, samples, progress, against, laws, heeded
        )

    return beside_jumps(heeded, start, end, samples, made)


def _made(
    system: System,
    method: Integrator,
    tolerance: Tolerance,
    step: float | None,
    backend: str,
    stabilisation: str | Baumgarte,
    start: State,
    end: float,
    samples,
    progress: bool,
    against: Drift,
    laws: Laws,
    heeded: Switching,
) -> Trajectory:
    """Motion from a consistent start, past all switching times but one at the start itself."""
    mechanical = method.implicit if isinstance(method, Library) else method.mechanical

    def library(rates, settle) -> Trajectory:
        return library_run(method, system, rates, settle, start, end, samples, tolerance, step, heeded)

    def stepped(solver, start: State, samples) -> Trajectory:
        if mechanical:
            raise SimulationError(not_compiled(system, f"integrator {method.name!r}"))
        if against.partitioned:
            raise SimulationError(not_compiled(system, "stabilisation 'partitioning'"))
        if isinstance(method, Library):
            settle = lambda state: project(system, state) if against.settles else state  # noqa: E731
            return library(certified_rates(system, Solver(backend, against.gains)), settle)
        run = Run(system, method, solver, tolerance, step, end, against.settles, heeded)
        return run.collect(start, samples, progress)

    def stepped_by_python(kernels, loads, slow=()) -> Trajectory:
        """Compiled accelerations with loads on coordinates from outside; the certified ones where a law asks more."""
        outside = any(not bound.on_coordinates or asks_where(bound.load) for bound in loads)
        solver = Solver("auto", against.gains) if outside else Traced(system, kernels, loads, slow, against.gains)
        return stepped(solver, start, samples)

    comes_and_goes = system.scene.changing
    if stabilisation != "projection" and (comes_and_goes or method is TIME_STEPPING):
        raise SimulationError(
            f"stabilisation {stabilisation!r}: motions with one-sided constraints, grips or time stepping are projected; "
            "use 'projection'."
        )
    if method is TIME_STEPPING:
        links = [name for name, grip in system.scene.grips.items() if callable(getattr(grip, "limit", callable))]
        if links or system.losses:
            raise SimulationError(
                "integrator 'time_stepping' takes no clutches, freewheels and losses, and no friction that comes and goes; "
                f"use 'dop853' for {', '.join(dict.fromkeys([*links, *system.losses]))}."
            )
        return stepped_motion(system, backend, start, end, step, samples, progress, heeded)
    if comes_and_goes:
        _refuse_rough(system, method)
        return PhasedRun(system, method, backend, tolerance, step, end, heeded).collect(start, samples, progress)
    if backend != "auto" or system.dynamics is None or _once(obstacles, system):
        return stepped(Solver(backend, against.gains), start, samples)
    if _once(has_large_loops, system):
        return stepped_by_python(looped(system, against.gains), system.loads)
    if _once(is_large, system):
        return stepped_by_python(swept(system), system.loads)
    if laws.called or system.n_v > WIDEST:
        make = lambda: Program(system, laws, against).kernels()  # noqa: E731
        kernels = system.dynamics.on_demand(f"kernels {against} {laws.key}", make)
        return stepped_by_python(kernels, laws.called, laws.reasons)
    if isinstance(method, Library):
        program = Program(system, laws, against)
        made = lambda what, make: system.dynamics.on_demand(f"library {what} {against} {laws.key}", lambda: make(program))  # noqa: E731
        method = made("equations", ResidualEquations).by(method) if method.implicit else method
        return library(made("rates", compiled_rates), made("settling", compiled_settling))
    run = CompiledRun(system, laws, start, end, samples, against, method, heeded)
    if isinstance(method, FixedStep):
        run.fixed(method, step, progress)
    else:
        run.adaptive(method, tolerance, step, progress)
    careful = CarefulSolver(system, laws) if against.gains is None else Solver("auto", against.gains)
    return finished(run, lambda start, samples: stepped(careful, start, samples))


def _switching(system: System, laws: Laws, start: State, end: float, breaks: np.ndarray) -> Switching:
    """What steps heed, kept for motions over the same time; opaque laws are asked anew."""
    make = lambda: switching(system, laws, start, end, breaks)  # noqa: E731
    if system.dynamics is None or laws.called:
        return make()
    return system.dynamics.on_demand(("switching", laws.key, start.t, end, tuple(breaks)), make)


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
    return system.initial_state() if system.dynamics is None else system.dynamics.on_demand("start", system.initial_state)


def _once(rule, system: System):
    """What a rule says of a system, which stays as it is."""
    return system.dynamics.on_demand(rule, lambda: rule(system))


def not_compiled(system: System, what: str) -> str:
    """Message when the equations of motion are not there as machine code."""
    against = Laws(system).against_compiling()
    against += [f"{system.n_v} rates are more than {WIDEST}"] if system.n_v > WIDEST else []
    against += [f"it has more than {LARGE} bodies"] if is_large(system) and not against else []
    why = "; ".join(against) or "that needs backend 'auto', and accelerations that are confirmed"
    return f"{what} needs the equations of motion in machine code: {why}. Use integrator 'dop853' and 'projection' here."


def _refuse_rough(system: System, method: Integrator):
    """Raise a SimulationError if a method cannot do what the one-sided constraints ask for."""
    if system.slips.placed:
        rough = [name for name, contact in system.scene.contacts.items() if getattr(contact, "friction", 0.0)]
        raise SimulationError(
            f"integrator {method.name!r} takes no friction of contacts; use integrator='time_stepping' with a step= [s] for "
            f"{', '.join(rough)}."
        )
    if method.name not in [explicit.name for explicit in EXPLICIT]:  # dense output of others costs a step at every look
        raise SimulationError(
            f"integrator {method.name!r} does not find the events of one-sided constraints and grips; use 'dop853' for "
            f"{', '.join(system.scene.changing)}."
        )


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
