"""Bilateral constraints beyond the joints: residuals φ(q, t) = 0 or linear in velocities; rows follow by differentiation."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from gauss.errors import SceneError
from gauss.scene import values


@dataclass(frozen=True)
class Relation:
    """Constraint between bodies, coordinates and time.

    A kind of relation gives ``positions`` (holonomic), ``velocities`` (nonholonomic), or both. They are called with
    a view of the mechanism: ``at.position(body, point)``, ``at.rotation(body)``, ``at.coordinate(joint)``, ``at.t``, and
    for velocities ``at.velocity(body, point)``, ``at.angular_velocity(body)``, ``at.rate(joint)``.

    Parameters
    ----------
    name : str
        Name of the constraint.
    """

    name: str

    # Names of fields that hold a body or frame, a joint or coordinate, or a shape: the scene checks that these exist.
    frames: ClassVar[tuple[str, ...]] = ()
    joints: ClassVar[tuple[str, ...]] = ()
    shapes: ClassVar[tuple[str, ...]] = ()
    may_be_idle: ClassVar[bool] = False  # whether a row may depend on nothing, as one that a condition switches off

    def positions(self, at) -> list:
        """Residuals of positions and time [m, rad]."""
        return []

    def velocities(self, at) -> list:
        """Residuals linear in velocities [m/s, rad/s]."""
        return []

    @property
    def what(self) -> str:
        """Its name in messages."""
        return f"{values.kind(self)} {self.name!r}"

    @property
    def loses(self) -> bool:
        """Whether it is non-ideal: its reactions differ in direction from its rows, and lose power."""
        return False


@dataclass(frozen=True)
class Constraint(Relation):
    """Constraint of your own, written as functions of a view of the mechanism.

    Parameters
    ----------
    name : str
        Name of the constraint.
    position : callable, optional
        ``position(at)`` returns one or several residuals, of positions, coordinates and ``at.t``.
    velocity : callable, optional
        ``velocity(at)`` returns one or several residuals, linear in velocities.

    Notes
    -----
    Both are differentiated exactly, so they are written with arithmetic, numpy, or :mod:`gauss.math`. Where a motion crosses
    a condition on the state at which a position residual jumps, :func:`gauss.simulate` refuses it with the place, the time
    and the size of the jump; a kink, at which velocities jump, is located and is an impact, an event of the trajectory.
    """

    position: Callable | None = None
    velocity: Callable | None = None

    def __post_init__(self):
        what = f"constraint {values.text(self.name, 'name of a constraint')!r}"
        if self.position is None and self.velocity is None:
            raise SceneError(f"{what}: give position= or velocity=, a function that returns what must be zero.")
        for key in ("position", "velocity"):
            function = getattr(self, key)
            if function is not None and not callable(function):
                raise SceneError(f"{what}: {key} must be a function of a view of the mechanism, got {function!r}.")

    def positions(self, at) -> list:
        """Residuals of the user's function."""
        return _entries(self.position, at)

    def velocities(self, at) -> list:
        """Residuals of the user's function."""
        return _entries(self.velocity, at)


def _entries(function, at) -> list:
    return [] if function is None else list(np.ravel(np.asarray(function(at), dtype=object)))
