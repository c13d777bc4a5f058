"""Many motions of one system at once: all steps in machine code, a vector register of motions at a time."""

from dataclasses import dataclass
from numbers import Integral

import numpy as np

from gauss.errors import SimulationError, StateError, known, require
from gauss.integrators import EXPLICIT_FIXED
from gauss.kernels import Many
from gauss.shapes import Shaped
from gauss.simulation.consistent import ACCEPTED, violations
from gauss.simulation.laws import Laws
from gauss.simulation.loops import many
from gauss.simulation.many import Batch, cores
from gauss.simulation.program import Program
from gauss.simulation.simulate import simulate
from gauss.simulation.traced import TRUST
from gauss.system import LARGE, UNIT_QUATERNION, State, System, is_large

STEPS = {method.name: method for method in EXPLICIT_FIXED}
CONSISTENT = 1e-9  # residual [rad, m, relative to the rates] below which a start meets the constraints


@dataclass(frozen=True)
class Rollout:
    """Motions of a batch.

    Parameters
    ----------
    t : ndarray, shape (k,)
        Times [s].
    q : ndarray, shape (batch, k, n_q)
        Coordinates.
    v : ndarray, shape (batch, k, n_v)
        Rates.
    repeated : tuple of int
        Motions that were made again by :func:`gauss.simulate`, because the compiled steps could not be confirmed.
    """

    t: Shaped[np.ndarray, " k"]
    q: Shaped[np.ndarray, "batch k nq"]
    v: Shaped[np.ndarray, "batch k nv"]
    repeated: tuple[int, ...] = ()


def rollout(
    system: System, q0, v0, *, steps: int, step: float, integrator: str = "rk4", every: int = 1, threads: int | None = 1
) -> Rollout:
    """Simulate many starts at once with a fixed step.

    The accelerations are checked on the way by inverse dynamics, and loops by their gaps. A motion that fails is made again
    by :func:`gauss.simulate`.

    Parameters
    ----------
    system : System
        One that can be compiled: its loads are constants, springs, or laws written with :mod:`gauss.math`.
    q0, v0 : array_like, shape (batch, n_q), (batch, n_v)
        Starts, at t = 0.
    steps : int
        Number of steps.
    step : float
        Their length [s].
    integrator : str
        "rk4" or "semi_implicit_euler".
    every : int
        Keep every so many steps; the start and the steps at these multiples are returned.
    threads : int or None
        Threads that share the motions; None: one for each core. The results do not depend on it.

    Returns
    -------
    Rollout
        All motions.

    Raises
    ------
    SimulationError
        If the system cannot be compiled, with the reasons, or a motion leaves the range of numbers.
    StateError
        If the starts do not fit the system, or do not meet its constraints.
    """
    require(system, (System,), "rollout")
    _check_arguments(integrator, steps, step, every, threads)
    starts = _starts(system, q0, v0)
    laws = Laws(system)
    loop = system.dynamics.on_demand(f"{integrator} of many {laws.key}", lambda: _compiled(system, laws, integrator))
    batch = Batch(loop, starts)
    _check_gaps(system, starts, batch.gap)
    samples = batch.run(steps, step, every, threads or cores())
    if not np.isfinite(batch.reached).all():
        broken = np.flatnonzero(~np.isfinite(batch.reached).all(axis=0))
        raise SimulationError(
            f"{broken.size} of {batch.size} motions diverged, the first is number {broken[0]}; shorten the step."
        )
    q, v = np.split(samples, [system.n_q], axis=2)
    t = step * every * np.arange(samples.shape[1])
    doubtful = np.flatnonzero(~((batch.error <= TRUST) & (batch.gap <= ACCEPTED)))
    for k in doubtful:
        run = {"integrator": integrator, "step": step, "times": t, "progress": False}
        try:
            again = simulate(system, steps * step, state=State(0.0, q[k, 0], v[k, 0]), **run)
        except SimulationError as error:
            raise SimulationError(f"motion {k}: {error}", error.trajectory) from error
        q[k], v[k] = again.q, again.v
    return Rollout(t, q, v, tuple(map(int, doubtful)))


def _check_arguments(integrator, steps, step, every, threads):
    if integrator not in STEPS:
        raise SimulationError(f"no integrator {integrator!r} for many motions. {known(integrator, STEPS)}")
    if not np.isfinite(step) or step <= 0:
        raise SimulationError(f"step: expected a positive number, got {step!r}.")
    counts = {"steps": steps, "every": every} | ({} if threads is None else {"threads": threads})
    for name, value in counts.items():
        if not isinstance(value, Integral) or value <= 0:
            raise SimulationError(f"{name}: expected a positive whole number, got {value!r}.")


def _compiled(system: System, laws: Laws, integrator: str) -> Many:
    """Machine code of the steps.

    Raises
    ------
    SimulationError
        If something in the system cannot be traced.
    """
    against = laws.against_compiling()
    against += [f"more than {LARGE} bodies"] if is_large(system) else []
    if against:
        raise SimulationError(
            f"scene {system.scene.name!r} cannot be compiled: {'; '.join(against)}; use simulate for each motion."
        )
    return many(Program(system, laws), STEPS[integrator])


def _starts(system: System, q0, v0) -> np.ndarray:
    """Starts (n_q + n_v, batch), their quaternions made unit as :meth:`gauss.System.state` does."""
    parts = []
    for name, given, size in (("q0", q0, system.n_q), ("v0", v0, system.n_v)):
        array = np.asarray(given, dtype=float)
        if array.ndim != 2 or array.shape[1] != size or not array.size or not np.isfinite(array).all():
            raise StateError(f"{name}: expected finite numbers of shape (batch, {size}), got shape {array.shape}.")
        parts.append(array.T)
    if parts[0].shape[1] != parts[1].shape[1]:
        raise StateError(f"q0 and v0: expected as many starts of each, got {parts[0].shape[1]} and {parts[1].shape[1]}.")
    starts = np.concatenate(parts)
    for name, place in system.quaternions.items():
        lengths = np.linalg.norm(starts[place], axis=0)
        worst = int(np.argmax(np.abs(lengths - 1.0)))
        if abs(lengths[worst] - 1.0) > UNIT_QUATERNION:
            where = f"q0: the quaternion (w, x, y, z) of joint {name!r} in start number {worst}"
            raise StateError(f"{where} has length {lengths[worst]:.6g}, not 1.")
        starts[place] /= lengths
    return starts


def _check_gaps(system: System, starts: np.ndarray, gap: np.ndarray):
    """Refuse starts that do not meet the constraints."""
    worst = int(np.argmax(gap))
    if not gap[worst] <= CONSISTENT:
        off = violations(system, State(0.0, *np.split(starts[:, worst], [system.n_q])))
        words = "; ".join(f"{name!r} {amount}" for name, amount in list(off.items())[:4])
        where = f"q0 and v0: start number {worst} is off its constraints by {gap[worst]:.3g}: {words}"
        raise StateError(f"{where}. Take starts from system.initial_state(q, v).")
