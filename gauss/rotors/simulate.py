"""From a network to its motion."""

import time

import numpy as np

from gauss.errors import SimulationError, did_you_mean
from gauss.rotors.contract import reduce
from gauss.rotors.laws import ROLES
from gauss.rotors.mechanics import Equations
from gauss.rotors.motion import RotorMotion, Stats
from gauss.rotors.network import Network
from gauss.rotors.reduced import Reduced
from gauss.rotors.run import METHODS, Run
from gauss.rotors.stops import stops
from gauss.rotors.switching import switching
from gauss.simulation.arguments import check_breaks
from gauss.simulation.opaque_laws import SPARSE_STEP
from gauss.simulation.undetected_switching import warn_of_opaque

CHOICES = ("auto", *METHODS)
ALLOWED = 1e-9  # rad, and of the slow speed of the network: absolute local error if nothing is said


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

    Events (a change of the direction of power, of the sign of a slip, sticking and slipping, contact and separation, …)
    are located to rounding; the integration stops at each and goes on in the new mode.

    Parameters
    ----------
    network : Network
        What turns.
    duration : float
        How long [s].
    times : array_like, optional
        Samples to return [s]; the integrator lands on each of them. Every step when not given.
    rtol : float
        Local error of angles and speeds, relative to them.
    atol : float, optional
        Absolute part of it [rad, rad/s]; 1e-9 rad, and 1e-9 of a hundredth of the largest speed that the network knows of at
        the start, when not given.
    method : str
        "dop853", explicit, with steps that the fastest decay of a slip allows; "radau", implicit, for stiff slips;
        "auto": the second only where the first would need too many steps.
    max_step : float
        Largest step [s].
    breaks : sequence of float
        Times when something switches [s], for laws that gauss cannot look into: those that call functions which cannot be
        traced. No step crosses one of them. Conditions of traced laws, on time, angles and speeds, are found by themselves.
    compiled : bool, optional
        Whether the equations are traced and compiled; where possible when not given.

    Returns
    -------
    RotorMotion
        Samples, events and energies.

    Warns
    -----
    SwitchingWarning
        If a law that cannot be traced was evaluated so seldom that it may have switched unseen.

    Raises
    ------
    SceneError
        If the network contradicts itself.
    SimulationError
        If an argument makes no sense, or the motion cannot go on.
    KeyboardInterrupt
        On Ctrl-C; its ``trajectory`` is the RotorMotion so far, None before the first sample.
    """
    given = {} if atol is None else {"atol": atol}
    for name, value in {"duration": duration, "rtol": rtol, "max_step": max_step, **given}.items():
        if not value > 0 or (name != "max_step" and not np.isfinite(value)):
            raise SimulationError(f"{name}: expected a positive number, got {value!r}.")
    if method not in CHOICES:
        raise SimulationError(f"no method {method!r}. {did_you_mean(method, CHOICES)}")
    samples = None if times is None else np.asarray(times, dtype=float)
    if samples is not None:
        inside = samples.ndim == 1 and samples.size and (np.diff(samples) > 0).all()
        if not inside or samples[0] < 0 or samples[-1] > duration:
            raise SimulationError(f"times: expected increasing times between 0 and the duration {duration} s.")
    known_breaks, reduced = check_breaks(breaks, 0.0, duration), reduce(network)
    heeded = switching(reduced, duration, rtol, known_breaks)
    allowed = (ALLOWED, ALLOWED * reduced.slow) if atol is None else (atol, atol)
    run = Run(Equations(reduced, compiled), method, rtol, allowed, max_step, heeded)
    began = time.perf_counter()
    try:
        wall_time = run.collect(stops(duration, heeded.times, switches(reduced, duration), samples), samples is None)
    except KeyboardInterrupt as error:
        error.trajectory = _motion(run, samples, time.perf_counter() - began) if run.records else None
        raise
    if heeded.opaque and run.longest > SPARSE_STEP * duration:
        warn_of_opaque(network.name, ", ".join(heeded.opaque), "max_step=")
    return _motion(run, samples, wall_time)


def switches(reduced: Reduced, duration: float) -> np.ndarray:
    """Times within a run at which a torque begins or ends, or the data of a link have a corner [s]."""
    times = [time for torque in reduced.network.torques.values() for time in (torque.begin, torque.until)]
    times += [time for link in reduced.links for time in link.corners]
    return np.unique([time for time in times if time is not None and 0 < time < duration])


def _motion(run: Run, samples, wall_time: float) -> RotorMotion:
    reduced, n_g, n_l = run.reduced, run.n_g, run.n_l
    records = run.records
    if samples is not None:
        wanted = set(samples.tolist())
        records = list({record[0]: record for record in records if record[0] in wanted}.values())
    t, y, acceleration, torque, elastic, forward, phases = (
        np.array(column) if k < 6 else column for k, column in enumerate(zip(*records, strict=True))
    )
    theta, w, work, slip, mesh = np.split(y, np.cumsum([n_g, n_g, len(ROLES), n_l]), axis=1)
    stuck = np.array([phase.standing()[reduced.group] for phase in phases])
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
        Stats(run.evaluations, run.steps, wall_time, run.equations.plan),
    )
