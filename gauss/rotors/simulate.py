"""Simulation of a network: check the arguments, reduce the network, integrate from event to event, collect the motion."""

import time
import warnings
from numbers import Real

import numpy as np

from gauss.arguments import LARGEST_FLOAT, named_arguments
from gauss.codegen import one_tier
from gauss.errors import SimulationError, SwitchingWarning, did_you_mean, user_level
from gauss.interruption import interruption_keeps
from gauss.rotors.contract import reduce
from gauss.rotors.laws import ROLES
from gauss.rotors.mechanics import NetworkEquations
from gauss.rotors.motion import RotorMotion, RotorStats
from gauss.rotors.network import Network
from gauss.rotors.run import METHODS, RotorRun
from gauss.rotors.switching import step_ends, switches, switching
from gauss.simulation.arguments import check_breaks, sample_times
from gauss.simulation.undetected_switching import SPARSE_STEP, warn_of_opaque

CHOICES = ("auto", *METHODS)
DEFAULT_ATOL = 1e-9  # rad, and relative to the slow speed of the network


@named_arguments
@interruption_keeps("trajectory")
@one_tier()
def simulate(
    network: Network,
    duration: float,
    *,
    times=None,
    rtol: float = 1e-9,
    atol: float | None = None,
    method: str = "auto",
    max_step: float = np.inf,
    breaks=(),
    compiled: bool | None = None,
) -> RotorMotion:
    """Simulate a network in its reduced form.

    Events (reversal of power or of a slip, sticking and slipping, contact and separation, …) are located to rounding; the
    integration restarts at each in the new mode.

    Parameters
    ----------
    network : Network
        The network.
    duration : float
        Duration [s].
    times : array_like, optional
        Samples to return [s], ends of steps; every step when not given.
    rtol : float
        Local error of angles and speeds, relative to them.
    atol : float, optional
        Absolute part of it [rad, rad/s]; when not given 1e-9 rad, and 1e-9 of a hundredth of the largest initial or
        no-load speed.
    method : str
        "dop853", explicit, with steps limited by the fastest decay of a slip; "radau", implicit, for stiff slips; "auto":
        the second where the first would need too many steps.
    max_step : float
        Largest step [s].
    breaks : sequence of float
        Switching times [s] of opaque laws, which call functions that cannot be traced. No step crosses one of them. The
        switching functions of traced laws, of time, angles and speeds, are located without them.
    compiled : bool, optional
        Whether the equations are traced and compiled; where possible when not given.

    Returns
    -------
    RotorMotion
        Samples, events and energies.

    Warns
    -----
    SwitchingWarning
        If an opaque law was evaluated so seldom that it may have switched unseen, if it has other values in a second call,
        and if a law has more features than steps resolve.

    Raises
    ------
    SceneError
        If the network contradicts itself.
    SimulationError
        If an argument makes no sense, or the motion cannot go on.
    KeyboardInterrupt
        On Ctrl-C; its ``trajectory`` is the RotorMotion so far, None before the first sample.
    """
    samples = _checked(duration, times, rtol, atol, method, max_step)
    known_breaks, reduced = check_breaks(breaks, 0.0, duration), reduce(network)
    resolved = switching(reduced, duration, rtol, known_breaks)
    for text in resolved.times.limitations:
        warnings.warn(f"{network.name!r}: {text}.", SwitchingWarning, stacklevel=user_level())
    allowed = (DEFAULT_ATOL, DEFAULT_ATOL * reduced.slow) if atol is None else (atol, atol)
    run = RotorRun(NetworkEquations(reduced, compiled), method, rtol, allowed, max_step, resolved)
    began = time.perf_counter()
    try:
        wall_time = run.collect(step_ends(duration, resolved.times, switches(reduced, duration), samples), samples is None)
    except KeyboardInterrupt as error:
        reached = _motion(run, samples, time.perf_counter() - began) if run.records else None
        error.trajectory = reached  # type: ignore[attr-defined]  # kept on the interruption for the caller
        raise
    if resolved.opaque and run.longest > SPARSE_STEP * duration:
        warn_of_opaque(network.name, ", ".join(resolved.opaque), "max_step=")
    return _motion(run, samples, wall_time)


def _checked(duration: float, times, rtol: float, atol: float | None, method: str, max_step: float) -> np.ndarray | None:
    """Times of the samples [s]; SimulationError if an argument makes no sense."""
    given = {} if atol is None else {"atol": atol}
    for name, value in {"duration": duration, "rtol": rtol, "max_step": max_step, **given}.items():
        if (
            isinstance(value, bool)
            or not isinstance(value, Real)
            or not value > 0
            or (name != "max_step" and not value <= LARGEST_FLOAT)
        ):
            raise SimulationError(f"{name}: expected a positive number, got {value!r}.")
    if method not in CHOICES:
        raise SimulationError(f"no method {method!r}. {did_you_mean(method, CHOICES)}")
    return sample_times(times, 0.0, duration)


def _motion(run: RotorRun, samples: np.ndarray | None, wall_time: float) -> RotorMotion:
    reduced, n_g, n_l = run.reduced, run.n_g, run.n_l
    records = run.records
    if samples is not None:
        wanted = set(samples.tolist())
        records = list({record.t: record for record in records if record.t in wanted}.values())
    t, y, acceleration, torque, elastic, forward = (np.array(column) for column in list(zip(*records, strict=True))[:6])
    theta, w, work, slip, mesh = np.split(y, np.cumsum([n_g, n_g, len(ROLES), n_l]), axis=1)
    stuck = np.array([record.phase.standing()[reduced.group] for record in records])
    return RotorMotion(
        reduced,
        t,
        reduced.angle + reduced.K * theta[:, reduced.group],
        reduced.K * w[:, reduced.group],
        reduced.K * acceleration[:, reduced.group],
        torque,
        forward,
        work,
        slip,
        mesh,
        elastic,
        stuck,
        tuple(run.events),
        RotorStats(run.evaluations, run.steps, wall_time, run.equations.plan),
        run.elastic_at_start,
    )
