"""One-sided constraints: a gap that must not become negative, written once; its rows follow by differentiation.

A gap d of positions and time is open (d > 0: nothing acts) or closed (d = 0: what pushes it open may act, nothing else).
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from gauss.errors import SceneError
from gauss.scene import values
from gauss.scene.contact_distances import Place
from gauss.scene.relation import Relation


@dataclass(frozen=True)
class OneSided(Relation):
    """One-sided constraint between bodies or coordinates.

    A kind gives ``gaps``, called with the same view of the mechanism as the residuals of a :class:`Relation`.

    Parameters
    ----------
    name : str
        Name of the constraint.

    Notes
    -----
    Every kind has a ``restitution`` e: a gap that closes with the speed s opens again with the speed e s (Newton).
    """

    restitution = 0.0  # a field of every kind, at the end of its own

    def gaps(self, at) -> list:
        """Gaps that must not become negative, of positions and time [m, rad]."""
        raise NotImplementedError

    def position_residual_of(self, at, index: int):
        """One of the gaps."""
        return self.gaps(at)[index]

    def fixed(self, at, index: int) -> Place | None:
        """Features that touch at a gap and stay the same while it is closed; None of a gap that knows only one pair."""
        return None

    def sides(self, scene) -> tuple[str, ...]:
        """Names of the gaps that it has in a scene."""
        return (self.name,)

    def positions(self, at) -> list:
        """Gaps: what is zero while all of them are closed."""
        return self.gaps(at)

    def _keep_restitution(self):
        e = values.number(self.restitution, f"{self.what}: restitution", "1", non_negative=True)
        if e > 1.0:
            raise SceneError(f"{self.what}: restitution is the ratio of speeds after and before an impact, 0 to 1, got {e}.")
        self._keep(restitution=e)


@dataclass(frozen=True)
class Side(Relation):
    """One gap of a one-sided constraint, as a constraint of its own: what it is while it is closed.

    Parameters
    ----------
    name : str
        Name of the gap.
    whole : OneSided
        What it belongs to.
    index : int
        Which of its gaps it is.
    place : Place, optional
        Features that touch, where they must not change.
    """

    whole: OneSided
    index: int
    place: Place | None = None

    def positions(self, at) -> list:
        """Gap."""
        return [self.whole.position_residual_of(at, self.index) if self.place is None else self.place.touch(at).gap]


@dataclass(frozen=True)
class Stop(OneSided):
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
        """Check every value."""
        values.text(self.name, "name of a stop")
        for key in ("lowest", "highest"):
            if getattr(self, key) is not None:
                self._keep(**{key: values.number(getattr(self, key), f"{self.what}: {key}", "rad or m")})
        if self.lowest is None and self.highest is None:
            raise SceneError(f"{self.what}: give lowest=, highest= or both [rad, m].")
        if None not in (self.lowest, self.highest) and self.lowest >= self.highest:
            raise SceneError(f"{self.what}: lowest {self.lowest} must be below highest {self.highest}.")
        self._keep_restitution()

    def sides(self, scene) -> tuple[str, ...]:
        """Names of the stops that there are."""
        given = {"lowest": self.lowest, "highest": self.highest}
        return tuple(f"{self.name}.{key}" for key, value in given.items() if value is not None)

    def gaps(self, at) -> list:
        """Distance of the coordinate from the stops."""
        q = at.coordinate(self.joint)
        below = [] if self.lowest is None else [q - self.lowest]
        return below + ([] if self.highest is None else [self.highest - q])


@dataclass(frozen=True)
class OneSidedConstraint(OneSided):
    """One-sided constraint of your own, written as a function of a view of the mechanism.

    Parameters
    ----------
    name : str
        Name of the constraint.
    gap : callable
        ``gap(at)`` returns one number that must not become negative, of positions, coordinates and ``at.t``.
    restitution : float
        Speed after an impact over that before it, 0 to 1.

    Notes
    -----
    The function is differentiated exactly, so it is written with arithmetic, numpy, or :mod:`gauss.math`.
    """

    gap: Callable
    restitution: float = 0.0

    def __post_init__(self):
        """Check every value."""
        values.text(self.name, "name of a one-sided constraint")
        if not callable(self.gap):
            raise SceneError(f"{self.what}: gap must be a function of a view of the mechanism, got {self.gap!r}.")
        self._keep_restitution()

    @property
    def what(self) -> str:
        """How an error message calls it."""
        return f"one-sided constraint {self.name!r}"

    def gaps(self, at) -> list:
        """Value of the user's function."""
        found = np.ravel(np.asarray(self.gap(at), dtype=object))
        if len(found) != 1:
            raise SceneError(f"{self.what}: gap must return one number, got {len(found)}; add one constraint for each.")
        return list(found)
