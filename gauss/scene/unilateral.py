"""Unilateral constraints g_N(q, t) ≥ 0, written once as gap functions; their rows follow by differentiation.

    0 ≤ g_N ⊥ λ_N ≥ 0:   open (g_N > 0, λ_N = 0) or closed (g_N = 0, λ_N ≥ 0)

The notation is that of Brogliato, Nonsmooth Mechanics, ch. 5.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from gauss.errors import SceneError
from gauss.scene import values
from gauss.scene.contact_distances import FeaturePair
from gauss.scene.geometry import Between
from gauss.scene.relation import Relation


@dataclass(frozen=True)
class Unilateral(Relation):
    """Unilateral constraint between bodies or coordinates.

    A kind gives ``gaps``, called with the same view of the mechanism as the residuals of a :class:`Relation`.

    Parameters
    ----------
    name : str
        Name of the constraint.

    Notes
    -----
    Every kind has a coefficient of restitution e: ġ_N after an impact is −e times that before it (Newton).
    """

    restitution = 0.0  # a field of every kind, at the end of its own

    def gaps(self, at) -> list:
        """Gap functions g_N of positions and time [m, rad]."""
        raise NotImplementedError

    def position_residual_of(self, at, index: int):
        """One of the gap functions."""
        return self.gaps(at)[index]

    def fixed(self, at, index: int) -> FeaturePair | None:
        """Pair of features that stays the same while a contact is closed; None where there is only one pair."""
        return None

    def sides(self, scene) -> tuple[str, ...]:
        """Names of its gap functions in a scene."""
        return (self.name,)

    def positions(self, at) -> list:
        """Gap functions, the residuals while all of them are closed."""
        return self.gaps(at)

    def _keep_restitution(self):
        e = values.number(self.restitution, f"{self.what}: restitution", "1", non_negative=True)
        if e > 1.0:
            raise SceneError(f"{self.what}: restitution is the ratio of speeds after and before an impact, 0 to 1, got {e}.")
        values.keep(self, restitution=e)


@dataclass(frozen=True)
class ClosedGap(Relation):
    """One closed gap function of a unilateral constraint, as a bilateral constraint: g_N = 0.

    Parameters
    ----------
    name : str
        Name of the gap function.
    whole : Unilateral
        The constraint.
    index : int
        Index of the gap function.
    place : FeaturePair, optional
        Pair of features that stays the same.
    """

    whole: Unilateral
    index: int
    place: FeaturePair | None = None

    def positions(self, at) -> list:
        """Gap function."""
        return [self.whole.position_residual_of(at, self.index) if self.place is None else self.place.touch(at).gap]


@dataclass(frozen=True)
class Stop(Unilateral):
    """Stops of a joint of one freedom.

    Parameters
    ----------
    name : str
        Name of the stops.
    joint : str
        Joint of one freedom, or one rate of a joint, e.g. "wrist.angle1".
    lowest, highest : float, optional
        Coordinates of the stops [rad, m]; no stop on a side that is not given.
    restitution : float
        Speed after an impact over that before it, 0 to 1.
    """

    joint: str
    lowest: float | None = None
    highest: float | None = None
    restitution: float = 0.0

    joints: ClassVar[tuple[str, ...]] = ("joint",)

    def __post_init__(self):
        values.text(self.name, "name of a stop")
        for key in ("lowest", "highest"):
            if getattr(self, key) is not None:
                values.keep(self, **{key: values.number(getattr(self, key), f"{self.what}: {key}", "rad or m")})
        if self.lowest is None and self.highest is None:
            raise SceneError(f"{self.what}: give lowest=, highest= or both [rad, m].")
        if self.lowest is not None and self.highest is not None and self.lowest >= self.highest:
            raise SceneError(f"{self.what}: lowest {self.lowest} must be below highest {self.highest}.")
        self._keep_restitution()

    def sides(self, scene) -> tuple[str, ...]:
        """Names of the stops that are given."""
        given = {"lowest": self.lowest, "highest": self.highest}
        return tuple(f"{self.name}.{key}" for key, value in given.items() if value is not None)

    @property
    def bounds(self) -> list[tuple[float, float]]:
        """Sign and coordinate [rad, m] of each stop: the gap is sign · (q − coordinate)."""
        given = (1.0, self.lowest), (-1.0, self.highest)
        return [(sign, place) for sign, place in given if place is not None]

    def gaps(self, at) -> list:
        """Distances of the coordinate from the stops."""
        q = at.coordinate(self.joint)
        below = [] if self.lowest is None else [q - self.lowest]
        return below + ([] if self.highest is None else [self.highest - q])


@dataclass(frozen=True)
class OneSidedConstraint(Unilateral):
    """Unilateral constraint of your own, written as a gap function of a view of the mechanism.

    Parameters
    ----------
    name : str
        Name of the constraint.
    gap : callable
        ``gap(at)`` returns g_N, one number of positions, coordinates and ``at.t``.
    restitution : float
        Speed after an impact over that before it, 0 to 1.

    Notes
    -----
    The function is differentiated exactly, so it is written with arithmetic, numpy, or :mod:`gauss.math`.
    """

    gap: Callable
    restitution: float = 0.0

    def __post_init__(self):
        values.text(self.name, "name of a one-sided constraint")
        if not callable(self.gap):
            raise SceneError(f"{self.what}: gap must be a function of a view of the mechanism, got {self.gap!r}.")
        self._keep_restitution()

    @property
    def what(self) -> str:
        """Its name in messages."""
        return f"one-sided constraint {self.name!r}"

    def gaps(self, at) -> list:
        """Value of the user's function."""
        found = np.ravel(np.asarray(self.gap(at), dtype=object))
        if len(found) != 1:
            raise SceneError(f"{self.what}: gap must return one number, got {len(found)}; add one constraint for each.")
        return list(found)


@dataclass(frozen=True)
class Rope(Between, Unilateral):
    """Two points no farther apart than the length of a rope, which pulls when it is taut and has no mass.

    Parameters
    ----------
    length : float, optional
        Length [m]; the distance of the points at the reference configuration when not given.
    restitution : float
        Speed after it jerks taut over that before it, 0 to 1.
    """

    length: float | None = None
    restitution: float = 0.0

    kind: ClassVar[str] = "rope"

    def __post_init__(self):
        super().__post_init__()
        if self.length is not None:
            values.keep(self, length=values.number(self.length, f"{self.what}: length", "m", positive=True))
        self._keep_restitution()

    def gaps(self, at) -> list:
        """(l² − d²)/(2 l): the slack, to first order, without a root."""
        gap, length = self.gap(at), self.length
        if length is None:
            length = self._reference_length(at)
        return [(length * length - gap @ gap) / (2.0 * length)]
