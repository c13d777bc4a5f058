"""A motion by the method of another library: it sees an ODE y' = f(t, y), y = (q, v, work)."""

import time
from collections.abc import Callable

import numpy as np

from gauss.codegen import Kernel, write
from gauss.dynamics.consistent_states import project
from gauss.dynamics.engines.certified import CertifiedEngine
from gauss.dynamics.engines.compiled import projected
from gauss.dynamics.error_scale import ACCELERATION_TOLERANCE, relative_error
from gauss.dynamics.traced_system import Program
from gauss.errors import SimulationError
from gauss.integrators import Found, Library, Tolerance
from gauss.simulation.prescribed import crossed
from gauss.simulation.trajectory import Event, Stats, Trajectory
from gauss.system import State, System, coordinate_rates


def compiled_rates(program: Program) -> Callable:
    """Machine code of (t, y) → y'."""
    system, n_q, n_v = program.system, program.system.n_q, program.system.n_v

    def rates(t, q, v):
        acceleration, power = np.split(program.rates(t, q, v), [n_v])
        return coordinate_rates(system, q, v), acceleration, power

    kernel = Kernel(write(rates, 1, n_q, n_v, name="library_rates"), batch=False)

    def derivative(t: float, y: np.ndarray) -> np.ndarray:
        return kernel(np.concatenate([[t], _unit(system, y[:n_q]), y[n_q : n_q + n_v]]))

    return derivative


def certified_rates(system: System, solver: CertifiedEngine) -> Callable:
    """(t, y) → y' by certified accelerations."""
    n_q, n_v = system.n_q, system.n_v

    def derivative(t: float, y: np.ndarray) -> np.ndarray:
        state = State(t, _unit(system, y[:n_q]), y[n_q : n_q + n_v])
        return np.concatenate([coordinate_rates(system, state.q, state.v), *solver.rates(system, state)])

    return derivative


def compiled_settling(program: Program) -> Callable:
    """State → state on the constraints, by machine code."""
    kernel = Kernel(program.projected_rates, batch=False) if program.projects else None
    return lambda state: state if kernel is None else projected(program.system, kernel, state)


def library_run(method: Library, system: System, derivative, settle, start: State, end, samples, tolerance, step, switching):
    """Trajectory by the method of a library; ``settle`` brings states to the constraints where they are returned.

    Raises
    ------
    SimulationError
        If it cannot go on, or the accelerations at its end are not those that the certified recursion finds.
    """
    began, n_q, n_v = time.perf_counter(), system.n_q, system.n_v
    times = np.array([start.t, end]) if samples is None else np.union1d([start.t, end], samples)
    y0 = np.concatenate([start.q, start.v, np.zeros(3)])
    coordinates, rates = _allowed(system, tolerance)
    loose = max(coordinates.max(), rates.max()) * 1e3  # the work follows from the motion
    atol = np.concatenate([coordinates, rates, np.full(3, loose)])
    solve = lambda times, y0: method.solve(derivative, times, y0, tolerance.rtol, atol, np.inf if step is None else step)  # noqa: E731
    events: list[Event] = []

    def across(before: float, after: float, y: np.ndarray) -> np.ndarray:
        state = settle(State(before, _unit(system, y[:n_q]), y[n_q : n_q + n_v]))
        jumped = crossed(switching.jumps, state, y[n_q + n_v :], after)
        if jumped is None:
            return y
        events.append(jumped.event)
        return np.concatenate([jumped.state.q, jumped.state.v, jumped.work])

    found = _in_stretches(solve, times, y0, switching.times.stops(start.t, end), across)
    kept = np.ones(len(found.t), bool) if samples is None else np.isin(found.t, samples)
    states = [State(t, _unit(system, y[:n_q]), y[n_q : n_q + n_v]) for t, y in zip(found.t, found.y, strict=True)]
    states = [settle(state) for state, keep in zip(states, kept, strict=True) if keep]
    certified = CertifiedEngine("recursion")
    worst = _error_at(system, derivative, certified, State(found.t[-1], *np.split(found.y[-1, : n_q + n_v], [n_q])))
    stats = Stats(found.evaluations, found.steps, 0, found.factorisations, time.perf_counter() - began, worst, method.title)
    stats = stats._replace(unseen=found.steps or 1) if switching.watch is not None else stats  # libraries do not look
    q, v = (np.array([getattr(state, part) for state in states]).reshape(len(states), -1) for part in "qv")
    whole = Trajectory(system, found.t[kept], q, v, found.y[kept, n_q + n_v :], stats, tuple(events))
    if found.failure is not None:
        raise SimulationError(f"t = {found.t[-1]:.6g} s: {method.name!r} gave up: {found.failure}", whole)
    if not worst <= ACCELERATION_TOLERANCE:
        off = f"compiled accelerations that {method.name!r} used are off by {worst:.1e}; use 'dop853'."
        raise SimulationError(f"t = {end:.6g} s: {off}", whole)
    return whole


def _in_stretches(solve: Callable, times: np.ndarray, y0: np.ndarray, stops, across: Callable) -> Found:
    """What a method finds from each switching time to the next, put together; ``across`` takes it over these times."""
    parts, begin = [], times[0]
    for before, after in stops:
        inside = times[(times > begin) & (times < before)]
        part = solve(np.array([begin, *inside, before]), y0)
        asked = np.isin(part.t, times) | (len(times) == 2)
        between = times[(times >= before) & (times <= after)]  # samples at the switching time itself
        goes_on = after > before and part.failure is None
        begin, y0 = after, across(before, after, part.y[-1]) if goes_on else part.y[-1]
        rows = np.vstack([part.y[asked], *[y0] * between.size])
        parts.append(part._replace(t=np.append(part.t[asked], between), y=rows))
        if part.failure is not None:
            break
    joined = [np.concatenate([getattr(part, name) for part in parts]) for name in "ty"]
    distinct = np.unique(joined[0], return_index=True)[1]
    sums = [sum(getattr(part, name) for part in parts) for name in ("steps", "evaluations", "factorisations")]
    return Found(*(column[distinct] for column in joined), *sums, parts[-1].failure)


def _allowed(system: System, tolerance: Tolerance) -> tuple[np.ndarray, np.ndarray]:
    """Absolute tolerance of each entry of q and of v; of a quaternion the finest of its directions."""
    shares = np.ones((2, system.n_v)) if tolerance.shares is None else tolerance.shares
    coordinates = []
    for joint in system.joints:
        own, k = shares[0, joint.v], joint.pair.quaternion
        coordinates.append(own if k is None else np.concatenate([own[:k], np.full(4, own[k:].min())]))
    return tolerance.atol * np.concatenate([np.zeros(0), *coordinates]), tolerance.atol_rates * shares[1]


def _error_at(system: System, derivative, certified: CertifiedEngine, state: State) -> float:
    """Relative error of the accelerations in a state brought back to the constraints."""
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
