"""Batch of motions of one system: all steps in machine code, in the lanes of vector registers."""

from collections.abc import Sequence
from functools import partial
from numbers import Integral

import numpy as np

from gauss.arguments import named_arguments, real_numbers
from gauss.codegen import one_tier
from gauss.codegen.gpu.devices import double_precision
from gauss.codegen.tiers import AUTO, OPTIMISED
from gauss.dynamics.consistent_states import RESIDUAL_TOLERANCE
from gauss.dynamics.contact.moreau_step import moreau_stepper
from gauss.dynamics.contact.overlaps import left_by_steps
from gauss.dynamics.error_scale import ACCELERATION_TOLERANCE
from gauss.dynamics.initial_states import constraint_residual
from gauss.dynamics.laws.switching import Switching, switching
from gauss.dynamics.laws.traced_laws import Laws
from gauss.errors import SimulationError, did_you_mean, require
from gauss.integrators import EXPLICIT, ExplicitPair, FixedStep
from gauss.interruption import interruption_keeps
from gauss.simulation.arguments import numbers, sample_times
from gauss.simulation.batch.adaptive_batch import AdaptiveBatch, AdaptiveBatchCode
from gauss.simulation.batch.batch_result import Rollout, kept_on_interruption
from gauss.simulation.batch.fixed_step_batch import DeviceFixedStepBatch, FixedStepBatch, cores
from gauss.simulation.batch.initial_states import columns, refuse_inconsistent
from gauss.simulation.batch.machine_code import STEPPED, batch_program, fixed_step_code, machine_code, one_by_one
from gauss.simulation.batch.repeated_motions import repeat, tell_of_divergence
from gauss.simulation.energy_balance import shares
from gauss.simulation.memory_limit import refuse_beyond_memory
from gauss.simulation.moreau.unseen_contacts import warn_of_unseen_contacts_of_many
from gauss.simulation.tolerances import check_tolerances, checked_count, tolerance
from gauss.simulation.undetected_switching import warn_of_passages, warn_of_times
from gauss.system import State, System, refuse_changed

ADAPTIVE = {method.name: method for method in EXPLICIT}
LARGE_BATCH = 1_000_000  # steps of all motions that take about as long as optimising the code of a robot arm
RTOL = 1e-12  # when not given
ADAPTIVE_STEPS = 100  # number of steps that an adaptive motion is taken to make


