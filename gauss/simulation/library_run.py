"""A motion by an integrator of another library, as an ODE y' = f(t, y), y = (q, v, work)."""

import time
from collections.abc import Callable
from functools import partial

import numpy as np

from gauss.codegen import Kernel, write
from gauss.dynamics.consistent_states import project
from gauss.dynamics.engines.certified import CertifiedEngine
from gauss.dynamics.engines.engine import Engine
from gauss.dynamics.error_scale import ACCELERATION_TOLERANCE, relative_error
from gauss.dynamics.traced_system import Program
from gauss.errors import SimulationError
from gauss.integrators import Library, LibrarySolution, Tolerance
from gauss.simulation.motion_records import Event, Stats
from gauss.simulation.prescribed import crossed
from gauss.simulation.problem import Problem
from gauss.simulation.trajectory import Trajectory
from gauss.simulation.undetected_switching import SPARSE_STEP
from gauss.system import State, System, coordinate_rates


def rates_kernel(program: Program) -> Kernel:
    """Machine code of (t, q, v) → (q̇, q̈, power of the loads)."""
    system, n_q, n_v = program.system, program.system.n_q, program.system.n_v

    def rates(t, q, v):
        return coordinate_rates(system, q, v), *program.evaluate(State(t[0], q, v))

    return Kernel(write(rates, 1, n_q, n_v, name="library_rates"), batch=False)


def projection_kernel(program: Program) -> Kernel:
    """Machine code of the projection onto the constraints."""
    return Kernel(program.projected_rates, batch=False)


def compiled_rates(system: System, kernel: Kernel) -> Callable:
    """(t, y) → y' by machine code."""
    n_q, n_v = system.n_q, system.n_v

    def derivative(t: float, y: np.ndarray) -> np.ndarray:
        return kernel(np.concatenate([[t], _unit(system, y[:n_q]), y[n_q : n_q + n_v]]))

    return derivative


def certified_rates(system: System, engine: Engine) -> Callable:
    """(t, y) → y' by certified accelerations."""
    n_q, n_v = system.n_q, system.n_v

    def derivative(t: float, y: np.ndarray) -> np.ndarray:
        state = State(t, _unit(system, y[:n_q]), y[n_q : n_q + n_v])
        return np.concatenate([coordinate_rates(system, state.q, state.v), *engine.rates(system, state)])

    return derivative


def library_run(problem: Problem, derivative: Callable, project_state: Callable[[State], State]) -> Trajectory:
    """Trajectory by an integrator of another library; the returned states are projected onto the constraints.

    ``derivative``: (t, y) → y'. SimulationError if the library fails, or its accelerations at the end are not those of the
    certified recursion.
    """
    began, system, method, samples = time.perf_counter(), problem.system, problem.method, problem.samples
    start, end, switching, n_q, n_v = problem.start, problem.end, problem.switching, system.n_q, system.n_v
    times = np.array([start.t, end]) if samples is None else np.union1d([start.t, end], samples)
    y0 = np.concatenate([start.q, start.v, np.zeros(3)])
    asked: list[float] = []  # times at which opaque laws of the state are called
    solve = partial(_solve, problem, _noted(derivative, asked) if switching.called else derivative)
    events: list[Event] = []

    def across(before: float, after: float, y: np.ndarray) -> np.ndarray:
        state = project_state(State(before, _unit(system, y[:n_q]), y[n_q : n_q + n_v]))
        jumped = crossed(switching.jumps, state, y[n_q + n_v :], after)
        if jumped is None:
            return y
        events.append(jumped.event)
        return np.concatenate([jumped.state.q, jumped.state.v, jumped.work])

    found = _between_switching_times(solve, times, y0, switching.times.stops(start.t, end), across)
    kept = np.ones(len(found.t), bool) if samples is None else np.isin(found.t, samples)
    states = [
        project_state(State(t, _unit(system, y[:n_q]), y[n_q : n_q + n_v]))
        for t, y in zip(found.t[kept], found.y[kept], strict=True)
    ]
    certified = CertifiedEngine("recursion")
    worst = _error_at(system, derivative, certified, State(found.t[-1], *np.split(found.y[-1, : n_q + n_v], [n_q])))
    stats = Stats(found.evaluations, found.steps, 0, found.factorisations, time.perf_counter() - began, worst, method.title)
    stats = _with_doubts(stats, problem, np.sort([start.t, *asked, end]))
    q, v = (np.reshape([getattr(state, part) for state in states], (len(states), n)) for part, n in (("q", n_q), ("v", n_v)))
    whole = Trajectory(system, found.t[kept], q, v, found.y[kept, n_q + n_v :], stats, tuple(events))
    if found.interruption is not None:
        found.interruption.trajectory = whole  # type: ignore[attr-defined]  # documented: Ctrl-C keeps the motion so far
        raise found.interruption
    if found.failure is not None:
        raise SimulationError(f"t = {found.t[-1]:.6g} s: {method.name!r} gave up: {found.failure}", whole)
    if not worst <= ACCELERATION_TOLERANCE:
        off = f"compiled accelerations that {method.name!r} used are off by {worst:.1e}; use 'dop853'."
        raise SimulationError(f"t = {end:.6g} s: {off}", whole)
    return whole


