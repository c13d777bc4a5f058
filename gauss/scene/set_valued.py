"""Grips: constraints on a rate that hold with a limited force, and slip when it takes more: dry friction, drives."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

from gauss.errors import SceneError
from gauss.scene import values
from gauss.scene.losses import pushes
from gauss.scene.relation import Relation


@dataclass(frozen=True)
class SetValued(Relation):
    """Constraint on a rate u of joint coordinates that holds as long as its force stays within bounds.

    While u is zero the force is a multiplier between the bounds: the compulsion has the further term that is their support
    function of u̇, limit · |u̇| where they are ±limit. Once u differs from zero, the force is a load against it.

    A kind gives ``acts_on``, ``rate``, ``bounds`` and ``effort``.

    Parameters
    ----------
    name : str
        Name of the grip.
    """

    kind: ClassVar[str] = "grip"
    lossy: ClassVar[bool] = True  # whether its work is heat, or work of a drive
    one_way: ClassVar[bool] = False  # whether u may not be negative
    sticks: ClassVar[bool] = True  # whether it can hold at all

    @property
    def what(self) -> str:
        """How an error message calls it."""
        return f"{self.kind} {self.name!r}"

    @property
    def acts_on(self) -> dict[str, float]:
        """Joints whose rates make up u, and their factors; with these its force acts on them, too."""
        raise NotImplementedError

    def rate(self, t):
        """Rate w [rad/s, m/s] that it holds: u is the rate of its joints less w."""
        return 0.0

    def bounds(self, t: float) -> tuple[float, float]:
        """Least and largest force with which it holds [N m, N]."""
        raise NotImplementedError

    def effort(self, sign: int):
        """Force while it slips [N m, N], a number or a law, where ``sign`` is against the sliding."""
        raise NotImplementedError

    def velocities(self, at) -> list:
        """Rate u."""
        return [sum(factor * at.rate(joint) for joint, factor in self.acts_on.items()) - self.rate(at.t)]


@dataclass(frozen=True)
class JointDryFriction(SetValued):
    """Grip of one joint coordinate, alike both ways.

    Parameters
    ----------
    name : str
        Name of the grip.
    joint : str
        Joint of one freedom, or one rate of a joint, e.g. "wrist.angle1".
    limit : float or callable
        Largest torque or force [N m, N]; of friction that comes and goes a function of time.
    """

    joint: str
    limit: float | Callable

    joints: ClassVar[tuple[str, ...]] = ("joint",)

    def __post_init__(self):
        """Check every value."""
        values.text(self.name, f"name of a {self.kind}")
        if not callable(self.limit):
            self._keep(limit=values.number(self.limit, f"{self.what}: limit", "N m or N", positive=True))
        elif values.arguments(self.limit) != 1:
            count = values.arguments(self.limit)
            raise SceneError(f"{self.what}: a limit is called as limit(t); {self.limit!r} takes {count} arguments.")

    @property
    def acts_on(self) -> dict[str, float]:
        """Its joint."""
        return {self.joint: 1.0}

    def bounds(self, t):
        """Hold up to the limit both ways."""
        limit = limit_at(self.limit, t, self.what)
        return -limit, limit

    def effort(self, sign):
        """The limit."""
        return (lambda t: sign * self.limit(t)) if callable(self.limit) else sign * self.limit


@dataclass(frozen=True)
class JointFriction(JointDryFriction):
    """Dry friction of a joint: it sticks as long as ``limit`` holds it, and resists its motion with ``limit``."""

    kind: ClassVar[str] = "joint friction"


@dataclass(frozen=True)
class LimitedDrive(JointDryFriction):
    """Drive that keeps the rate of a joint as long as that takes no more than its limit.

    Parameters
    ----------
    speed : float or callable
        Rate [rad/s, m/s], a constant or a function of time.
    """

    speed: float | Callable

    kind: ClassVar[str] = "limited drive"
    lossy: ClassVar[bool] = False

    def __post_init__(self):
        """Check every value."""
        super().__post_init__()
        self._keep(speed=values.smooth_law(self.speed, f"{self.what}: speed", "rad/s or m/s"))

    def rate(self, t):
        """Rate w that it holds."""
        return values.evaluate(self.speed, t)


@dataclass(frozen=True)
class Slipping:
    """Load of a grip that slips.

    Parameters
    ----------
    name : str
        Name of the grip.
    grip : SetValued
        The grip.
    sign : int
        Of its force: against the sliding.
    way : int
        Of the power through a grip that loses some: 1 forward, −1 back; 0 where nothing is lost.
    """

    name: str
    grip: SetValued
    sign: int
    way: int = 0

    def __post_init__(self):
        """Check the sign."""
        if self.sign not in (-1, 1):
            raise SceneError(f"slipping {self.name!r}: its sign is −1 or 1, got {self.sign!r}.")

    @property
    def effort(self):
        """Force [N m, N], a number or a law."""
        return self.grip.effort(self.sign)

    @property
    def pushes(self) -> dict[str, float]:
        """Joints that it acts on, and factors of its force."""
        return pushes(self.grip, self.way)


def limit_at(limit, t: float, what: str) -> float:
    """Limit at a time [s], checked.

    Raises
    ------
    SceneError
        If a law gives no limit.
    """
    if not callable(limit):
        return limit
    found = values.evaluated(limit, (t,), f"{what}: limit", 1)[0]
    return values.number(found, f"{what}: limit at t = {t:.6g} s", "N m or N", non_negative=True)
