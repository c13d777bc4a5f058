"""Targets of inverse kinematics in general: errors e(q) and their Jacobians A, ė = −A v, weights, levels, gains."""

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from gauss.errors import ArgumentError
from gauss.scene import values
from gauss.system import System

ALL_AXES = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


class TargetRows(NamedTuple):
    """Rows of a target in one state."""

    error: np.ndarray  # (m,): target less actual value [rad, m]
    jacobian: np.ndarray  # (m, n_v): A in ė = −A v
    units: np.ndarray  # (m,): 1 rad, or the length of the scene [m]
    weights: np.ndarray  # (m,): weights of the squared errors in these units


@dataclass(frozen=True, kw_only=True)
class Target(ABC):
    """What all targets share.

    Parameters
    ----------
    weight : float
        Weight of the squared error among the targets of its level, for errors in radians and lengths of the scene
        (``System.scale.length``).
    level : int
        Priority: targets of level 1 have no influence on those of level 0, and so on.
    gain : float
        Share of the error that one step of :func:`gauss.differential_inverse_kinematics` takes away, 0 to 1.
    name : str, optional
        Name in results; made from the frame when not given.
    """

    weight: float = 1.0
    level: int = 0
    gain: float = 1.0
    name: str = ""

    def __post_init__(self):
        """Check every value."""
        what = self.label
        values.keep(self, weight=values.number(self.weight, f"{what}: weight", "1", positive=True))
        values.keep(self, gain=values.number(self.gain, f"{what}: gain", "1"))
        if not 0.0 <= self.gain <= 1.0:
            raise ArgumentError(f"{what}: gain: expected a share from 0 to 1, got {self.gain}.")
        if isinstance(self.level, bool) or not isinstance(self.level, (int, np.integer)) or self.level < 0:
            raise ArgumentError(f"{what}: level: expected a whole number, 0 for the first, got {self.level!r}.")
        self.check()

    @abstractmethod
    def check(self):
        """Check the values of this kind of target."""

    @property
    @abstractmethod
    def subject(self) -> str:
        """What it is a target of, in words."""

    @property
    def label(self) -> str:
        """Its name in results and messages."""
        return self.name or self.subject

    @abstractmethod
    def functions(self, system: System) -> tuple[str, ...]:
        """Names of the functions of the state that its rows are made of; unknown names are refused."""

    @abstractmethod
    def rows(self, system: System, q: np.ndarray, found: dict) -> TargetRows:
        """Rows at coordinates q, from the results of its functions."""

    def of_lengths(self, system: System, error: np.ndarray, jacobian: np.ndarray) -> TargetRows:
        """Rows whose errors are lengths [m]."""
        return TargetRows(error, jacobian, np.full(error.size, system.scale.length), np.full(error.size, self.weight))

    def rate(self, errors: np.ndarray) -> np.ndarray:
        """Rate (m,) of the target itself; at rest."""
        return np.zeros(errors.size)


@dataclass(frozen=True, kw_only=True)
class PositionTarget(Target):
    """Target of a position, along some directions in world.

    Parameters
    ----------
    along : array_like, shape (k, 3)
        Directions in world in which the position counts; all three when not given.
    velocity : array_like, shape (3,)
        Velocity of a moving target in world [m/s].
    """

    along: tuple = field(default=ALL_AXES)
    velocity: tuple = field(default=(0.0, 0.0, 0.0))

    def check_vectors(self, *names: str):
        """Check the directions, the velocity, and further vectors (3,)."""
        for name in (*names, "velocity"):
            values.keep(self, **{name: values.vector(getattr(self, name), f"{self.label}: {name}", "m")})
        rows = np.atleast_2d(np.asarray(self.along, dtype=object))
        found = [values.unit(values.direction(tuple(row), f"{self.label}: along")) for row in rows]
        values.keep(self, along=tuple(tuple(map(float, row)) for row in found))

    def rows_along(self, system: System, error: np.ndarray, jacobian: np.ndarray) -> TargetRows:
        """Rows of an error (3,) and its Jacobian (3, n_v) along the directions."""
        along = np.array(self.along)
        return self.of_lengths(system, along @ error, along @ jacobian)

    def rate(self, errors: np.ndarray) -> np.ndarray:
        """Rate (m,) of the target itself."""
        return np.array(self.along) @ np.array(self.velocity)