def _with_doubts(stats: Stats, problem: Problem, asked: np.ndarray) -> Stats:
    """Stats that say where laws of the state may switch undetected: libraries locate no such event.

    ``asked``: times at which opaque laws of the state were called, ascending, from the start to the end [s].
    """
    switching = problem.switching
    if switching.watch is not None:
        stats = stats._replace(unseen=stats.steps or 1)
    sparse = np.diff(asked).max() > SPARSE_STEP * (problem.end - problem.start.t)
    return stats._replace(opaque=", ".join(switching.called)) if sparse else stats


def _noted(derivative: Callable, times: list[float]) -> Callable:
    """Rates whose times are added to a list."""

    def rates(t: float, y: np.ndarray) -> np.ndarray:
        times.append(float(t))
        return derivative(t, y)

    return rates


def _solve(problem: Problem, derivative: Callable, times: np.ndarray, y0: np.ndarray) -> LibrarySolution:
    """Solution of the library at some times, the last of which is the end."""
    coordinates, rates = _absolute_tolerances(problem.system, problem.tolerance)
    loose = max(coordinates.max(), rates.max()) * 1e3  # quadratures of work follow from the motion
    atol = np.concatenate([coordinates, rates, np.full(3, loose)])
    largest = np.inf if problem.step is None else problem.step
    assert isinstance(problem.method, Library)
    return problem.method.solve(derivative, times, y0, problem.tolerance.rtol, atol, largest)


def _between_switching_times(solve: Callable, times: np.ndarray, y0: np.ndarray, stops, across: Callable) -> LibrarySolution:
    """Solution joined from those between switching times; ``across`` continues y over such a time."""
    parts, begin = [], times[0]
    for before, after in stops:
        inside = times[(times > begin) & (times < before)]
        part = solve(np.array([begin, *inside, before]), y0)
        asked = np.isin(part.t, times) | (len(times) == 2)
        complete = part.failure is None and part.interruption is None
        between = times[(times >= before) & (times <= after) & complete]  # samples at the switching time itself
        goes_on = after > before and complete
        begin, y0 = after, across(before, after, part.y[-1]) if goes_on else part.y[-1]
        rows = np.vstack([part.y[asked], *[y0] * between.size])
        parts.append(part._replace(t=np.append(part.t[asked], between), y=rows))
        if not complete:
            break
    t, y = (np.concatenate([getattr(part, name) for part in parts]) for name in "ty")
    distinct = np.unique(t, return_index=True)[1]
    steps, evaluations, factorisations = (
        sum(getattr(part, name) for part in parts) for name in ("steps", "evaluations", "factorisations")
    )
    return LibrarySolution(t[distinct], y[distinct], steps, evaluations, factorisations, *parts[-1][-2:])


def _absolute_tolerances(system: System, tolerance: Tolerance) -> tuple[np.ndarray, np.ndarray]:
    """Absolute tolerance of each entry of q and of v; of a quaternion the least of its directions."""
    shares = np.ones((2, system.n_v)) if tolerance.shares is None else tolerance.shares
    coordinates = []
    for joint in system.joints:
        own, k = shares[0, joint.v], joint.pair.quaternion
        coordinates.append(own if k is None else np.concatenate([own[:k], np.full(4, own[k:].min())]))
    return tolerance.atol * np.concatenate([np.zeros(0), *coordinates]), tolerance.atol_rates * shares[1]


def _error_at(system: System, derivative, certified: CertifiedEngine, state: State) -> float:
    """Relative error of the accelerations in a state, projected onto the constraints."""
    state = project(system, State(state.t, _unit(system, state.q), state.v))
    exact = certified.rates(system, state).acceleration
    used = derivative(state.t, np.concatenate([state.q, state.v, np.zeros(3)]))[system.n_q : system.n_q + system.n_v]
    return float(relative_error(system, used, exact, state.v))


def _unit(system: System, q: np.ndarray) -> np.ndarray:
    """Coordinates whose quaternions have length 1."""
    if system.is_flat:
        return q
    q = q.copy()
    for place in system.quaternions.values():
        q[place] /= np.linalg.norm(q[place])
    return q