@named_arguments
@interruption_keeps("rollout")
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
    rtol: float = RTOL,
    atol: float | tuple[float, float] | dict | None = None,
    threads: int | None = 1,
    control=None,
    device: str | Sequence[str] | None = None,
) -> Rollout:
    """Simulate a batch of initial states.

    With "rk4", "semi_implicit_euler" and "time_stepping" all motions make ``steps`` steps of one length; with "dop853" and
    "dopri5" each has step-size control of its own, by ``rtol`` and ``atol``, and samples at the same ``times`` by dense
    output. Contacts, stops and friction take "time_stepping", whose motions follow one another in scalar code; with many
    contacts of shapes, or with opaque laws, each of them is made by :func:`gauss.simulate`. The
    accelerations are checked on the way by inverse dynamics, and loops by their constraint residuals. A motion that fails a
    check, or with a contact problem that machine code does not solve, is repeated by :func:`gauss.simulate`. Motions that
    diverge, or cannot continue, are marked in the result, with the reasons; the others are not affected.

    Parameters
    ----------
    system : System
        System that can be compiled; loads that are constants, springs, or laws written with :mod:`gauss.math` are fast.
    q0, v0 : array_like, shape (batch, n_q), (batch, n_v)
        Initial states, at t = 0.
    integrator : str
        "rk4", "semi_implicit_euler", "time_stepping", "dop853" or "dopri5".
    steps : int
        Number of fixed steps.
    step : float
        Fixed step, or largest adaptive step [s].
    every : int
        Number of fixed steps from one sample to the next; 1 by default. The first sample is the start.
    times : array_like
        Samples of adaptive methods [s], counted from the start; the last one is the end.
    rtol, atol : float
        Local error of adaptive steps; see :func:`gauss.simulate`.
    threads : int or None
        Number of threads; None: one for each core. The results do not depend on it.
    control : array_like, shape (batch, k, n_u), optional
        Values of the inputs of the scene [N m, N] for each motion, with fixed steps: k rows, each held for ``steps`` / k
        steps and cut off at the limits of the inputs. They are zero when not given.
    device : str or sequence of str, optional
        "cuda" or "cuda:1": a GPU, one motion in a thread, needs cuda-bindings and a driver of NVIDIA; several share the
        motions, ["cuda:0", "cuda:1"]. "lanes": the same code on this CPU, one motion after the other, to check what a GPU
        computes. This CPU, in SIMD lanes, by default.

    Returns
    -------
    Rollout
        All motions; ``trajectory(k)`` is one of them, ``output(name)`` the values of an output of the scene.

    Warns
    -----
    BalanceWarning
        If the residual of the energy balance of some exceeds a thousandth of their largest energy; it names the worst of
        them.
    ContactLawWarning
        If shapes move by more than they are thick within a step: they may pass through each other unseen.
    DivergenceWarning
        If some motions without ``control`` do not reach the end.

    Raises
    ------
    SimulationError
        If the system cannot be compiled, with the reasons, or no motion without ``control`` reaches the end.
    DeviceError, MissingPackageError
        If there is no such device, no driver or no cuda-bindings, or a function has no code for a GPU.
    StateError
        If the initial states have wrong shapes, or violate the constraints.
    KeyboardInterrupt
        On Ctrl-C; its ``rollout`` holds what was computed so far, with NaN behind it, or is None.
    """
    require(system, (System,), "rollout")
    refuse_changed(system)
    if threads is not None:
        checked_count("threads", threads)
    device = None if device is None else double_precision(device)
    integrator = str(integrator)  # what is no name is none of a method
    if integrator in ADAPTIVE:
        _refuse(integrator, "chooses its steps: give times= [s], and rtol and atol", steps=steps, every=every)
        _refuse(integrator, "takes no control=: its steps are not those of the samples; use 'rk4'", control=control)
        with one_tier(_tier(q0, ADAPTIVE_STEPS)):
            return _adaptive(system, q0, v0, ADAPTIVE[integrator], times, step, rtol, atol, threads or cores(), device)
    if integrator not in STEPPED:
        raise SimulationError(
            f"no integrator {integrator!r} for many motions. {did_you_mean(integrator, STEPPED | ADAPTIVE)}"
        )
    given = {"times": times, "rtol": None if rtol == RTOL else rtol, "atol": atol}
    _refuse(integrator, "has a fixed step: give steps=, step= [s] and every=", **given)
    with one_tier(_tier(q0, steps)):
        keep = 1 if every is None else every
        return _fixed(system, q0, v0, STEPPED[integrator], steps, step, keep, threads or cores(), control, device)


def _tier(q0, steps) -> str:
    """Tier of the code of a batch: large ones wait for optimised code. The arguments are not checked yet."""
    motions = len(q0) if hasattr(q0, "__len__") else 1
    return OPTIMISED if isinstance(steps, Integral) and motions * int(steps) > LARGE_BATCH else AUTO


