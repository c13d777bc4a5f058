"""Arguments of a motion, checked: from what a user gives to the initial value problem that drivers solve.

What a scene does not have is not asked for: a plain system (:attr:`gauss.System.is_plain`) has no functions that may have
changed, nothing that switches, and takes every method.
"""

from functools import partial
from numbers import Real

import numpy as np

from gauss import integrators
from gauss.arguments import real_numbers
from gauss.backends import Backend, ready
from gauss.dynamics.initial_states import scene_start
from gauss.dynamics.laws.switching import NO_SWITCHING, Switching, switching
from gauss.dynamics.laws.switching_times import NO_TIMES
from gauss.dynamics.laws.traced_laws import Laws, present_laws
from gauss.dynamics.rules import named
from gauss.dynamics.scene_compilation import compile_scene
from gauss.dynamics.stabilisation import Baumgarte, drift
from gauss.dynamics.store import cached
from gauss.errors import SimulationError, did_you_mean, judged_later, require
from gauss.integrators import FixedStep, Integrator
from gauss.scene import Scene
from gauss.simulation.held_inputs import HeldInputs
from gauss.simulation.integrators import INTEGRATORS
from gauss.simulation.memory_limit import SHORTER, refuse_beyond_memory
from gauss.simulation.problem import Problem
from gauss.simulation.refusals import refuse
from gauss.simulation.tolerances import check_tolerances, shares_of_scale, tolerance
from gauss.simulation.undetected_switching import warn_of_times
from gauss.system import State, System, refuse_changed

FITTING_NUMBERS = 1e6  # in memory of any machine
SAMPLE_NUMBERS = 6  # in memory for each sample of a motion, beside coordinates and rates: times, steps and work
LEAST_CONTROLLED_RTOL = 1e-7  # of time stepping by error control: gaps are rounded, and its order is low


def checked_problem(
    scene: Scene | System,
    duration: float,
    integrator: str | Integrator,
    step: float | None,
    rtol: float,
    atol,
    backend: str | Backend | type,
    stabilisation: str | Baumgarte,
    state: State | None,
    times,
    breaks,
    progress: bool,
) -> Problem:
    """Initial value problem of the arguments of :func:`gauss.simulate`.

    Raises
    ------
    SimulationError
        If an argument is invalid, or the integrator does not apply to the scene.
    """
    require(scene, (Scene, System), "simulate")
    if state is not None:
        require(state, (State,), "simulate: state")
    if backend != "auto":
        made = ready(backend)
        backend = backend if isinstance(backend, str) else made
    system = scene if isinstance(scene, System) else compile_scene(scene)
    method = check_arguments(duration, integrator, step, rtol, atol)
    start = _start(system, state)
    samples = sample_times(times, start.t, duration)
    known_breaks = check_breaks(breaks, start.t, duration)
    _refuse_beyond_memory(system, method, duration, step, samples)
    constraint_drift, laws, end = drift(system, stabilisation, start), present_laws(system), start.t + duration
    problem = Problem(
        system,
        laws,
        method,
        tolerance(system, rtol, shares_of_scale(system, rtol) if is_controlled(method, step) and atol is None else atol),
        step,
        backend,
        stabilisation,
        constraint_drift,
        _switching(system, laws, start, end, known_breaks),
        start,
        end,
        samples,
        progress,
    )
    _refuse_misfits(problem)
    if stabilisation == "ggl" and system.closes:
        problem = problem._replace(method=integrators.RadauGGL())
    if problem.switching is not NO_SWITCHING:
        warn_of_times(system, problem.switching.times)
    return problem


def _refuse_misfits(problem: Problem):
    """Refuse a method or a start that does not apply; every smooth method fits smooth scenes that are projected."""
    system = problem.system
    nonsmooth = system.nonsmooth or getattr(problem.method, "nonsmooth", False)
    if system.n_v and (problem.stabilisation != "projection" or nonsmooth or system.rigid_joints):
        refuse(problem)


def _refuse_beyond_memory(system: System, method: Integrator, duration: float, step: float | None, samples):
    """Refuse samples that do not fit into memory: of each step, where no times are given."""
    count = 0.0 if samples is None else float(len(samples))
    asked = "times"
    if samples is None and step is not None and isinstance(method, FixedStep):
        count, asked = duration / step, f"step: each step of {step:.3g} s"
    numbers = count * (SAMPLE_NUMBERS + system.n_q + system.n_v)
    if numbers <= FITTING_NUMBERS:
        return
    refuse_beyond_memory(
        numbers, f"{asked}: {count:.3g} samples of {system.scene.name!r}", f"give fewer times=, or {SHORTER}"
    )


def is_controlled(method: Integrator, step: float | None) -> bool:
    """Whether error control chooses the steps of a method of fixed ones."""
    return isinstance(method, FixedStep) and step is None


def held_inputs(problem: Problem, control, rate: float | None) -> HeldInputs | None:
    """Inputs of a motion, as of :class:`gauss.simulation.held_inputs.HeldInputs`; None without a control law."""
    if control is None:
        if rate is not None:
            raise SimulationError("rate: goes with control=, the law that is sampled.")
        return None
    return HeldInputs(problem.system, control, rate, problem.start.t, problem.end)


