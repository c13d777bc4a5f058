"""Set-valued force laws of a rate u: dry friction, brakes, limited drives.

    λ ∈ [λ_min, λ_max] while u = 0 (sticking),   λ = λ_slip(−sign u) while u ≠ 0 (slipping)

The notation is that of Brogliato, Nonsmooth Mechanics, ch. 5.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

from gauss.errors import SceneError
from gauss.scene import values
from gauss.scene.losses import joint_factors
from gauss.scene.relation import Relation


@dataclass(frozen=True)
class SetValued(Relation):
    """Set-valued element on a rate u of joint coordinates: it sticks as long as its force stays within bounds.

    While it sticks the force is a multiplier between the bounds: the compulsion has the further term that is their support
    function of u̇, ``limit · |u̇|`` for ±limit. While it slips the force is a load against u.

    A kind gives ``acts_on``, ``rate``, ``bounds`` and ``effort``.

    Parameters
    ----------
    name : str
        Name of the element.
    """

    kind: ClassVar[str] = "set-valued element"
    lossy: ClassVar[bool] = True  # whether its work is heat, not work of a drive
    one_way: ClassVar[bool] = False  # whether u may not be negative
    sticks: ClassVar[bool] = True  # whether it can stick

    @property
    def what(self) -> str:
        """Its name in messages."""
        return f"{self.kind} {self.name!r}"

    @property
    def acts_on(self) -> dict[str, float]:
        """Joints whose rates make up u, with their factors, which are also those of its force on them."""
        raise NotImplementedError

    def rate(self, t):
        """Rate w [rad/s, m/s] while it sticks: u is the rate of its joints less w."""
        return 0.0

    def bounds(self, t: float) -> tuple[float, float]:
        """Least and largest force of sticking [N m, N]."""
        raise NotImplementedError

    def effort(self, sign: int):
        """Force while it slips [N m, N], a number or a law, by ``sign``, that of the force."""
        raise NotImplementedError

    def velocities(self, at) -> list:
        """Rate u."""
        return [sum(factor * at.rate(joint) for joint, factor in self.acts_on.items()) - self.rate(at.t)]


@dataclass(frozen=True)
class JointDryFriction(SetValued):
    """Set-valued element of one joint coordinate, the same in both directions.

    Parameters
    ----------
    name : str
        Name of the element.
    joint : str
        Joint of one freedom, or one rate of a joint, e.g. "wrist.angle1".
    limit : float or callable
        Largest torque or force [N m, N], a number or limit(t).
    """

    joint: str
    limit: float | Callable

    joints: ClassVar[tuple[str, ...]] = ("joint",)

    def __post_init__(self):
        values.text(self.name, f"name of a {self.kind}")
        if not callable(self.limit):
            values.keep(self, limit=values.number(self.limit, f"{self.what}: limit", "N m or N", positive=True))
        elif values.arguments(self.limit) != 1:
            count = values.arguments(self.limit)
            raise SceneError(f"{self.what}: a limit is called as limit(t); {self.limit!r} takes {count} arguments.")

    @property
    def acts_on(self) -> dict[str, float]:
        """Its joint."""
        return {self.joint: 1.0}

    def bounds(self, t):
        """The limit, in both directions."""
        limit = limit_at(self.limit, t, self.what)
        return -limit, limit

    def effort(self, sign):
        """The limit."""
        return (lambda t: sign * self.limit(t)) if callable(self.limit) else sign * self.limit


@dataclass(frozen=True)
class JointFriction(JointDryFriction):
    """Dry (Coulomb) friction of a joint: it sticks up to the force ``limit``, and slips against ``limit``."""

    kind: ClassVar[str] = "joint friction"


@dataclass(frozen=True)
class LimitedDrive(JointDryFriction):
    """Drive that keeps the rate of a joint up to a limit of its force.

    Parameters
    ----------
    speed : float or callable
        Rate [rad/s, m/s], a constant or a function of time.
    """

    speed: float | Callable

    kind: ClassVar[str] = "limited drive"
    lossy: ClassVar[bool] = False

    def __post_init__(self):
        super().__post_init__()
        values.keep(self, speed=values.smooth_law(self.speed, f"{self.what}: speed", "rad/s or m/s"))

    def rate(self, t):
        """Rate w of the drive."""
        return values.evaluate(self.speed, t)


@dataclass(frozen=True)
class Slipping:
    """Load of a set-valued element that slips.

    Parameters
    ----------
    name : str
        Name of the element.
    element : SetValued
        The element.
    sign : int
        Sign of its force, against the sliding.
    power_flow : int
        Direction of power flow through a non-ideal element: 1 forward, −1 back; 0 without losses.
    """

    name: str
    element: SetValued
    sign: int
    power_flow: int = 0

    def __post_init__(self):
        if self.sign not in (-1, 1):
            raise SceneError(f"slipping {self.name!r}: its sign is −1 or 1, got {self.sign!r}.")

    @property
    def effort(self):
        """Force [N m, N], a number or a law."""
        return self.element.effort(self.sign)

    @property
    def joint_factors(self) -> dict[str, float]:
        """Joints that it acts on, with the factors of its force."""
        return joint_factors(self.element, self.power_flow)


def limit_at(limit, t: float, what: str) -> float:
    """Limit at a time [s], checked; SceneError if a law gives no limit."""
    if not callable(limit):
        return limit
    found = values.evaluated(limit, (t,), f"{what}: limit", 1)[0]
    return values.number(found, f"{what}: limit at t = {t:.6g} s", "N m or N", non_negative=True)
