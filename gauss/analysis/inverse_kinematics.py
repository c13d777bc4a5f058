"""Inverse kinematics: states, or rates, for targets of poses, points, distances, the centre of mass and coordinates.

Steps ξ = N y of Levenberg and Marquardt on the errors of the targets, level by level (:mod:`gauss.analysis.target_levels`),
within the limits, along the constraints; each is projected onto these, so that loops are closed exactly (Siciliano and
others, Robotics, 2009, sec. 3.5–3.7; Nocedal and Wright, Numerical Optimization, 2006, ch. 10.3).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from gauss.analysis.loop_closure import closed
from gauss.analysis.obstacles import obstacles
from gauss.analysis.target import Target
from gauss.analysis.target_levels import LevelRows, lexicographic, solver_of
from gauss.analysis.target_problem import TargetProblem, bounds, positive_values
from gauss.arguments import generator, named_arguments
from gauss.dynamics.projection import clipped, project_rates
from gauss.dynamics.scene_compilation import system_of
from gauss.errors import ArgumentError, GaussError, require
from gauss.scene import Scene
from gauss.system import State, System, retract

ITERATIONS = 200  # of Levenberg and Marquardt
LONGEST_STEP = 0.5  # in units of the coordinates
LEAST_STEP = 1e-12  # in units of the coordinates, after which nothing changes any more
LEAST_DECREASE = 1e-16  # of the merit, relative to it, that a step promises, below which nothing changes any more
FIRST_DAMPING, MOST_DAMPING = 1e-6, 1e12  # relative to the merit
GROWTH, LEAST_FACTOR = 2.0, 0.1  # factors of the damping after a failed step, and after the best
VIOLATION_SHARE = 1e3  # of violated limits in the costs of a level
RESTORATIONS = 5  # steps on the levels before, after a step on a level
KEPT_COST = 1e-7  # relative increase of the costs of the levels before that a step may leave
ROUNDED_MERIT = 1e-14  # relative increase of the merit that is round-off
KICK = 0.05  # standard deviation of a displacement from where the errors are stationary, in units


@dataclass(frozen=True)
class InverseKinematics:
    """State for targets, and what stands against those that are not reached.

    Parameters
    ----------
    state : State
        The state, at rest; it meets all constraints and limits.
    errors : dict of str to ndarray
        Target less actual value of each target [rad, m], by name.
    unmet : tuple of str
        Targets whose error is above the tolerance.
    obstacles : dict of str to tuple of str
        Limits and other targets that stand against each unmet target; empty where it is out of reach of the mechanism.
    reached : bool
        Whether all targets of the first level are met.
    iterations : int
        Steps.
    """

    state: State
    errors: dict[str, np.ndarray]
    unmet: tuple[str, ...]
    obstacles: dict[str, tuple[str, ...]]
    reached: bool
    iterations: int

    @property
    def reason(self) -> str:
        """In words, what stands against each unmet target; empty if all are met."""
        parts = []
        for name in self.unmet:
            against = ", ".join(self.obstacles[name]) or "nothing but the reach of the mechanism"
            parts.append(f"{name} is off by {np.linalg.norm(self.errors[name]):.3g}; against it: {against}")
        return "; ".join(parts)


@named_arguments
def inverse_kinematics(
    system: System | Scene,
    targets: Target | Sequence[Target],
    start: State | None = None,
    *,
    limits: Mapping | None = None,
    tolerance: float = 1e-9,
    starts: int = 0,
    seed: int = 0,
    backend: str = "daqp",
) -> InverseKinematics:
    """State near a start for targets, with loops and all other constraints closed.

    Parameters
    ----------
    system : System or Scene
        The system.
    targets : Target or sequence of Target
        :class:`gauss.PoseTarget`, :class:`gauss.PointTarget`, :class:`gauss.DistanceTarget`,
        :class:`gauss.CenterOfMassTarget`, :class:`gauss.PostureTarget`.
    start : State, optional
        Where the search begins; the start of the scene when not given.
    limits : dict, optional
        Lowest and highest coordinates (2,) by name [rad, m], instead of those of joints and stops.
    tolerance : float
        Largest error of a met target, in radians and lengths of the scene.
    starts : int
        Number of random starts that are tried while targets of the first level are unmet.
    seed : int
        Their seed: the same one, the same starts.
    backend : str
        QP solver for the limits, see :func:`gauss.backends.available`.

    Returns
    -------
    InverseKinematics
        State, errors, unmet targets and what stands against them. Targets out of reach raise nothing: the state is then
        that of the least weighted squares, level by level.

    Raises
    ------
    ArgumentError, StateError
        If targets, limits or numbers are none, or a name is none of the system.
    AssemblyError
        If the start cannot be assembled.
    BackendError
        If there is no such QP solver.
    SimulationError
        If the constraints allow no state within the limits near the start.

    Examples
    --------
    >>> import gauss
    >>> target = gauss.PointTarget("lower", (0.6, -0.8, 0.0), at=(0.5, 0.0, 0.0))
    >>> gauss.inverse_kinematics(gauss.load("double_pendulum"), target).reached
    True
    """
    system = system_of(system, "inverse_kinematics")
    problem, solver = TargetProblem(system, targets, limits), solver_of(backend)
    for name, value, least in (("starts", starts, 0), ("seed", seed, 0)):
        if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < least:
            raise ArgumentError(f"inverse_kinematics: {name}: expected a whole number, {least} or more, got {value!r}.")
    if isinstance(tolerance, bool) or not isinstance(tolerance, (int, float)) or not 0.0 < tolerance < np.inf:
        raise ArgumentError(f"inverse_kinematics: tolerance: expected a positive number, got {tolerance!r}.")
    rng, base = generator(seed, "inverse_kinematics"), _within(problem, start)
    best = _descended(problem, base, solver)
    if not _is_met(best[0], tolerance):
        best = _better(best, _tried(problem, best[0].state, KICK * rng.standard_normal(system.n_v), solver))
    for _ in range(starts):
        if _is_met(best[0], tolerance):
            break
        best = _better(best, _tried(problem, base, np.pi * rng.uniform(-1.0, 1.0, system.n_v), solver))
    return _result(*best, tolerance)


@named_arguments
def differential_inverse_kinematics(
    system: System,
    state: State,
    targets: Target | Sequence[Target],
    step: float,
    *,
    limits: Mapping | None = None,
    speeds: Mapping | float | None = None,
    damping: float = 1e-12,
    backend: str = "daqp",
) -> np.ndarray:
    """Rates for targets: one step of inverse kinematics, for control loops.

    Each target asks for the rate of its own motion and, by its gain, for a share of its error in a step.

    Parameters
    ----------
    system : System
        The system.
    state : State
        Consistent state.
    targets : Target or sequence of Target
        As of :func:`gauss.inverse_kinematics`.
    step : float
        Time for which the rates hold [s].
    limits : dict, optional
        Lowest and highest coordinates (2,) by name [rad, m], instead of those of joints and stops: no coordinate goes
        beyond them within the step.
    speeds : dict or float, optional
        Largest rates by the names of coordinates, or one number for all [rad/s, m/s].
    damping : float
        Weight of the squared displacements of the step beside those of the errors, in radians and lengths of the scene:
        larger where targets lead through singular configurations.
    backend : str
        QP solver for the limits, see :func:`gauss.backends.available`.

    Returns
    -------
    ndarray, shape (n_v,)
        Rates that meet the constraints, prescribed drives and rolling included [rad/s, m/s].

    Raises
    ------
    ArgumentError, StateError
        If targets, limits or numbers are none, or a name is none of the system.
    BackendError
        If there is no such QP solver.
    SimulationError
        If no rates are within the limits.
    """
    system = system_of(system, "differential_inverse_kinematics")
    require(state, (State,), "differential_inverse_kinematics: state")
    for name, value, least in (("step", step, 1e-300), ("damping", damping, 0.0)):
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not least <= value < np.inf:
            raise ArgumentError(f"differential_inverse_kinematics: {name}: expected a positive number, got {value!r}.")
    problem, fastest = TargetProblem(system, targets, limits), positive_values(system, speeds, "speeds")
    units, rows = system.scale.coordinates, problem.rows(state)
    N = problem.basis(state, of_rates=True)
    driven = np.zeros(system.n_v)
    if system.relations.placed:  # joints and couplings allow rest
        driven = step * project_rates(system, replace(state, v=driven)).v
    wanted = [
        step * target.rate(one.error) + target.gain * one.error - one.jacobian @ driven
        for target, one in zip(problem.targets, rows, strict=True)
    ]
    low, high = problem.room(state)
    reach = step * fastest
    low, high = np.clip(low, -reach, reach), np.clip(high, -reach, reach)
    G, h = bounds(N, low, high, units, driven)
    y = lexicographic(problem.levels(rows, wanted, N), G, h, float(damping), solver_of(backend))
    return (driven + N @ y) / step


def _within(problem: TargetProblem, start: State | None) -> State:
    """Start at rest that meets constraints, and limits where nothing binds the coordinates."""
    system = problem.system
    if start is None:
        start = system.initial_state()
    require(start, (State,), "inverse_kinematics: start")
    start = system.state(start.q, t=start.t)
    if system.has_closures:
        return replace(system.projected(start), v=np.zeros(system.n_v))
    return clipped(system, start, problem.lowest, problem.highest)


class _Point:
    """State of the search, with its rows, costs, and violation of limits.

    Parameters
    ----------
    is_closed : bool
        Whether it meets the constraints.
    """

    def __init__(self, problem: TargetProblem, state: State, is_closed: bool = True):
        self.problem, self.state, self.rows = problem, state, problem.rows(state)
        self.costs = problem.costs(self.rows) if is_closed else np.full(len(problem.depths), np.inf)
        self.violation = problem.violation(state)

    @cached_property
    def N(self) -> np.ndarray:
        """Basis of the displacements."""
        return self.problem.basis(self.state)

    @cached_property
    def levels(self) -> list[LevelRows]:
        """Rows of the levels along N."""
        return self.problem.levels(self.rows, [one.error for one in self.rows], self.N)

    def step(self, count: int, damping: float, solver) -> tuple[np.ndarray, float]:
        """Step y (k,) on the first levels, no longer than the longest, and its length in units before that."""
        units = self.problem.system.scale.coordinates
        G, h = bounds(self.N, *self.problem.room(self.state, LONGEST_STEP), units)
        y = lexicographic(self.levels[:count], G, h, damping, solver)
        longest = float(np.abs(self.N @ y / units).max(initial=0.0))
        return (y * (LONGEST_STEP / longest) if longest > LONGEST_STEP else y), longest

    def moved(self, y: np.ndarray) -> "_Point":
        """Point after a step, on the constraints, or within limits to the last digit where there are none."""
        problem, system = self.problem, self.problem.system
        state = replace(self.state, q=retract(system, self.state.q, self.N @ y))
        if not system.has_closures:
            return _Point(problem, clipped(system, state, problem.lowest, problem.highest))
        return _Point(problem, *closed(system, state))

    def merit(self, level: int) -> float:
        """Costs of a level, and the violation of limits."""
        return float(self.costs[level]) + VIOLATION_SHARE * self.violation

    def keeps(self, best: np.ndarray) -> bool:
        """Whether the costs of the first levels are at most the best, but for round-off."""
        return bool(
            (self.costs[: best.size] <= best * (1.0 + KEPT_COST) + self.problem.costs_of_round_off[: best.size]).all()
        )


def _descended(problem: TargetProblem, state: State, solver) -> tuple[_Point, int]:
    """State of the least errors, level by level, and the number of steps."""
    point, steps = _Point(problem, state), 0
    for level in range(len(problem.depths)):
        point, more = _least(point, level, solver)
        steps += more
    return point, steps


def _least(point: _Point, level: int, solver) -> tuple[_Point, int]:
    """Point of the least costs of a level that keeps those before; damping by the gain ratio (Nielsen 1999)."""
    damping, growth, kept = FIRST_DAMPING, GROWTH, point.costs[:level].copy()
    for iteration in range(1, ITERATIONS + 1):  # noqa: B007  # it is returned
        merit = point.merit(level)
        y, longest = point.step(level + 1, damping * min(merit, 1.0), solver)
        rows = point.levels[level]
        rest = rows.A @ y - rows.b
        expected = float(rows.b @ rows.b - rest @ rest) + VIOLATION_SHARE * point.violation
        if longest <= LEAST_STEP or abs(expected) <= LEAST_DECREASE * merit:
            break
        trial = _restored(point.moved(y), kept, solver)
        if trial.keeps(kept) and trial.merit(level) <= merit * (1.0 + ROUNDED_MERIT):
            ratio = (merit - trial.merit(level)) / expected if expected > 0.0 else 1.0
            damping, growth = damping * max(LEAST_FACTOR, 1.0 - (2.0 * min(ratio, 1.0) - 1.0) ** 3), GROWTH
            point = trial
            continue
        damping, growth = max(damping, FIRST_DAMPING) * growth, GROWTH * growth
        if damping > MOST_DAMPING:
            break
    return point, iteration


def _restored(point: _Point, kept: np.ndarray, solver) -> _Point:
    """Point after steps on the levels before alone, until these are kept: a step along their null space leaves it."""
    for _ in range(RESTORATIONS):
        if not np.isfinite(point.costs).all() or point.keeps(kept):
            break
        point = point.moved(point.step(kept.size, 0.0, solver)[0])
    return point


def _tried(problem: TargetProblem, state: State, away: np.ndarray, solver) -> tuple[_Point, int] | None:
    """Outcome of a search from a displaced state (displacement in units); None where it ends in an error."""
    system = problem.system
    try:
        moved = retract(system, state.q, system.scale.coordinates * away)
        begin = system.initial_state(moved) if system.has_closures else replace(state, q=moved)
        return _descended(problem, _within(problem, begin), solver)
    except GaussError:
        return None


def _better(best: tuple[_Point, int], other: tuple[_Point, int] | None) -> tuple[_Point, int]:
    """The outcome of less costs in the first level that differs, with the steps of both."""
    if other is None:
        return best
    off = best[0].problem.costs_of_round_off
    pairs = zip([best[0].violation, *best[0].costs], [other[0].violation, *other[0].costs], [0.0, *off], strict=True)
    gains = [mine - its for mine, its, rounded in pairs if abs(mine - its) > KEPT_COST * mine + rounded]
    return (other[0] if gains and gains[0] > 0.0 else best[0]), best[1] + other[1]


def _off(rows) -> np.ndarray:
    """Largest error of each target, in units."""
    return np.array([np.abs(one.error / one.units).max(initial=0.0) for one in rows])


def _is_met(point: _Point, tolerance: float) -> bool:
    """Whether the targets of the first level are met."""
    problem = point.problem
    first = np.array([target.level == problem.depths[0] for target in problem.targets])
    return bool((_off(point.rows)[first] <= tolerance).all())


def _result(point: _Point, iterations: int, tolerance: float) -> InverseKinematics:
    problem, rows = point.problem, point.rows
    names = [target.label for target in problem.targets]
    unmet = [k for k, off in enumerate(_off(rows)) if not off <= tolerance]
    found = {names[k]: obstacles(problem, point.state, rows, point.N, k) for k in unmet}
    errors = {name: one.error for name, one in zip(names, rows, strict=True)}
    return InverseKinematics(
        point.state, errors, tuple(names[k] for k in unmet), found, _is_met(point, tolerance), iterations
    )
