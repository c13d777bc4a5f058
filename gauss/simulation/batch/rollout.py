"""Many motions of one system at once: all steps in machine code, a vector register of motions at a time."""

from collections.abc import Hashable
from dataclasses import dataclass
from numbers import Integral

import numpy as np

from gauss.dynamics.consistent_states import RESIDUAL_TOLERANCE
from gauss.dynamics.error_scale import ACCELERATION_TOLERANCE
from gauss.dynamics.laws.switching_functions import Switching, switching
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.plan import BATCHES, method_key
from gauss.dynamics.rules import Question
from gauss.dynamics.traced_system import Program
from gauss.errors import SimulationError, did_you_mean, require
from gauss.integrators import EXPLICIT, EXPLICIT_FIXED, Integrator
from gauss.shapes import Shaped
from gauss.simulation.batch.adaptive_batch import AdaptiveBatch, Streaming
from gauss.simulation.batch.fixed_step_batch import Batch, cores
from gauss.simulation.batch.initial_states import check_gaps, columns
from gauss.simulation.compiled_steps.explicit_stages import memory
from gauss.simulation.compiled_steps.loop_functions import many
from gauss.simulation.energy_balance import imbalances, shares, warn_of_many
from gauss.simulation.simulate import sample_times, simulate
from gauss.simulation.tolerances import check_tolerances, tolerance
from gauss.simulation.undetected_switching import warn_of_passages, warn_of_times
from gauss.system import State, System, refuse_changed

STEPS = {method.name: method for method in EXPLICIT_FIXED}
OWN_STEPS = {method.name: method for method in EXPLICIT}


@dataclass(frozen=True)
class Rollout:
    """Motions of a batch.

    Parameters
    ----------
    system : System
        What moved.
    t : ndarray, shape (k,)
        Times [s].
    q : ndarray, shape (batch, k, n_q)
        Coordinates.
    v : ndarray, shape (batch, k, n_v)
        Rates.
    repeated : tuple of int
        Motions that were made again by :func:`gauss.simulate`, because the compiled steps could not be confirmed, or
        because prescribed speeds jump.
    steps, rejected : ndarray, shape (batch,)
        Steps of each motion that were accepted, and that were tried again with a shorter one.
    """

    system: System
    t: Shaped[np.ndarray, " k"]
    q: Shaped[np.ndarray, "batch k nq"]
    v: Shaped[np.ndarray, "batch k nv"]
    repeated: tuple[int, ...]
    steps: Shaped[np.ndarray, " batch"]
    rejected: Shaped[np.ndarray, " batch"]


def rollout(
    system: System,
    q0,
    v0,
    *,
    integrator: str = "rk4",
    steps: int | None = None,
    step: float | None = None,
    every: int | None = None,
    times=None,
    rtol: float = 1e-12,
    atol: float | tuple[float, float] | dict | None = None,
    threads: int | None = 1,
) -> Rollout:
    """Simulate many starts at once.

    With "rk4" and "semi_implicit_euler" all motions make ``steps`` steps of one length; with "dop853" and "dopri5" each has
    steps of its own, chosen by ``rtol`` and ``atol``, and samples at the same ``times`` by dense output. The
    accelerations are checked on the way by inverse dynamics, and loops by their gaps. A motion that fails is made again
    by :func:`gauss.simulate`.

    Parameters
    ----------
    system : System
        One that can be compiled: its loads are constants, springs, or laws written with :mod:`gauss.math`.
    q0, v0 : array_like, shape (batch, n_q), (batch, n_v)
        Starts, at t = 0.
    integrator : str
        "rk4", "semi_implicit_euler", "dop853" or "dopri5".
    steps : int
        Number of steps of one length.
    step : float
        Their length [s]; of steps that are chosen the largest, if given.
    every : int
        Keep every so many steps of one length; the start and the steps at these multiples are returned. 1 when not given.
    times : array_like
        Samples of motions that choose their steps [s], counted from the start; the last is the end.
    rtol, atol : float
        Local error of steps that are chosen; see :func:`gauss.simulate`.
    threads : int or None
        Threads that share the motions; None: one for each core. The results do not depend on it.

    Returns
    -------
    Rollout
        All motions.

    Warns
    -----
    BalanceWarning
        If the energy balance of some is off by more than a thousandth of their largest energy; it names the worst of them.

    Raises
    ------
    SimulationError
        If the system cannot be compiled, with the reasons, or a motion leaves the range of numbers.
    StateError
        If the starts do not fit the system, or do not meet its constraints.
    """
    require(system, (System,), "rollout")
    refuse_changed(system)
    _check_counts({"threads": threads})
    if integrator in OWN_STEPS:
        _refuse(integrator, "chooses its steps: give times= [s], and rtol and atol", steps=steps, every=every)
        return _streamed(system, q0, v0, OWN_STEPS[integrator], times, step, rtol, atol, threads or cores())
    if integrator not in STEPS:
        raise SimulationError(
            f"no integrator {integrator!r} for many motions. {did_you_mean(integrator, STEPS | OWN_STEPS)}"
        )
    _refuse(integrator, "has a fixed step: give steps=, step= [s] and every=", times=times)
    return _stepped(system, q0, v0, STEPS[integrator], steps, step, 1 if every is None else every, threads or cores())