def described(problem: Problem, duration: float, integrator: str | Integrator, rtol: float, atol) -> dict:
    """Settings of a motion by name, as its trajectory records them."""
    return {
        "duration": duration,
        "integrator": integrator if isinstance(integrator, str) else integrator.name,
        "step": problem.step,
        "rtol": rtol,
        "atol": atol,
        "backend": named(problem.backend),
        "stabilisation": problem.stabilisation,
        **({} if problem.held is None else {"rate": problem.held.rate}),
        **({} if problem.sleeping is None else {"sleeping": problem.sleeping}),
    }


def _switching(system: System, laws: Laws, start: State, end: float, breaks: np.ndarray) -> Switching:
    """Switching of a motion, cached for motions over the same time; opaque laws are sampled anew."""
    if system.is_plain and not breaks.size:
        return NO_SWITCHING
    make = lambda: switching(system, laws, start, end, breaks)  # noqa: E731
    if system.dynamics is None or laws.called:
        return make()
    return system.dynamics.on_demand((switching, laws.key, start.t, end, tuple(breaks)), make)


def _start(system: System, state: State | None) -> State:
    """Consistent initial state: that of the scene, cached, or a given one, projected."""
    if system.written:
        refuse_changed(system)
    if state is not None:
        return system.projected(state)
    with judged_later():
        found = cached(system, (_start, system.starts), partial(scene_start, system))
    return State(found.t, found.q.copy(), found.v.copy())  # a law may write to it


def check_breaks(breaks, start: float, duration: float) -> np.ndarray:
    """Times of breaks [s], checked.

    Raises
    ------
    SimulationError
        If they are no finite numbers.
    """
    if isinstance(breaks, tuple) and not breaks:
        return NO_TIMES.switches
    times = start + numbers(breaks, "breaks: expected times [s]").reshape(-1)
    if not np.isfinite(times).all():
        raise SimulationError(f"breaks: expected finite times [s], got {breaks!r}.")
    return np.unique(times[(times > start) & (times <= start + duration)])


def numbers(value, expected: str) -> np.ndarray:
    """Array of numbers, or a SimulationError with what was expected; truth values are none."""
    found = real_numbers(value)
    if found is None or (found.size and np.asarray(value).dtype == bool):
        raise SimulationError(f"{expected}, got {value!r:.200}.")
    return found


def chosen(integrator: str | Integrator) -> Integrator:
    """Integrator of a name; an integrator itself is returned unchanged.

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


def check_arguments(duration, integrator, step, rtol, atol) -> Integrator:
    """Integrator of a simulation.

    Raises
    ------
    SimulationError
        If an argument is invalid.
    """
    method = chosen(integrator)
    check_tolerances(duration=duration, rtol=rtol, atol=atol, **({} if step is None else {"step": step}))
    if isinstance(method, FixedStep) and step is None and not method.nonsmooth:
        raise SimulationError(f"integrator {method.name!r} has a fixed step: give step= [s], for instance step=1e-3.")
    if isinstance(method, FixedStep) and step is None and rtol < LEAST_CONTROLLED_RTOL:
        raise SimulationError(
            f"integrator {method.name!r}: give step= [s], for instance step=1e-3, or, for steps by error control, rtol= of "
            f"{LEAST_CONTROLLED_RTOL:g} or more, for instance rtol=1e-4."
        )
    return method


def refuse_without_step(method: Integrator, step: float | None, what: str):
    """Raise a SimulationError if a method of fixed steps is given none, where steps by error control are not taken."""
    if isinstance(method, FixedStep) and step is None:
        raise SimulationError(
            f"integrator {method.name!r} of {what} has a fixed step: give step= [s], for instance step=1e-3."
        )


def sample_times(times, start: float, duration: float):
    """Times of the samples [s], checked; None for every accepted step."""
    if times is None:
        return None
    samples = start + numbers(times, "times: expected increasing numbers [s]")
    end = start + duration
    increasing = samples.ndim == 1 and samples.size > 0 and bool((samples[1:] > samples[:-1]).all())
    if not (increasing and samples[0] >= start and samples[-1] <= end * (1 + 1e-12)):  # False for NaN, too
        raise SimulationError(f"times: expected increasing times between 0 and the duration {duration} s.")
    return np.minimum(samples, end)


def random_changes(seed, spread: float, shape: tuple[int, ...]) -> np.ndarray:
    """Changes of initial states, uniform up to ``spread``.

    Raises
    ------
    SimulationError
        If the seed or the spread is none.
    """
    if not isinstance(spread, Real) or not 0.0 <= spread < np.inf:
        raise SimulationError(f"spread: expected a number ≥ 0, got {spread!r}.")
    try:
        return np.random.default_rng(seed).uniform(-spread, spread, shape)
    except (TypeError, ValueError) as error:
        raise SimulationError(f"seed: expected a whole number ≥ 0, got {seed!r}.") from error
