"""Many motions of one system at once: the whole step is traced and compiled, a vector register of motions at a time."""

from dataclasses import dataclass

import numpy as np

from gauss.errors import SimulationError, StateError, known
from gauss.integrators import FIXED, Point
from gauss.shapes import Shaped
from gauss.simulation.laws import Laws
from gauss.simulation.program import Program
from gauss.system import LARGE, State, System, is_large
from gauss.tracing import Kernel, trace

CONSISTENT = 1e-9  # residual [rad, m, rad/s, m/s] below which a start meets what is not stepped


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
    """

    t: Shaped[np.ndarray, " k"]
    q: Shaped[np.ndarray, "batch k nq"]
    v: Shaped[np.ndarray, "batch k nv"]


def rollout(system: System, q0, v0, *, steps: int, step: float, integrator: str = "rk4", every: int = 1) -> Rollout:
    """Simulate many starts at once with a fixed step.

    Parameters
    ----------
    system : System
        One that can be compiled: its loads are constants, springs, or laws written with :mod:`gauss.math`.
    q0, v0 : array_like, shape (batch, n_q), (batch, n_v)
        Starts.
    steps : int
        Number of steps.
    step : float
        Their length [s].
    integrator : str
        "rk4" or "semi_implicit_euler".
    every : int
        Keep every so many steps; the start and the steps at these multiples are returned.

    Returns
    -------
    Rollout
        All motions.

    Raises
    ------
    SimulationError
        If the system cannot be compiled, with the reasons, or a motion leaves the range of numbers.
    StateError
        If the starts do not fit the system.
    """
    if integrator not in FIXED:
        raise SimulationError(f"no integrator {integrator!r} for many motions. {known(integrator, FIXED)}")
    for name, value in (("steps", steps), ("step", step), ("every", every)):
        if not value > 0:
            raise SimulationError(f"{name}: expected a positive number, got {value!r}.")
    columns = _columns(system, q0, v0)
    _check_reduced(system, *np.split(columns, [system.n_q]))
    laws = Laws(system)
    kernel = system.dynamics.on_demand(f"{integrator} of many {laws.key}", lambda: step_kernel(system, laws, integrator))
    clock = np.empty((2, columns.shape[1]))
    kept = [columns]
    for count in range(1, steps + 1):
        clock[0], clock[1] = (count - 1) * step, step
        columns = kernel(np.concatenate([clock, columns]))
        if count % every == 0:
            kept.append(columns)
    if not np.isfinite(columns).all():
        broken = np.flatnonzero(~np.isfinite(columns).all(axis=0))
        raise SimulationError(
            f"{broken.size} of {columns.shape[1]} motions diverged, the first is number {broken[0]}; shorten the step."
        )
    samples = np.array(kept).transpose(2, 0, 1)
    return Rollout(step * every * np.arange(len(kept)), samples[:, :, : system.n_q], samples[:, :, system.n_q :])


def step_kernel(system: System, laws: Laws, integrator: str) -> Kernel:
    """Machine code of one step: (t, h, q, q̇) → (q, q̇) after the step, on the constraints.

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
    program = Program(system, laws)

    def advance(clock, q, v):
        state = State(clock[0], q, v)
        start = Point(state, np.zeros(3), program.evaluate(state))
        reached = FIXED[integrator](system, program.evaluate, start, clock[1]).state
        reached = program.on_constraints(reached)[0] if system.closes else reached
        return reached.q, reached.v

    return trace(advance, 2, system.n_q, system.n_v)


def _columns(system: System, q0, v0) -> np.ndarray:
    """Starts as columns of a structure of arrays."""
    parts = []
    for name, given, size in (("q0", q0, system.n_q), ("v0", v0, system.n_v)):
        array = np.asarray(given, dtype=float)
        if array.ndim != 2 or array.shape[1] != size or not np.isfinite(array).all():
            raise StateError(f"{name}: expected finite numbers of shape (batch, {size}), got shape {array.shape}.")
        parts.append(array.T)
    if parts[0].shape[1] != parts[1].shape[1]:
        raise StateError(f"q0 and v0: expected as many starts of each, got {parts[0].shape[1]} and {parts[1].shape[1]}.")
    return np.concatenate(parts)


def _check_reduced(system: System, q: np.ndarray, v: np.ndarray):
    """Refuse starts (n_q, batch), (n_v, batch) that contradict what is not stepped: locked and tied coordinates."""
    for part in system.parts:
        for name, place in part.held.items():
            joint = system.joint(name)
            off = np.abs(np.concatenate([q[joint.q] - np.array(place)[:, None], v[joint.v]])).max(axis=0)
            _refuse(off, f"joint {name!r} is held at {list(place)} and does not move")
    for coupling in system.scene.couplings.values():
        driven, driver = system.joint(coupling.driven), system.joint(coupling.driver)
        off_q = q[driven.q] - coupling.ratio * q[driver.q] - coupling.offset
        off_v = v[driven.v] - coupling.ratio * v[driver.v]
        _refuse(np.abs(np.concatenate([off_q, off_v])).max(axis=0), f"coupling {coupling.name!r} is not met")


def _refuse(off: np.ndarray, what: str):
    worst = int(np.argmax(off))
    if off[worst] > CONSISTENT:
        where = f"q0 and v0: in start number {worst} {what}, off by {off[worst]:.3g}."
        raise StateError(f"{where} Take starts from system.initial_state(q, v).")
