"""Rheonomic constraints: a joint coordinate, or a point of a body, follows a law of time; its drive force is a reaction."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from gauss.errors import SceneError
from gauss.scene import values
from gauss.scene.relation import Relation


@dataclass(frozen=True)
class Prescribed(Relation):
    """Coordinate of a joint that follows a law of time, whatever force that takes.

    Parameters
    ----------
    name : str
        Name of the drive.
    joint : str
        Joint of one freedom, or one rate of a joint as ``System.coordinates`` names it, e.g. "wrist.angle1".
    position : float, callable or spline, optional
        Angle [rad] or displacement [m] as a function of time.
    speed : float, callable or spline, optional
        Its rate [rad/s, m/s] as a function of time, instead of the position.

    Notes
    -----
    Laws are differentiated exactly: written with arithmetic, numpy or :mod:`gauss.math`, or splines of scipy.

    Where the speed jumps, as at a kink of the position, there is an impact: rates change with least compulsion, and the
    impulse of the drive is in ``trajectory.events``. A jump of the position is refused.
    """

    joint: str
    position: float | Callable | None = None
    speed: float | Callable | None = None

    joints: ClassVar[tuple[str, ...]] = ("joint",)

    def __post_init__(self):
        what = f"drive {values.text(self.name, 'name of a drive')!r}"
        if (self.position is None) == (self.speed is None):
            raise SceneError(f"{what}: give either a position or a speed.")
        if self.position is not None:
            values.keep(self, position=values.smooth_law(self.position, f"{what}: angle or displacement", "rad or m"))
        else:
            values.keep(self, speed=values.smooth_law(self.speed, f"{what}: speed", "rad/s or m/s"))

    def positions(self, at) -> list:
        """Coordinate − law."""
        if self.position is None:
            return []
        return [at.coordinate(self.joint) - values.evaluate(self.position, at.t)]

    def velocities(self, at) -> list:
        """Rate − law."""
        return [] if self.speed is None else [at.rate(self.joint) - values.evaluate(self.speed, at.t)]


@dataclass(frozen=True)
class Guided(Relation):
    """Point of a body that follows a path in the world.

    Parameters
    ----------
    name : str
        Name of the guide.
    body : str
        Body or frame.
    at : array_like, shape (3,)
        The point, in its frame [m].
    path : callable or array_like
        Position (3,) in the world as a function of time [m].
    along : array_like, shape (k, 3)
        Directions in the world in which the point is guided; in the others it is free. All three when not given.
    """

    body: str
    at: tuple = (0.0, 0.0, 0.0)
    path: Callable | tuple = (0.0, 0.0, 0.0)
    along: tuple = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))

    frames: ClassVar[tuple[str, ...]] = ("body",)

    def __post_init__(self):
        what = f"guide {values.text(self.name, 'name of a guide')!r}"
        rows = self.along if np.iterable(self.along) else (self.along,)
        along = tuple(values.direction(row, f"{what}: along") for row in rows)
        values.keep(
            self,
            at=values.vector(self.at, f"{what}: at", "m"),
            path=values.smooth_law(self.path, f"{what}: path", "m", 3),
            along=along,
        )

    def positions(self, at) -> list:
        """Point − path, along each direction."""
        residual = at.position(self.body, self.at) - np.asarray(values.evaluate(self.path, at.t))
        return [values.unit(row) @ residual for row in self.along]
