"""First guesses of a motion on a mesh: straight lines between the ends, along the constraints, or a motion that is given."""

import numpy as np

from gauss.analysis.loop_closure import followed
from gauss.analysis.optimal.equations import OptimalEquations
from gauss.analysis.optimal.problem import MotionValues
from gauss.analysis.optimal.result import OptimalMotion
from gauss.errors import ArgumentError, require
from gauss.simulation.trajectory import Trajectory
from gauss.system import State, System


def first_guess(
    equations: OptimalEquations,
    given,
    ends: tuple[State, State],
    led: list[int],
    mesh: np.ndarray,
    duration: float,
    stages: int,
) -> MotionValues:
    """Values on a mesh.

    ArgumentError if the motion is none of this system.

    Parameters
    ----------
    given : OptimalMotion, Trajectory or None
        A motion of the same system; None for straight lines.
    ends : tuple of State
        States near start and end.
    led : list of int
        Coordinates that are fixed at the end; with loops the others follow.
    mesh : ndarray, shape (n + 1,)
        Mesh from 0 to 1.
    duration : float
        Duration [s].
    stages : int
        Collocation points of an interval.
    """
    if given is None:
        states = _line(equations.system, *ends, led, mesh, duration)
        x = np.array([equations.shares(state) for state in states]).T
        return _sampled(mesh, x, np.zeros((2, equations.n_u, len(mesh) - 1)), duration).on(mesh, stages)
    require(given, (OptimalMotion, Trajectory), "optimal motion: guess")
    if given.system.coordinates != equations.system.coordinates:
        raise ArgumentError("optimal motion: guess: expected a motion of this scene; its coordinates are others.")
    kept = np.concatenate([[True], np.diff(given.t) > 0.0])
    t = given.t[kept]
    x = (np.concatenate([given.q, given.v], axis=1)[kept] / equations.units).T
    u = np.zeros((2, equations.n_u, len(t) - 1))
    if isinstance(given, OptimalMotion):
        inside = 1e-9 * np.diff(t)  # inputs may jump at mesh points
        u = np.array([given.law(t[:-1] + inside).T, given.law(t[1:] - inside).T]) / equations.input_units[:, None]
    own = (t - t[0]) / (t[-1] - t[0])
    return _sampled(own, x, u, duration).on(mesh, stages)


def _sampled(mesh: np.ndarray, x: np.ndarray, u: np.ndarray, duration: float) -> MotionValues:
    """Values with one collocation point in the middle of each interval."""
    return MotionValues(mesh, x, ((x[:, :-1] + x[:, 1:]) / 2.0)[None], u, duration)


def _line(system: System, start: State, end: State, led: list[int], shares: np.ndarray, duration: float) -> list[State]:
    """States from start to end, with coordinates linear in time, loops closed; at rest if nothing leads them."""
    if system.has_closures:
        states, _ = followed(system, start, {place: end.q[place] for place in led}, shares)
    else:
        states = [State(start.t, _unit(system, start.q + share * (end.q - start.q)), start.v) for share in shares]
    slopes = np.gradient(np.array([state.q for state in states]), shares * duration, axis=0)
    rates = [start.v, *(_rates(system, row) for row in slopes[1:-1]), end.v]
    return [State(state.t, state.q, v) for state, v in zip(states, rates, strict=True)]


def _unit(system: System, q: np.ndarray) -> np.ndarray:
    """Coordinates with quaternions of unit length."""
    for place in system.quaternions.values():
        q[place] = q[place] / np.linalg.norm(q[place])
    return q


def _rates(system: System, slopes: np.ndarray) -> np.ndarray:
    """Rates whose coordinates change as given; zero where these are quaternions."""
    found = np.zeros(system.n_v)
    for joint in system.joints:
        plain = joint.pair.n_v if joint.pair.quaternion is None else joint.pair.quaternion
        found[joint.v.start : joint.v.start + plain] = slopes[joint.q.start : joint.q.start + plain]
    return found
