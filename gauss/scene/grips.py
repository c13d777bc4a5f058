"""Grips: constraints on a rate that hold with a limited force, and slip when it takes more: dry friction, limited drives."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

from gauss.errors import SceneError
from gauss.scene import values
from gauss.scene.relation import Relation


@dataclass(frozen=True)
class Grip(Relation):
    """Constraint on the rate of a joint that holds as long as its force stays within a limit.

    Its compulsion has the further term limit · |q̈ − ẇ| while the rate is w: the force is a multiplier between −limit and
    limit. Once the rate differs from w, it is a force of that size against the difference.

    Parameters
    ----------
    name : str
        Name of the grip.
    joint : str
        Joint of one freedom, or one rate of a joint, e.g. "wrist.angle1".
    limit : float
        Largest torque or force [N m, N].
    """

    joint: str
    limit: float

    joints: ClassVar[tuple[str, ...]] = ("joint",)
    kind: ClassVar[str] = "grip"
    lossy: ClassVar[bool] = True  # whether its work is heat, or work of a drive

    def __post_init__(self):
        """Check every value."""
        values.text(self.name, f"name of a {self.kind}")
        self._keep(limit=values.number(self.limit, f"{self.what}: limit", "N m or N", positive=True))

    @property
    def what(self) -> str:
        """How an error message calls it."""
        return f"{self.kind} {self.name!r}"

    def rate(self, t):
        """Rate w [rad/s, m/s] that it holds."""
        return 0.0

    def velocities(self, at) -> list:
        """Rate − w."""
        return [at.rate(self.joint) - self.rate(at.t)]


@dataclass(frozen=True)
class JointFriction(Grip):
    """Dry friction of a joint: it sticks as long as ``limit`` holds it, and resists its motion with ``limit``."""

    kind: ClassVar[str] = "joint friction"


@dataclass(frozen=True)
class LimitedDrive(Grip):
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
    grip : Grip
        The grip.
    sign : int
        Of its force: against the sliding.
    """

    name: str
    grip: Grip
    sign: int

    def __post_init__(self):
        """Check the sign."""
        if self.sign not in (-1, 1):
            raise SceneError(f"slipping {self.name!r}: its sign is −1 or 1, got {self.sign!r}.")