def _stepped(system: System, q0, v0, method: Integrator, steps: int, step: float, every: int, threads: int) -> Rollout:
    """Motions with steps of one length."""
    if step is None or not np.isfinite(step) or step <= 0:
        raise SimulationError(f"step: expected a positive number, got {step!r}.")
    if steps is None:
        raise SimulationError("steps: expected a positive whole number, got None.")
    _check_counts({"steps": steps, "every": every})
    starts = columns(system, q0, v0)
    if not system.n_v:
        return _still(system, starts, step * every * np.arange(steps // every + 1), steps)
    batch = Batch(_compiled(system, method_key(method), lambda laws: many(Program(system, laws), method)), starts)
    check_gaps(system, starts, batch.gap)
    times = _heeded(system, starts, steps * step).times
    if times.switches.size:  # steps of all motions at once cannot be divided there
        return _one_by_one(system, starts, step * every * np.arange(steps // every + 1), steps * step, method, step)
    samples = batch.run(steps, step, every, threads)
    if not np.isfinite(batch.reached).all():
        broken = np.flatnonzero(~np.isfinite(batch.reached).all(axis=0))
        raise SimulationError(
            f"{broken.size} of {batch.size} motions diverged, the first is number {broken[0]}; shorten the step."
        )
    t = step * every * np.arange(samples.shape[1])
    doubtful = np.flatnonzero(~((batch.error <= ACCELERATION_TOLERANCE) & (batch.gap <= RESIDUAL_TOLERANCE)))
    warn_of_passages(system, batch.unseen + times.unresolved(0.0, steps * step, step), method.name)
    share = shares(system, batch.looked, starts, samples, steps * step)
    _repeat(system, starts, samples, share, doubtful, steps * step, integrator=method.name, step=step, times=t)
    counts = np.full(batch.size, steps), np.zeros(batch.size, int)
    return Rollout(system, t, *np.split(samples, [system.n_q], axis=2), tuple(map(int, doubtful)), *counts)


def _streamed(system: System, q0, v0, method: Integrator, times, step, rtol, atol, threads: int) -> Rollout:
    """Motions with steps of their own."""
    if times is None:
        raise SimulationError(f"integrator {method.name!r} chooses its steps: give times= [s] of the samples.")
    check_tolerances(rtol=rtol, atol=atol, **({} if step is None else {"step": step}))
    t = np.asarray(times, dtype=float)
    t = sample_times(t, 0.0, t.ravel()[-1] if t.size else 0.0)
    if t[-1] <= 0.0:
        raise SimulationError("times: expected the last one to be after the start, 0 s.")
    starts = columns(system, q0, v0)
    if not system.n_v:
        return _still(system, starts, t, 0)
    allowed = tolerance(system, rtol, atol)
    make = lambda laws: Streaming(Program(system, laws, memory=memory(system)), method, allowed.shares)  # noqa: E731
    batch = AdaptiveBatch(_compiled(system, (method_key(method), allowed.key), make), starts, allowed)
    check_gaps(system, starts, batch.gap)
    heeded = _heeded(system, starts, t[-1])
    found = batch.run(t, step, threads, heeded.times)
    doubtful = np.flatnonzero(~(found.error <= ACCELERATION_TOLERANCE) | bool(heeded.jumps))  # an impact stops a motion
    run = {"integrator": method.name, "step": step, "rtol": rtol, "atol": atol, "times": t}
    share = shares(system, found.looked, starts, found.samples, t[-1])
    _repeat(system, starts, found.samples, share, doubtful, t[-1], **run)
    q, v = np.split(found.samples, [system.n_q], axis=2)
    return Rollout(system, t, q, v, tuple(map(int, doubtful)), found.steps, found.rejected)


def _heeded(system: System, starts: np.ndarray, end: float) -> Switching:
    """When laws of time switch, and prescribed speeds jump.

    Raises
    ------
    SimulationError
        If a prescribed position jumps.
    """
    heeded = switching(system, Laws(system), State(0.0, *np.split(starts[:, 0], [system.n_q])), end)
    warn_of_times(system, heeded.times)
    return heeded


def _one_by_one(
    system: System, starts: np.ndarray, t: np.ndarray, duration: float, method: Integrator, step: float
) -> Rollout:
    """Motions made by simulate."""
    batch = starts.shape[1]
    samples, share = np.empty((batch, t.size, starts.shape[0])), np.zeros(batch)
    _repeat(system, starts, samples, share, np.arange(batch), duration, integrator=method.name, step=step, times=t)
    counts = np.full(batch, round(duration / step)), np.zeros(batch, int)
    return Rollout(system, t, *np.split(samples, [system.n_q], axis=2), tuple(range(batch)), *counts)


def _still(system: System, starts: np.ndarray, t: np.ndarray, steps: int) -> Rollout:
    """Motions of a system without degrees of freedom."""
    batch = starts.shape[1]
    nothing = np.zeros((batch, t.size, 0))
    return Rollout(system, t, nothing, nothing, (), np.full(batch, steps), np.zeros(batch, int))


def _repeat(system: System, starts, samples: np.ndarray, share: np.ndarray, doubtful: np.ndarray, duration: float, **run):
    """Make motions again by simulate, and tell of all whose energy balance is off; samples and its shares are changed.

    Warns
    -----
    BalanceWarning
        If there are any.

    Raises
    ------
    SimulationError
        If one cannot go on.
    """
    for k in doubtful:
        start = State(0.0, *np.split(starts[:, k], [system.n_q]))
        try:
            with imbalances() as found:
                again = simulate(system, duration, state=start, progress=False, **run)
        except SimulationError as error:
            raise SimulationError(f"motion {k}: {error}", error.trajectory) from error
        samples[k], share[k] = np.concatenate([again.q, again.v], axis=1), found[-1].share
    warn_of_many(system, share, lambda k: f"number {k}", run)


def _refuse(integrator: str, why: str, **given):
    """Refuse settings that a method has no use for."""
    for name, value in given.items():
        if value is not None:
            raise SimulationError(f"{name}: integrator {integrator!r} {why}.")


def _check_counts(counts: dict):
    for name, value in counts.items():
        if name == "threads" and value is None:
            continue
        if not isinstance(value, Integral) or value <= 0:
            raise SimulationError(f"{name}: expected a positive whole number, got {value!r}.")


def _compiled(system: System, kind: Hashable, make):
    """Machine code of the steps, made from the laws of the loads.

    Raises
    ------
    SimulationError
        If something in the system cannot be traced.
    """
    laws = Laws(system)
    BATCHES.plan(Question(system, laws))
    return system.dynamics.on_demand((_compiled, kind, laws.key), lambda: make(laws))
