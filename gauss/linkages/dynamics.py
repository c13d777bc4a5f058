"""Forward dynamics of a linkage in one coordinate, J_e θ̈ + b θ̇² = M1 + Q, by one compiled kernel."""

import ctypes
import math
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from numbers import Real

import numpy as np

from gauss.arguments import real_array
from gauss.dynamics.laws.switching_times import NO_TIMES, Timetable
from gauss.errors import LinkageError, SimulationError, SwitchingWarning, user_level
from gauss.linkages.chain import Chain
from gauss.linkages.crank_motion import CrankMotion, motor_times, solved
from gauss.linkages.crank_ranges import degrees, follow, named_ranges, near
from gauss.linkages.cycles import crank_numbers
from gauss.linkages.elements import CrankMotor
from gauss.linkages.kernels import inertia_terms, reduced_kernel
from gauss.linkages.motion import move
from gauss.scene.values import put
from gauss.simulation.arguments import check_breaks, sample_times
from gauss.simulation.undetected_switching import SPARSE_STEP, warn_of_opaque

DEFAULT_ATOL = 1e-12  # rad, and relative to the speed of the drive


def reduced_inertia(chain: Chain, angles) -> np.ndarray:
    """Reduced (equivalent) inertia J_e (k,) of the linkage on its crank [kg m²]."""
    angles = np.atleast_1d(real_array(angles, "crank angles", "numbers [rad]"))
    return inertia_terms(move(chain, angles, 1.0 + 0.0 * angles, 0.0 * angles, near(chain, angles)))[0]


class ReducedLinkage:
    """The equation of one coordinate, compiled.

    Parameters
    ----------
    chain : Chain
        The linkage.
    added_inertia : float
        Further inertia on the crank, e.g. of rotor and flywheel [kg m²].

    Raises
    ------
    LinkageError
        If the inertia is no number ≥ 0.

    Examples
    --------
    >>> import gauss
    >>> bar = gauss.load_linkage("four_bar")
    >>> from gauss.linkages import ReducedLinkage
    >>> alone = ReducedLinkage(bar.chain)
    >>> round(alone.acceleration(angle=0.3, speed=0.0, torque=50.0), 3)
    259.307
    """

    def __init__(self, chain: Chain, added_inertia: float = 0.0):
        if not _is_number(added_inertia) or added_inertia < 0:
            raise LinkageError(f"added_inertia: expected a number ≥ 0 in [kg m²], got {added_inertia!r}.")
        self.chain, self.added, self.kernel = chain, float(added_inertia), reduced_kernel(chain)
        self.branch = follow(chain) if chain.triads else None

    def terms(self, angle: float, speed: float) -> tuple[float, float, float]:
        """J_e, b, and Q of all loads at a crank angle and speed."""
        poses = () if self.branch is None else np.concatenate([*self.branch.at(angle).values()])
        inputs, outputs = (ctypes.c_double * self.kernel.n_in)(angle, speed, *poses), (ctypes.c_double * 3)()
        self.kernel.at(ctypes.addressof(inputs), ctypes.addressof(outputs))
        J_e, b, Q = outputs
        if not math.isfinite(J_e):
            where = f"does not close at crank angle {degrees(angle)}; it closes {named_ranges(self.chain) or 'nowhere'}"
            raise SimulationError(f"{self.chain.name} {where}.")
        return J_e + self.added, b, Q

    def acceleration(self, angle: float, speed: float, torque: float) -> float:
        """Acceleration of the crank [rad/s²] under a torque on it [N m]."""
        J_e, b, Q = self.terms(angle, speed)
        return (torque + Q - b * speed * speed) / J_e


@dataclass(frozen=True)
class CrankRun:
    """Motion of a linkage under a motor, each (k,).

    Parameters
    ----------
    t : ndarray
        Times [s].
    angle, speed, acceleration : ndarray
        Of the crank [rad, rad/s, rad/s²].
    torque : ndarray
        Of the motor [N m].

    Examples
    --------
    >>> import gauss
    >>> bar = gauss.load_linkage("four_bar")
    >>> motor = bar.motor(speed=[0, 20], torque=[120, 0])
    >>> run = bar.run(0.1)
    >>> run.t.shape == run.speed.shape, bool(run.speed[-1] > 0)
    (True, True)
    """

    t: np.ndarray
    angle: np.ndarray
    speed: np.ndarray
    acceleration: np.ndarray
    torque: np.ndarray

    def __str__(self):
        """Time, turns and last speed, and the fluctuation of the last turn."""
        turns = abs(self.angle[-1] - self.angle[0]) / (2 * np.pi)
        text = f"{self.t[-1]:.6g} s, {turns:.4g} turns, last speed {self.speed[-1]:.6g} rad/s"
        last = self.speed[np.abs(self.angle - self.angle[-1]) < 2 * np.pi]
        return text + (f", {last.min():.6g} to {last.max():.6g} rad/s in the last turn" if turns > 1 else "")


