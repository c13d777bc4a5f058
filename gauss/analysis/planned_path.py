"""Motions in task space: a frame goes along straight lines, turning about fixed axes, and the coordinates follow.

x(s) = x₀ + s (x₁ − x₀), R(s) = exp(s θ) R₀ with θ = log(R₁ R₀ᵀ): s(t) from 0 to 1 is a trapezoid within the limits of speed
and acceleration. Coordinates and rates of samples come from inverse kinematics, one from the other by the midpoint rule and
corrected; cubic Hermite polynomials join them. A line that takes a coordinate beyond its limits is stretched in time.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from numbers import Real

import numpy as np

from gauss import rotations
from gauss.analysis.inverse_kinematics import differential_inverse_kinematics, inverse_kinematics
from gauss.analysis.loop_closure import closed
from gauss.analysis.planned_motion import PlannedMotion
from gauss.analysis.target import Target
from gauss.analysis.target_problem import positive_values
from gauss.analysis.targets import PointTarget, PoseTarget
from gauss.analysis.time_scaling import phases, rested, stretch, stretched
from gauss.arguments import named_arguments
from gauss.dynamics.scene_compilation import system_of
from gauss.errors import ArgumentError, SimulationError
from gauss.scene import Scene, values
from gauss.system import State, System, retract

STEP = 1.0  # s, of differential inverse kinematics without feedback: any other is as good
TOLERANCE = 1e-9  # of inverse kinematics at the samples


@named_arguments
def plan_path(
    system: System | Scene,
    points: Sequence[PoseTarget | PointTarget],
    *,
    speed: float,
    acceleration: float,
    turning_speed: float = np.inf,
    turning_acceleration: float = np.inf,
    speeds: Mapping | float | None = None,
    accelerations: Mapping | float | None = None,
    coordinates: Sequence[str] | None = None,
    others: Sequence[Target] = (),
    start: State | None = None,
    samples: int = 20,
    backend: str = "daqp",
    begin: float = 0.0,
) -> PlannedMotion:
    """Motion of coordinates that leads a frame along straight lines, at rest in every point.

    Parameters
    ----------
    system : System or Scene
        The system.
    points : sequence of PoseTarget or PointTarget
        Two or more targets of one frame, all of the same kind.
    speed, acceleration : float
        Largest speed [m/s] and acceleration [m/s²] of the point.
    turning_speed, turning_acceleration : float
        Largest angular velocity [rad/s] and acceleration [rad/s²] of the frame.
    speeds, accelerations : dict or float, optional
        Largest rates [rad/s, m/s] and accelerations [rad/s², m/s²] of the planned coordinates, by name, or for all.
    coordinates : sequence of str, optional
        Coordinates that are planned: with loops, the driven ones; all when not given.
    others : sequence of Target
        Further targets that hold along the motion, e.g. a posture of level 1 for redundant arms.
    start : State, optional
        Where inverse kinematics of the first point begins; the start of the scene when not given.
    samples : int
        Samples of each line; the error between them falls with the fourth power of their number.
    backend : str
        QP solver for the limits of joints, see :func:`gauss.backends.available`.
    begin : float
        When the motion begins [s].

    Returns
    -------
    PlannedMotion
        Coordinates, rates, accelerations as functions of time.

    Raises
    ------
    ArgumentError, StateError
        If points or limits are none, or a name is none of the system, or no coordinate.
    SimulationError
        If a place of the path is not reached: which, and what stands against it.

    Examples
    --------
    >>> import gauss
    >>> tip = gauss.PointTarget("lower", (0.6, -0.8, 0.0), at=(0.5, 0.0, 0.0))
    >>> ends = [tip, gauss.PointTarget("lower", (0.2, -0.8, 0.0), at=(0.5, 0.0, 0.0))]
    >>> line = gauss.plan_path(gauss.load("double_pendulum"), ends, speed=0.5, acceleration=2.0)
    >>> round(line.duration, 9)
    1.05
    """
    system = system_of(system, "plan_path")
    lines = _lines(points)
    most = _most(
        speed=speed, acceleration=acceleration, turning_speed=turning_speed, turning_acceleration=turning_acceleration
    )
    if isinstance(samples, bool) or not isinstance(samples, (int, np.integer)) or samples < 2:
        raise ArgumentError(f"plan_path: samples: expected a whole number, 2 or more, got {samples!r}.")
    names = _names(system, coordinates)
    columns = [system.column(name) for name in names]
    places = [system.entry(name) for name in names]
    given = {"speeds": speeds, "accelerations": accelerations}
    limits = tuple(positive_values(system, value, key)[columns] for key, value in given.items())
    follow = _Follower(system, tuple(others), backend)
    state, laws = follow.placed(points[0], start, "the first point"), []
    for number, line in enumerate(lines, 1):
        times, s, rates = _timing(_slowest(line, most), samples)
        state, q, v = follow.along(line, state, times, s, rates, f"line {number}")
        law = _hermite(times, q[:, places], v[:, columns])
        laws.append(stretched(law, max(1.0, stretch(law, limits))))
    return PlannedMotion(names, rested(laws, float(begin)))


class _Line:
    """Straight line from one target to another of its kind."""

    def __init__(self, one: PoseTarget | PointTarget, other: PoseTarget | PointTarget):
        self.one, self.way, self.turn = one, np.zeros(3), np.zeros(3)
        if one.position is not None and other.position is not None:
            self.way = np.array(other.position) - np.array(one.position)
        if isinstance(one, PoseTarget) and one.rotation is not None:
            assert isinstance(other, PoseTarget) and other.rotation is not None
            self.R = values.rotation_matrix(one.rotation)
            self.turn = rotations.to_rotation_vector(values.rotation_matrix(other.rotation) @ self.R.T)

    def target(self, s: float, rate: float) -> Target:
        """Target at a place s from 0 to 1, moving at a rate ṡ [1/s]."""
        changes: dict = {}
        if self.one.position is not None:
            changes["position"] = tuple(np.array(self.one.position) + s * self.way)
        if isinstance(self.one, PointTarget):
            return replace(self.one, **changes, velocity=tuple(rate * self.way))
        if self.one.rotation is not None:
            changes["rotation"] = rotations.from_quaternion(rotations.exponential(s * self.turn)) @ self.R
        return replace(self.one, **changes, velocity=(*(rate * self.turn), *(rate * self.way)))


class _Follower:
    """Inverse kinematics along a path.

    Parameters
    ----------
    others : tuple of Target
        Targets beside that of the path.
    backend : str
        QP solver for the limits.
    """

    def __init__(self, system: System, others: tuple[Target, ...], backend: str):
        self.system, self.others, self.backend = system, others, backend

    def placed(self, target: Target, start: State | None, place: str) -> State:
        """State in which the frame is at its target."""
        targets = [target, *self.others]
        found = inverse_kinematics(self.system, targets, start, tolerance=TOLERANCE, backend=self.backend)
        if target.label in found.unmet:
            raise SimulationError(f"plan_path: {place} is not reached: {found.reason}.")
        return found.state

    def rates(self, target: Target, state: State) -> np.ndarray:
        """Rates (n_v,) that keep up with a moving target; other targets hold what they have."""
        targets = [replace(one, gain=0.0) for one in (target, *self.others)]
        return differential_inverse_kinematics(self.system, state, targets, STEP, backend=self.backend)

    def along(self, line: _Line, state: State, times, s, rates, place: str) -> tuple[State, np.ndarray, np.ndarray]:
        """Last state, and coordinates (k, n_q) and rates (k, n_v) at the samples of a line."""
        q, v = [state.q], [self.rates(line.target(s[0], rates[0]), state)]
        for k in range(1, len(times)):
            h = times[k] - times[k - 1]
            middle, _ = closed(self.system, replace(state, q=retract(self.system, state.q, 0.5 * h * v[-1])))
            mean = line.target(0.5 * (s[k] + s[k - 1]), (s[k] - s[k - 1]) / h)
            guess = replace(state, q=retract(self.system, state.q, h * self.rates(mean, middle)))
            state = self.placed(line.target(s[k], rates[k]), guess, f"{place}, at {100.0 * s[k]:.3g} %,")
            q.append(state.q)
            v.append(self.rates(line.target(s[k], rates[k]), state))
        return state, np.array(q), np.array(v)


def _lines(points) -> list[_Line]:
    """Lines between targets of one frame and kind that differ."""
    given = list(points) if np.iterable(points) else []
    if len(given) < 2 or not all(isinstance(point, (PoseTarget, PointTarget)) for point in given):
        raise ArgumentError("plan_path: expected two targets or more, all gauss.PoseTarget or all gauss.PointTarget.")
    if len({_kind(point) for point in given}) > 1:
        raise ArgumentError("plan_path: expected targets of one frame and of one kind, with the same fields given.")
    lines = [_Line(one, other) for one, other in zip(given[:-1], given[1:], strict=True)]
    lines = [line for line in lines if line.way.any() or line.turn.any()]
    if not lines:
        raise ArgumentError("plan_path: all points are the same; there is no motion.")
    return lines


def _kind(point: PoseTarget | PointTarget) -> tuple:
    if isinstance(point, PointTarget):
        return PointTarget, point.frame, point.at, point.along
    return PoseTarget, point.frame, point.position is None, point.rotation is None


def _most(**limits: float) -> dict[str, float]:
    """Limits of a path, checked."""
    for name, value in limits.items():
        if isinstance(value, bool) or not isinstance(value, Real) or not value > 0.0:
            raise ArgumentError(f"plan_path: {name}: expected a positive number, got {value!r}.")
    return limits


def _names(system: System, coordinates) -> tuple[str, ...]:
    """Names of the planned coordinates."""
    if coordinates is None and (system.has_closures or not system.is_flat):
        raise ArgumentError("plan_path: with loops, ball or free joints, name the driven coordinates=; the others follow.")
    return tuple(system.coordinates if coordinates is None else coordinates)


def _slowest(line: _Line, most: dict[str, float]) -> tuple[float, float]:
    """Largest ṡ and s̈ on a line."""
    way, turn = np.linalg.norm(line.way), np.linalg.norm(line.turn)
    rates = [limit / size for limit, size in ((most["speed"], way), (most["turning_speed"], turn)) if size]
    pairs = (most["acceleration"], way), (most["turning_acceleration"], turn)
    found = min(rates), min(limit / size for limit, size in pairs if size)
    if np.isinf(found[1]):
        raise ArgumentError("plan_path: give turning_acceleration= where a frame turns in place.")
    return float(found[0]), float(found[1])


def _timing(limits: tuple[float, float], samples: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times, s and ṡ of samples; the ends of phases are among them."""
    durations, values_of = phases(*limits)
    share = durations.sum() / samples
    times, s, rates = [0.0], [0.0], [0.0]
    for duration, acceleration in zip(durations, values_of, strict=True):
        t, (t0, s0, v0) = np.linspace(0.0, duration, 1 + int(np.ceil(duration / share)))[1:], (times[-1], s[-1], rates[-1])
        times.extend(t0 + t)
        s.extend(s0 + t * (v0 + 0.5 * acceleration * t))
        rates.extend(v0 + acceleration * t)
    s[-1], rates[-1] = 1.0, 0.0
    return np.array(times), np.array(s), np.array(rates)


def _hermite(times: np.ndarray, q: np.ndarray, v: np.ndarray):
    """Piecewise cubic of values and rates (k, n)."""
    from scipy.interpolate import CubicHermiteSpline

    return CubicHermiteSpline(times, q, v)