def _fixed(
    system: System,
    q0,
    v0,
    method: FixedStep,
    steps: int | None,
    step: float | None,
    every: int,
    threads: int,
    control,
    device: str | None,
) -> Rollout:
    """Batch with fixed steps."""
    steps, step = _checked_steps(steps, step, every)
    starts = columns(system, q0, v0)
    _refuse_beyond_memory(system, starts, steps // every + 1, "give fewer motions or steps, or a larger every=")
    t = step * every * np.arange(steps // every + 1)
    control = None if control is None else _checked_control(system, control, starts.shape[1], steps)
    if not system.n_v:
        return _constant(system, starts, t, steps)
    run = {"integrator": method.name, "step": step, "times": t}
    settings = run | {"duration": steps * step, "steps": steps, "every": every, "evaluations": method.evaluations}
    if device is None and one_by_one(system, method, control is not None):
        return _singly(system, starts, run, settings, control)
    batch = _begun(system, starts, method, step, control is not None, device)
    times = _switching(system, starts, steps * step).times
    if times.switches.size:  # steps of a batch cannot end there
        return _singly(system, starts, run, settings, control)
    keep = partial(_result, system, t, control=control, settings=settings)
    with kept_on_interruption(keep):
        samples = batch.run(steps, step, every, threads, control)
    finite, solved = np.isfinite(batch.reached).all(axis=0), batch.unsolved <= 0.0
    is_right = (batch.error <= ACCELERATION_TOLERANCE) & (batch.residual <= RESIDUAL_TOLERANCE)
    doubtful = np.flatnonzero((finite & ~is_right) | ~solved)
    warn_of_passages(system, batch.unseen + times.unresolved(0.0, steps * step, step), method.name)
    with np.errstate(invalid="ignore"):
        share = shares(system, batch.energies, starts, samples, steps * step)
    share = np.where(finite & solved, share, 0.0)
    with kept_on_interruption(keep):
        failed, again = repeat(system, starts, samples, share, doubtful, steps * step, run, control)
    reasons = failed | _left_all_bounds(samples, t, np.flatnonzero(solved & ~finite))
    if method.nonsmooth:
        warn_of_unseen_contacts_of_many(system, t, samples, step)
    if control is None:
        tell_of_divergence(system, batch.size, reasons, again)
    counts = {"steps": np.full(batch.size, steps), "rejected": np.zeros(batch.size, int)}
    marks = _marks(doubtful, reasons, again) | {"errors": batch.error.copy()}
    return _result(system, t, samples, control=control, settings=settings, **counts, **marks)


def _checked_steps(steps: int | None, step: float | None, every: int) -> tuple[int, float]:
    """Number and length [s] of fixed steps."""
    check_tolerances(step=step)
    assert step is not None  # it is a positive number
    steps = checked_count("steps", steps)
    checked_count("every", every)
    return steps, step


def _refuse_beyond_memory(system: System, starts: np.ndarray, samples: int, remedy: str):
    """Refuse a batch whose samples, with times and work, do not fit into memory."""
    numbers = (starts.shape[1] * (len(starts) + 3) + 2) * samples
    refuse_beyond_memory(numbers, f"{samples:.3g} samples of {starts.shape[1]} motions of {system.scene.name!r}", remedy)


def _begun(system: System, starts: np.ndarray, method: FixedStep, step: float, held: bool, device: str | None):
    """Batch at its initial states, which meet the constraints and do not penetrate."""
    kind = FixedStepBatch if device is None else DeviceFixedStepBatch
    batch = kind(fixed_step_code(system, method, held, device), starts)
    refuse_inconsistent(system, starts, batch.residual)
    if method.nonsmooth:
        for q, v in (np.split(start, [system.n_q]) for start in starts.T):
            moreau_stepper(system).refuse_penetration(State(0.0, q, v), left_by_steps(system, v, step))
    return batch


def _left_all_bounds(samples: np.ndarray, t: np.ndarray, which: np.ndarray) -> dict[int, str]:
    """Reasons of motions whose numbers are not finite at the end."""
    finite = np.isfinite(samples[which]).all(axis=2)
    last = np.where(finite.all(axis=1), len(t), np.argmin(finite, axis=1)) - 1  # the start is finite
    return {int(k): f"diverged after t = {t[row]:.6g} s; shorten the step." for k, row in zip(which, last, strict=True)}


def _marks(doubtful, reasons: dict[int, str], again: dict) -> dict:
    """Fields of a rollout that say what became of its motions."""
    repeated, diverged = tuple(map(int, doubtful)), tuple(sorted(reasons))
    return {"repeated": repeated, "diverged": diverged, "reasons": reasons, "again": again}


def _result(system: System, t: np.ndarray, samples: np.ndarray, **fields) -> Rollout:
    """Rollout of samples (batch, k, n_q + n_v), behind which may be work (3,)."""
    q, v, work = np.split(samples, [system.n_q, system.n_q + system.n_v], axis=2)
    fields |= {"work": work} if work.size else {}
    return Rollout(system=system, t=t, q=q, v=v, **fields)


def _checked_control(system: System, control, batch: int, steps: int) -> np.ndarray:
    """Inputs (batch, k, n_u) of all motions.

    SimulationError if the scene has no inputs, the shape is wrong, or a value is not finite.
    """
    names = tuple(system.scene.inputs)
    if not names:
        raise SimulationError(f"control: scene {system.scene.name!r} has no inputs; declare some with scene.input.")
    found = control if isinstance(control, np.ndarray) and control.dtype == float else real_numbers(control)
    if found is None:
        what = f"numbers of shape ({batch} motions, k rows, {len(names)} inputs)"
        raise SimulationError(f"control: expected {what}, got {control!r}; simulate(control=) takes laws.")
    found = np.require(found, requirements=("C", "W"))
    if found.ndim != 3 or found.shape[::2] != (batch, len(names)) or not found.shape[1] or steps % found.shape[1]:
        raise SimulationError(
            f"control: expected shape ({batch} motions, k rows, {len(names)} inputs) with k a divisor of {steps} steps, "
            f"got {found.shape}."
        )
    if not np.isfinite(found).all():
        motion, row, k = np.argwhere(~np.isfinite(found))[0]
        raise SimulationError(f"control: input {names[k]!r} of motion {motion} is {found[motion, row, k]} in row {row}.")
    return found


def _adaptive(
    system: System, q0, v0, method: ExplicitPair, times, step, rtol, atol, threads: int, device: str | None
) -> Rollout:
    """Batch with adaptive steps."""
    if times is None:
        raise SimulationError(f"integrator {method.name!r} chooses its steps: give times= [s] of the samples.")
    check_tolerances(rtol=rtol, atol=atol, **({} if step is None else {"step": step}))
    t = numbers(times, "times: expected increasing numbers [s]")
    t = sample_times(t, 0.0, t.ravel()[-1] if t.size else 0.0)
    if t[-1] <= 0.0:
        raise SimulationError("times: expected the last one to be after the start, 0 s.")
    starts = columns(system, q0, v0)
    _refuse_beyond_memory(system, starts, t.size, "give fewer motions or times")
    if not system.n_v:
        return _constant(system, starts, t, 0)
    run = {"integrator": method.name, "step": step, "rtol": rtol, "atol": atol, "times": t}
    settings = run | {"duration": t[-1], "evaluations": method.evaluations}
    if device is None and one_by_one(system, method, False):
        return _singly(system, starts, run, settings)
    allowed = tolerance(system, rtol, atol)
    make = lambda laws: AdaptiveBatchCode(  # noqa: E731
        batch_program(system, laws, method)(system, laws, memory=method.state_size(system)), method, allowed.shares, device
    )
    batch = AdaptiveBatch(machine_code(system, method, (allowed.key, device), make), starts, allowed)
    refuse_inconsistent(system, starts, batch.residual)
    switched = _switching(system, starts, t[-1])
    keep = partial(_result, system, t, settings=settings)
    with kept_on_interruption(keep):
        found = batch.run(t, step, threads, switched.times)
    doubtful = np.flatnonzero(~(found.error <= ACCELERATION_TOLERANCE) | bool(switched.jumps))
    with np.errstate(invalid="ignore"):  # of motions that are repeated
        share = shares(system, found.energies, starts, found.samples[:, :, : len(starts)], t[-1])
    with kept_on_interruption(partial(keep, work=found.samples[:, :, len(starts) :])):
        failed, again = repeat(system, starts, found.samples[:, :, : len(starts)], share, doubtful, t[-1], run)
    found.samples[list(failed), :, len(starts) :] = np.nan
    tell_of_divergence(system, starts.shape[1], failed, again)
    counts = {"steps": found.steps, "rejected": found.rejected}
    marks = _marks(doubtful, failed, again) | {"errors": found.error}
    return _result(system, t, found.samples, settings=settings, **counts, **marks)


def _switching(system: System, starts: np.ndarray, end: float) -> Switching:
    """Switching times of laws of time, and jumps of prescribed velocities.

    SimulationError if a prescribed position jumps.
    """
    switched = switching(system, Laws(system), State(0.0, *np.split(starts[:, 0], [system.n_q])), end)
    warn_of_times(system, switched.times)
    return switched


def _singly(system: System, starts: np.ndarray, run: dict, settings: dict, control=None) -> Rollout:
    """Motions by :func:`gauss.simulate`, one after the other."""
    batch, t = starts.shape[1], run["times"]
    if system.has_closures:
        states = (State(0.0, *np.split(start, [system.n_q])) for start in starts.T)
        refuse_inconsistent(system, starts, np.array([constraint_residual(system, state) for state in states]))
    samples, share = np.empty((batch, t.size, len(starts))), np.zeros(batch)
    with kept_on_interruption(partial(_result, system, t, control=control, settings=settings)):
        failed, again = repeat(system, starts, samples, share, np.arange(batch), settings["duration"], run, control)
    if control is None:
        tell_of_divergence(system, batch, failed, again)
    stats = [again[k].stats if k in again else None for k in range(batch)]
    counts = {name: np.array([0 if one is None else getattr(one, name) for one in stats]) for name in ("steps", "rejected")}
    marks = _marks(range(batch), failed, again)
    return _result(system, t, samples, control=control, settings=settings, **counts, **marks)


def _constant(system: System, starts: np.ndarray, t: np.ndarray, steps: int) -> Rollout:
    """Motions of a system without degrees of freedom."""
    batch = starts.shape[1]
    counts = {"repeated": (), "steps": np.full(batch, steps), "rejected": np.zeros(batch, int)}
    return _result(system, t, np.zeros((batch, t.size, 0)), work=np.zeros((batch, t.size, 3)), **counts)


def _refuse(integrator: str, why: str, **given):
    """Raise a SimulationError if a setting does not apply to a method."""
    for name, value in given.items():
        if value is not None:
            raise SimulationError(f"{name}: integrator {integrator!r} {why}.")
