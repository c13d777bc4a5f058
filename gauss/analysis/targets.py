"""Targets of inverse kinematics for poses, points, distances, the centre of mass and coordinates.

The error of a rotation is the rotation vector θ = log(R_target Rᵀ) in world axes; its Jacobian is J_r⁻¹(θ) J_ω with the
right Jacobian of the rotation group, and A ξ = e is a step of Gauss–Newton (Siciliano, Sciavicco, Villani, Oriolo,
Robotics, 2009, sec. 3.7; Solà, Deray, Atchuthan, A micro Lie theory for state estimation in robotics, 2018, eq. 144).
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from numbers import Real

import numpy as np

from gauss import rotations
from gauss.analysis.target import PositionTarget, Target, TargetRows
from gauss.arguments import named_arguments
from gauss.errors import ArgumentError, StateError
from gauss.scene import values
from gauss.system import State, System

COINCIDENT = 1e-12  # distance of two points relative to the length of the scene, below which it has no direction


@named_arguments
@dataclass(frozen=True)
class PoseTarget(Target):
    """Target of the pose of a frame: its position, its rotation, or both.

    Parameters
    ----------
    frame : str
        Body or named frame.
    position : array_like, shape (3,), optional
        Position of its origin in world [m].
    rotation : array_like, optional
        Rotation from the frame to world: (roll, pitch, yaw) [rad], quaternion (w, x, y, z) or matrix (3, 3).
    rotation_weight : float, optional
        Weight of the rotation; ``weight`` when not given.
    velocity : array_like, shape (6,)
        Angular velocity [rad/s] and velocity [m/s] of a moving target, in world axes.
    weight, level, gain, name
        As of every target, see :class:`gauss.analysis.Target`.

    Raises
    ------
    ArgumentError
        If neither position nor rotation is given, or a gain or level is none.
    SceneError
        If numbers are of a wrong shape or not finite.
    """

    frame: str
    position: tuple | None = None
    rotation: tuple | None = None
    rotation_weight: float | None = field(default=None, kw_only=True)
    velocity: tuple = field(default=(0.0,) * 6, kw_only=True)

    def check(self):
        """Check the values of this kind of target."""
        if self.position is None and self.rotation is None:
            raise ArgumentError(f"{self.label}: give position=, rotation= or both.")
        if self.position is not None:
            values.keep(self, position=values.vector(self.position, f"{self.label}: position", "m"))
        if self.rotation is not None:
            values.keep(self, rotation=values.rotation(self.rotation, f"{self.label}: rotation"))
        if self.rotation_weight is not None:
            weight = values.number(self.rotation_weight, f"{self.label}: rotation_weight", "1", positive=True)
            values.keep(self, rotation_weight=weight)
        values.keep(self, velocity=values.vector(self.velocity, f"{self.label}: velocity", "rad/s and m/s", 6))

    @property
    def subject(self) -> str:
        """What it is a target of, in words."""
        kind = "position" if self.rotation is None else "rotation" if self.position is None else "pose"
        return f"{kind} of {self.frame}"

    def functions(self, system: System) -> tuple[str, ...]:
        """Names of the functions of the state that its rows are made of."""
        return _of_frame(system, self.frame)

    def rows(self, system: System, q: np.ndarray, found: dict) -> TargetRows:
        """Rows of the rotation, then of the position."""
        R, p = found[f"forward_kinematics:{self.frame}"]
        J = found[f"jacobian:{self.frame}"]
        errors, slopes, units, weights = [], [], [], []
        if self.rotation is not None:
            theta = rotations.to_rotation_vector(values.rotation_matrix(self.rotation) @ R.T)
            errors.append(theta)
            slopes.append(np.array([rotations.rotation_vector_rate(theta, column) for column in J[:3].T]).T)
            units.append(np.ones(3))
            weights.append(np.full(3, self.rotation_weight or self.weight))
        if self.position is not None:
            errors.append(np.array(self.position) - p)
            slopes.append(J[3:])
            units.append(np.full(3, system.scale.length))
            weights.append(np.full(3, self.weight))
        return TargetRows(*(np.concatenate(parts) for parts in (errors, slopes, units, weights)))

    def rate(self, errors: np.ndarray) -> np.ndarray:
        """Rate (m,) of the target itself, of the rotation vector first."""
        parts, v = [], np.array(self.velocity)
        if self.rotation is not None:
            parts.append(rotations.rotation_vector_rate(-errors[:3], v[:3]))
        if self.position is not None:
            parts.append(v[3:])
        return np.concatenate(parts)


@named_arguments
@dataclass(frozen=True)
class PointTarget(PositionTarget):
    """Target of the position of a point of a body.

    Parameters
    ----------
    frame : str
        Body or named frame.
    position : array_like, shape (3,)
        Position of the point in world [m].
    at : array_like, shape (3,)
        The point, in the frame [m].
    along : array_like, shape (k, 3)
        Directions in world in which the position counts; all three when not given.
    velocity : array_like, shape (3,)
        Velocity of a moving target in world [m/s].
    weight, level, gain, name
        As of every target, see :class:`gauss.analysis.Target`.

    Raises
    ------
    ArgumentError, SceneError
        If a value is none.
    """

    frame: str
    position: tuple
    at: tuple = (0.0, 0.0, 0.0)

    def check(self):
        """Check the values of this kind of target."""
        self.check_vectors("position", "at")

    @property
    def subject(self) -> str:
        """What it is a target of, in words."""
        return f"point of {self.frame}"

    def functions(self, system: System) -> tuple[str, ...]:
        """Names of the functions of the state that its rows are made of."""
        return _of_frame(system, self.frame)

    def rows(self, system: System, q: np.ndarray, found: dict) -> TargetRows:
        """Rows along the directions."""
        place, J = _point(found, self.frame, self.at)
        return self.rows_along(system, np.array(self.position) - place, J)


@named_arguments
@dataclass(frozen=True)
class DistanceTarget(Target):
    """Target of the distance of two points.

    Parameters
    ----------
    frame, other : str
        Bodies or named frames; "ground" for a point in the world.
    length : float
        Distance [m].
    at, other_at : array_like, shape (3,)
        The points, in their frames [m].
    weight, level, gain, name
        As of every target, see :class:`gauss.analysis.Target`.

    Raises
    ------
    ArgumentError, SceneError
        If a value is none.
    """

    frame: str
    other: str
    length: float
    at: tuple = (0.0, 0.0, 0.0)
    other_at: tuple = (0.0, 0.0, 0.0)

    def check(self):
        """Check the values of this kind of target."""
        values.keep(self, length=values.number(self.length, f"{self.label}: length", "m", positive=True))
        for key in ("at", "other_at"):
            values.keep(self, **{key: values.vector(getattr(self, key), f"{self.label}: {key}", "m")})

    @property
    def subject(self) -> str:
        """What it is a target of, in words."""
        return f"distance of {self.frame} and {self.other}"

    def functions(self, system: System) -> tuple[str, ...]:
        """Names of the functions of the state that its rows are made of."""
        return _of_frame(system, self.frame) + _of_frame(system, self.other)

    def rows(self, system: System, q: np.ndarray, found: dict) -> TargetRows:
        """One row; points that coincide are moved apart along x."""
        place, J = _point(found, self.frame, self.at)
        other, K = _point(found, self.other, self.other_at)
        apart = place - other
        distance = float(np.linalg.norm(apart))
        near = distance <= COINCIDENT * system.scale.length
        direction = np.eye(3)[0] if near else apart / distance
        return self.of_lengths(system, np.array([self.length - distance]), direction[None] @ (J - K))


@named_arguments
@dataclass(frozen=True)
class CenterOfMassTarget(PositionTarget):
    """Target of the centre of mass of all bodies.

    Parameters
    ----------
    position : array_like, shape (3,)
        Position in world [m].
    along : array_like, shape (k, 3)
        Directions in world in which the position counts; all three when not given.
    velocity : array_like, shape (3,)
        Velocity of a moving target in world [m/s].
    weight, level, gain, name
        As of every target, see :class:`gauss.analysis.Target`.

    Raises
    ------
    ArgumentError, SceneError
        If a value is none.
    """

    position: tuple

    def check(self):
        """Check the values of this kind of target."""
        self.check_vectors("position")

    @property
    def subject(self) -> str:
        """What it is a target of, in words."""
        return "centre of mass"

    def functions(self, system: System) -> tuple[str, ...]:
        """Names of the functions of the state that its rows are made of."""
        if not system.Phi[3::6].any():
            raise StateError(f"{self.label}: no body of scene {system.scene.name!r} has a mass.")
        return "center_of_mass", "momentum_matrix"

    def rows(self, system: System, q: np.ndarray, found: dict) -> TargetRows:
        """Rows along the directions: the momentum over the mass is the velocity of the centre of mass."""
        J = found["momentum_matrix"][3:] / system.Phi[3::6].sum()
        return self.rows_along(system, np.array(self.position) - found["center_of_mass"], J)


@named_arguments
@dataclass(frozen=True)
class PostureTarget(Target):
    """Target of coordinates: of those named, or of a whole state.

    Parameters
    ----------
    coordinates : dict or State
        Coordinates [rad, m] by joint of one freedom, or by rate, e.g. "U.angle1"; or a state, for all of them.
    weight, level, gain, name
        As of every target, see :class:`gauss.analysis.Target`.

    Raises
    ------
    ArgumentError
        If it is neither a dictionary of numbers nor a state.
    """

    coordinates: Mapping[str, float] | State

    def check(self):
        """Check the values of this kind of target."""
        if isinstance(self.coordinates, State):
            return
        if not isinstance(self.coordinates, Mapping) or not self.coordinates:
            raise ArgumentError(f"{self.label}: expected coordinates by name, or a State, got {self.coordinates!r}.")
        for name, value in self.coordinates.items():
            if isinstance(value, bool) or not isinstance(value, Real) or not np.isfinite(value):
                raise ArgumentError(f"{self.label}: expected a number for {name!r} [rad, m], got {value!r}.")

    @property
    def subject(self) -> str:
        """What it is a target of, in words."""
        return "posture"

    def functions(self, system: System) -> tuple[str, ...]:
        """No functions of the state; names are checked."""
        self.columns(system)
        return ()

    def columns(self, system: System) -> list[int]:
        """Places of its coordinates in v.

        Raises
        ------
        StateError
            If a name is none of the system, or of more than one freedom, or the state is of another system.
        """
        if isinstance(self.coordinates, State):
            system.state(self.coordinates.q)
            return list(range(system.n_v))
        for name in self.coordinates:
            joint, rate = system.coordinate(name)
            joint.plain(rate or 0)
            if rate is None and joint.pair.n_v != 1:
                raise StateError(f"{self.label}: joint {name!r} has {joint.pair.n_v} freedoms; name one rate of it.")
        return [system.column(name) for name in self.coordinates]

    def rows(self, system: System, q: np.ndarray, found: dict) -> TargetRows:
        """A row for each coordinate; of quaternions the rotation vector in the axes of the child."""
        columns = self.columns(system)
        if isinstance(self.coordinates, State):
            error, A = _displacement(system, q, self.coordinates.q)
            return TargetRows(error, A, system.scale.coordinates, np.full(error.size, self.weight))
        apart = [value - q[system.entry(name)] for name, value in self.coordinates.items()]
        weights = np.full(len(columns), self.weight)
        return TargetRows(np.array(apart), np.eye(system.n_v)[columns], system.scale.coordinates[columns], weights)


def _of_frame(system: System, frame: str) -> tuple[str, ...]:
    system.frame(frame)
    return f"forward_kinematics:{frame}", f"jacobian:{frame}"


def _point(found: dict, frame: str, at: tuple) -> tuple[np.ndarray, np.ndarray]:
    """Position (3,) and Jacobian (3, n_v) of a point of a frame."""
    (R, p), J = found[f"forward_kinematics:{frame}"], found[f"jacobian:{frame}"]
    arm = R @ np.array(at)
    return p + arm, J[3:] - rotations.skew(arm) @ J[:3]


def _displacement(system: System, q: np.ndarray, goal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Displacement (n_v,) along the rates from q to a goal, and its Jacobian (n_v, n_v)."""
    error, A = np.zeros(system.n_v), np.eye(system.n_v)
    for joint in system.joints:
        k = joint.pair.n_v if joint.pair.quaternion is None else joint.pair.quaternion
        here, there = q[joint.q], goal[joint.q]
        error[joint.v.start : joint.v.start + k] = there[:k] - here[:k]
        if joint.pair.quaternion is not None:
            place = slice(joint.v.start + k, joint.v.stop)
            turn = rotations.multiply(rotations.conjugate(here[k:]), there[k:])
            theta = rotations.to_rotation_vector(rotations.from_quaternion(turn))
            error[place] = theta
            A[place, place] = np.array([rotations.rotation_vector_rate(-theta, axis) for axis in np.eye(3)]).T
    return error, A