def run(
    chain: Chain,
    motor: Callable,
    duration: float,
    *,
    speed: float = 0.0,
    angle: float | None = None,
    added_inertia: float = 0.0,
    times=None,
    rtol: float = 1e-10,
    atol: float | None = None,
    step: float | None = None,
    breaks=(),
) -> CrankRun:
    """Run a linkage under a motor.

    Parameters
    ----------
    chain : Chain
        The linkage.
    motor : callable
        motor(t, angle, speed) → torque on the crank [N m].
    duration : float
        Duration [s].
    speed, angle : float
        Of the crank at the start [rad/s, rad]; the start of the cycle, at rest, when not given.
    added_inertia : float
        Further inertia on the crank [kg m²].
    times : array_like, optional
        Increasing samples [s]; 500 equal steps when not given.
    rtol : float
        Local error of angle and speed, relative to them.
    atol : float, optional
        Absolute part of it [rad, rad/s]; when not given 1e-12 rad, and 1e-12 of the speed of the drive or start.
    step : float, optional
        Largest step [s].
    breaks : sequence of float
        Times at which the law of the motor switches [s]; jumps in time longer than 1/20000 of the duration are found.

    Returns
    -------
    CrankRun
        Angle and speed of the crank over time.

    Raises
    ------
    SceneError
        If the law of the motor raises, or returns no finite number; the message has the time.
    LinkageError, SimulationError
        If an argument makes no sense, the linkage does not close where the crank comes, or the integrator fails.
    KeyboardInterrupt
        After Ctrl-C; its ``trajectory`` is the motion so far.

    Warns
    -----
    SwitchingWarning
        If the law of a motor, a Python function, was evaluated at few points.

    Examples
    --------
    >>> import gauss
    >>> bar = gauss.load_linkage("four_bar")
    >>> from gauss.linkages import run
    >>> motion = run(bar.chain, lambda t, angle, speed: 120.0 - 6.0 * speed, 1.0)
    >>> round(float(motion.speed[-1]), 3)
    20.32
    """
    _check_settings(duration, rtol, atol, step)
    equation = ReducedLinkage(chain, added_inertia)
    samples = np.linspace(0.0, duration, 501) if times is None else sample_times(times, 0.0, duration)
    start = crank_numbers("angle and speed", [chain.driver.start if angle is None else angle, speed]).tolist()
    fastest = max(abs(start[1]), abs(chain.driver.speed)) or 1.0 / duration
    absolute = [DEFAULT_ATOL, DEFAULT_ATOL * fastest] if atol is None else atol

    value, what = np.zeros(1), f"{chain.name}: motor"

    def torque(*state):
        put(motor, state, what, 1, value, 0)
        return value.item()

    def rates(t, y):
        return [y[1], equation.acceleration(y[0], y[1], torque(t, y[0], y[1]))]

    options = {"rtol": rtol, "atol": absolute, "largest": np.inf if step is None else float(step)}
    known_breaks = check_breaks(breaks, 0.0, duration)
    switches = NO_TIMES if isinstance(motor, CrankMotor) else motor_times(motor, start, duration, known_breaks)
    try:
        found = solved(rates, start, samples, duration, switches, **options)
    except SimulationError as error:
        raise SimulationError(f"{chain.name}: {error}") from error
    if not isinstance(motor, CrankMotor):
        _warn_of_motor(chain, switches, found, duration)
    angles, speeds = found.y.T.copy()
    torques = np.array([torque(*state) for state in zip(found.t, angles, speeds, strict=True)], dtype=float)
    accelerations = [equation.acceleration(*state) for state in zip(angles, speeds, torques, strict=True)]
    made = CrankRun(found.t, angles, speeds, np.array(accelerations), torques)
    if found.interruption is not None:
        found.interruption.trajectory = made  # type: ignore[attr-defined]  # kept on the interruption for the caller
        raise found.interruption
    return made


def _warn_of_motor(chain: Chain, switches: Timetable, found: CrankMotion, duration: float) -> None:
    """Warn of features of the law of a motor that are not resolved, and of one that was evaluated at few points."""
    for text in switches.limitations:
        warnings.warn(f"{chain.name!r}: {text}", SwitchingWarning, stacklevel=user_level())
    if found.longest > SPARSE_STEP * duration:
        warn_of_opaque(chain.name, "the motor", "step=")


def _check_settings(duration: float, rtol: float, atol: float | None, step: float | None) -> None:
    """Check the arguments of :func:`run`; SimulationError if one makes no sense."""
    given = {name: value for name, value in (("atol", atol), ("step", step)) if value is not None}
    for what, value in {"duration": duration, "rtol": rtol, **given}.items():
        if not _is_number(value) or value <= 0:
            raise SimulationError(f"{what}: expected a positive number, got {value!r}.")


def _is_number(value) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool) and math.isfinite(value)
