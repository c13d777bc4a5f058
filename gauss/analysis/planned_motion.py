"""Motions of coordinates within limits of speed and acceleration: from state to state, or through via points.

A planned motion is a piecewise polynomial of time for each coordinate, at rest before its begin and after its end: a law
that drives trace, samples for trajectories, and consistent states and accelerations where other coordinates follow.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from gauss import math
from gauss.analysis.loop_closure import closed, with_rates
from gauss.analysis.tangents import Tangents
from gauss.analysis.target_problem import positive_values
from gauss.analysis.time_scaling import REST_LENGTH, along_lines, extremes, through_points
from gauss.arguments import LARGEST_FLOAT, named_arguments, real_array
from gauss.codegen import Expression
from gauss.dynamics.assemble import assemble_motion
from gauss.dynamics.kinematics import kinematics
from gauss.dynamics.loads import Applied
from gauss.dynamics.projection import (
    fixed_columns,
    held_factor,
    limits,
)
from gauss.dynamics.scene_compilation import system_of
from gauss.errors import ArgumentError, SimulationError, StateError, did_you_mean, require
from gauss.scene import Scene
from gauss.simulation.trajectory import Trajectory
from gauss.system import State, System, retract

if TYPE_CHECKING:
    from scipy.interpolate import PPoly
else:
    PPoly = object

SHAPES = ("trapezoid", "s-curve", "cubic", "quintic")
SAMPLES = 201  # of a trajectory, when no times are given
LIMIT_ROUNDING = 1e-9  # relative excess over a limit that is round-off


@dataclass(frozen=True)
class PlannedMotion:
    """Motion of some coordinates, as functions of time.

    Parameters
    ----------
    coordinates : tuple of str
        Names, as in ``System.coordinates``.
    law : scipy.interpolate.PPoly
        Their values (n,) [rad, m] at a time [s].

    Examples
    --------
    >>> import gauss
    >>> arm = gauss.load("double_pendulum")
    >>> move = gauss.plan_motion(arm, [{"A": 0.0, "B": 0.0}, {"A": 1.0, "B": -0.5}], speeds=1.0, accelerations=2.0)
    >>> round(move.duration, 9), round(float(move.rate(0.75)[0]), 9)
    (1.5, 1.0)
    >>> drives = [arm.drive(name, angle=move[name]) for name in move.coordinates]
    """

    coordinates: tuple[str, ...]
    law: PPoly

    @property
    def begin(self) -> float:
        """When it begins [s]."""
        return float(self.law.x[1])

    @property
    def end(self) -> float:
        """When it ends [s]."""
        return float(self.law.x[-2])

    @property
    def duration(self) -> float:
        """How long it takes [s]."""
        return self.end - self.begin

    def __getitem__(self, name: str) -> PPoly:
        """Law of one coordinate, for ``scene.drive(joint, position=…)``.

        Raises
        ------
        StateError
            If it is none of the motion.
        """
        from scipy.interpolate import PPoly as Piecewise

        if name not in self.coordinates:
            raise StateError(f"no coordinate {name!r} in this motion. {did_you_mean(str(name), self.coordinates)}")
        return Piecewise(self.law.c[:, :, self.coordinates.index(name)], self.law.x)

    def position(self, t) -> np.ndarray:
        """Coordinates (…, n) [rad, m] at a time or times [s]; traced at a traced time."""
        return self._at(self.law, t)

    def rate(self, t) -> np.ndarray:
        """Rates (…, n) [rad/s, m/s] at a time or times [s]; traced at a traced time."""
        return self._at(self.law.derivative(1), t)

    def acceleration(self, t) -> np.ndarray:
        """Accelerations (…, n) [rad/s², m/s²] at a time or times [s]; traced at a traced time."""
        return self._at(self.law.derivative(2), t)

    @staticmethod
    def _at(law: PPoly, t) -> np.ndarray:
        if isinstance(t, Expression):
            return math.piecewise(law, t)
        return law(np.clip(t, law.x[1] - REST_LENGTH / 2.0, law.x[-2] + REST_LENGTH / 2.0))

    def states(self, system: System, times, start: State | None = None) -> list[State]:
        """Consistent states at times; other coordinates follow by the constraints, or stay.

        Parameters
        ----------
        system : System
            The system.
        times : array_like, shape (k,)
            Times [s].
        start : State, optional
            Guess of the other coordinates at the first time; the start of the scene when not given.

        Returns
        -------
        list of State
            States, with rates.

        Raises
        ------
        SimulationError
            If the constraints allow no such state, with the time.
        StateError
            If the system has no such coordinates.
        """
        require(system, (System,), "states")
        held = fixed_columns(system, self.coordinates)
        places = [system.entry(name) for name in self.coordinates]
        state = system.initial_state() if start is None else start
        found = list[State]()
        for t in np.atleast_1d(real_array(times, "times", "times [s]")):
            q, v = state.q.copy(), np.zeros(system.n_v)
            if system.has_closures and found:
                q = _predicted(system, state, held, self.position(t) - q[places])
            q[places], v[held] = self.position(t), self.rate(t)
            state = State(float(t), q, v)
            if system.has_closures:
                state = _closed(system, state, held, not found)
            found.append(state)
        return found

    def trajectory(self, system: System, times=None, start: State | None = None) -> Trajectory:
        """Trajectory of consistent states, for figures, films and forces.

        Parameters
        ----------
        system : System
            The system.
        times : array_like, shape (k,), optional
            Times [s]; 201 from begin to end when not given.
        start : State, optional
            As of :meth:`states`.

        Returns
        -------
        Trajectory
            Its method is "recorded".

        Raises
        ------
        SimulationError, StateError
            As of :meth:`states`.
        """
        t = np.linspace(self.begin, self.end, SAMPLES) if times is None else real_array(times, "times", "times [s]")
        states = self.states(system, t, start)
        return Trajectory.from_coordinates(system, t, [state.q for state in states], [state.v for state in states])

    def accelerations(self, system: System, state: State) -> np.ndarray:
        """Accelerations (n_v,) of all coordinates in a state of the motion, for :func:`gauss.inverse_dynamics`.

        Parameters
        ----------
        system : System
            The system.
        state : State
            One of :meth:`states`.

        Returns
        -------
        ndarray, shape (n_v,)
            They meet the constraints [rad/s², m/s²].
        """
        held, own = fixed_columns(system, self.coordinates), self.acceleration(state.t)
        if system.has_closures:
            motion = kinematics(system, state)
            compulsion = assemble_motion(motion, Applied(motion, ()))
            factor = held_factor(system, compulsion, held)
            return factor.solve(np.zeros(system.Phi.size), compulsion.D, np.zeros(system.n_v), own)[1]
        found = np.zeros(system.n_v)
        found[held] = own
        return found


def _predicted(system: System, state: State, held: list[int], step: np.ndarray) -> np.ndarray:
    """Coordinates after a step of the given ones (n,), to first order along the constraints."""
    N = Tangents(system, state).position
    return retract(system, state.q, N @ np.linalg.lstsq(N[held], step, rcond=None)[0])


def _closed(system: System, state: State, held: list[int], is_first: bool) -> State:
    """State that meets the constraints, with given coordinates and rates."""
    names = [system.coordinates[k] for k in held]
    if is_first:
        state = system.initial_state(state.q, state.v, state.t, keep=names)
    found, is_closed = closed(system, state, held)
    if not is_closed:
        raise SimulationError(
            f"planned motion: at t = {state.t:.6g} s the constraints allow no pose with these values of {', '.join(names)}."
        )
    return with_rates(system, found, held)


@named_arguments
def plan_motion(
    system: System | Scene,
    points: Sequence,
    *,
    speeds: Mapping | float | None = None,
    accelerations: Mapping | float | None = None,
    jerks: Mapping | float | None = None,
    shape: str = "trapezoid",
    coordinates: Sequence[str] | None = None,
    begin: float = 0.0,
) -> PlannedMotion:
    """Motion of coordinates from point to point, as fast as limits allow.

    Parameters
    ----------
    system : System or Scene
        The system.
    points : sequence of dict, or of State
        Two points or more: coordinates by name [rad, m], all with the same names; or states.
    speeds, accelerations, jerks : dict or float, optional
        Largest rates [rad/s, m/s], accelerations [rad/s², m/s²] and jerks [rad/s³, m/s³], by name, or one number for all.
    shape : str
        "trapezoid": straight lines in the space of the coordinates, at rest in every point, in the least time; "s-curve": so
        with bounded jerks; "cubic", "quintic": splines through the points with continuous accelerations, or jerks, at
        rest at both ends, stretched in time until they touch a limit.
    coordinates : sequence of str, optional
        Names of the coordinates that are planned, where points are states: with loops, the driven ones.
    begin : float
        When the motion begins [s].

    Returns
    -------
    PlannedMotion
        Coordinates, rates, accelerations as functions of time.

    Raises
    ------
    ArgumentError
        If points, limits or shape are none, or a coordinate leaves the limits of its joint.
    StateError
        If a name is none of the system, or no coordinate.
    """
    system = system_of(system, "plan_motion")
    if shape not in SHAPES:
        raise ArgumentError(f"plan_motion: no shape {shape!r}. {did_you_mean(str(shape), SHAPES)}")
    _refuse_begin(begin)
    names, values = _points(system, points, coordinates)
    columns = [system.column(name) for name in names]
    given = {"speeds": speeds, "accelerations": accelerations, "jerks": jerks}
    most = [positive_values(system, value, key)[columns] for key, value in given.items()]
    needed = {"trapezoid": 1, "s-curve": 2}
    for key, limit in list(zip(given, most, strict=True))[1 : 1 + needed.get(shape, 0)]:
        if np.isinf(limit).any():
            name = names[int(np.isinf(limit).argmax())]
            raise ArgumentError(f"plan_motion: a {shape} needs {key}=, for {name!r}, too.")
    if not any(np.isfinite(limit).all() for limit in most):
        raise ArgumentError("plan_motion: give speeds= or accelerations= for all coordinates.")
    if shape in needed:
        law = along_lines(values, tuple(most[: needed[shape] + 1]), float(begin))
    else:
        distinct = np.concatenate([[True], (np.diff(values, axis=0) != 0.0).any(axis=1)])
        law = through_points(values[distinct], 3 if shape == "cubic" else 5, tuple(most), float(begin))
    _refuse_beyond(system, names, law)
    return PlannedMotion(names, law)


def _points(system: System, points: Sequence, coordinates) -> tuple[tuple[str, ...], np.ndarray]:
    """Names (n) and values (k, n) of the points."""
    given = list(points) if np.iterable(points) and not isinstance(points, Mapping) else []
    if len(given) < 2:
        raise ArgumentError("plan_motion: expected two points or more, coordinates by name or states.")
    if all(isinstance(point, State) for point in given):
        given = _by_name(system, given, coordinates)
    wrong = [point for point in given if not isinstance(point, Mapping) or set(point) != set(given[0])]
    if wrong or not given[0]:
        raise ArgumentError(f"plan_motion: expected points with the same coordinates, got {[*wrong, given[0]][0]!r}.")
    names = tuple(given[0])
    _values(system, names, system.reference)
    return names, _numbers(names, given)


def _numbers(names: Sequence[str], points: list) -> np.ndarray:
    """Values (k, n) of points that are not all the same."""
    try:
        values = np.array([[float(point[name]) for name in names] for point in points])
    except (TypeError, ValueError):
        values = np.full((1, 1), np.nan)
    if not np.isfinite(values).all():
        raise ArgumentError("plan_motion: expected finite numbers [rad, m] as coordinates of the points.")
    if not (values != values[0]).any():
        raise ArgumentError("plan_motion: all points are the same; there is no motion.")
    return values


def _by_name(system: System, states: list[State], coordinates) -> list[dict[str, float]]:
    """Coordinates of states by name."""
    if coordinates is None and system.has_closures:
        raise ArgumentError("plan_motion: with loops, name the driven coordinates=, from which the others follow.")
    names = tuple(system.coordinates if coordinates is None else coordinates)
    return [dict(zip(names, _values(system, names, state), strict=True)) for state in states]


def _values(system: System, names: Sequence[str], state: State) -> list[float]:
    """Coordinates of a state by names of one freedom each."""
    found = []
    for name in names:
        joint, rate = system.coordinate(name)
        if rate is None and joint.pair.n_v != 1:
            raise StateError(f"plan_motion: joint {name!r} has {joint.pair.n_v} freedoms; name one rate of it.")
        found.append(float(state.q[system.entry(name)]))
    return found


def _refuse_beyond(system: System, names: Sequence[str], law: PPoly):
    """Refuse a law that leaves the limits of a joint."""
    lowest, highest = limits(system)
    for name, low, high in zip(names, *extremes(law), strict=True):
        column = system.column(name)
        room = LIMIT_ROUNDING * system.scale.coordinates[column]
        if low < lowest[column] - room or high > highest[column] + room:
            raise ArgumentError(
                f"plan_motion: {name!r} goes from {low:.6g} to {high:.6g}, beyond the limits of its joint, "
                f"{lowest[column]:.6g} to {highest[column]:.6g}. Shape 'trapezoid' does not overshoot its points."
            )


def _refuse_begin(begin):
    """Raise an ArgumentError if the begin of a motion is no finite time."""
    if isinstance(begin, bool) or not isinstance(begin, float | int) or not abs(begin) <= LARGEST_FLOAT:
        raise ArgumentError(f"plan_motion: begin: expected a finite time [s], got {begin!r:.80}.")
