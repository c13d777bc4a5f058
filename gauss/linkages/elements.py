"""Elements of a linkage: links, joints, loads, motor and driver."""

import cmath
from bisect import bisect
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

from gauss.errors import SceneError, did_you_mean
from gauss.scene import values

KINDS = ("revolute", "prismatic")
FORCE_AXES = ("world", "link")


@dataclass(frozen=True)
class PlanarLink:
    """Rigid link in the plane.

    Parameters
    ----------
    name : str
        Name; "ground" is the frame of the machine.
    mass : float
        Mass [kg].
    inertia : float
        Moment of inertia about the centre of mass [kg m²].
    com : array_like, shape (2,)
        Centre of mass in the link frame [m].

    Examples
    --------
    >>> from gauss.linkages import PlanarLink
    >>> PlanarLink("rocker", mass=2.2, inertia=0.09, com=(0.35, 0))
    PlanarLink(name='rocker', mass=2.2, inertia=0.09, com=(0.35, 0.0))
    """

    name: str
    mass: float = 0.0
    inertia: float = 0.0
    com: tuple = (0.0, 0.0)

    def __post_init__(self):
        """Check every value and keep plain numbers."""
        what = f"link {values.text(self.name, 'name of a link')!r}"
        values.keep(self, mass=values.number(self.mass, f"{what}: mass", "kg", non_negative=True))
        values.keep(self, inertia=values.number(self.inertia, f"{what}: inertia", "kg m²", non_negative=True))
        values.keep(self, com=values.vector(self.com, f"{what}: com", "m", 2))
        if self.inertia and not self.mass:
            raise SceneError(f"{what}: inertia {self.inertia} kg m² without mass; give a mass > 0, or zero inertia.")


@dataclass(frozen=True)
class LinkJoint:
    """Pin or slide between two links.

    Its reaction is what the parent exerts on the child: a force (x, y) at the pin; for a slide a force along the guide's
    left normal at the slider's reference point, and a moment.

    Parameters
    ----------
    name : str
        Name.
    kind : str
        "revolute", or "prismatic": then the parent carries the guide and the child slides on it.
    parent, child : str
        Links.
    at : array_like, shape (2,)
        Pin, or base point of the guide, in the frame of the parent [m].
    child_at : array_like, shape (2,)
        Pin, or reference point of the slider, in the frame of the child [m]; it runs on the guide.
    angle, child_angle : float
        Direction of the guide in the frames of parent and child [rad].

    Examples
    --------
    >>> from gauss.linkages import LinkJoint
    >>> pin = LinkJoint("B", "revolute", "crank", "coupler", at=(0.4, 0))
    >>> pin.kind, pin.parent, pin.child
    ('revolute', 'crank', 'coupler')
    """

    name: str
    kind: str
    parent: str
    child: str
    at: tuple = (0.0, 0.0)
    child_at: tuple = (0.0, 0.0)
    angle: float = 0.0
    child_angle: float = 0.0

    def __post_init__(self):
        """Check every value and keep plain numbers."""
        what = f"joint {values.text(self.name, 'name of a joint')!r}"
        if self.kind not in KINDS:
            raise SceneError(f"{what}: unknown type {self.kind!r}. {did_you_mean(self.kind, KINDS)}")
        if self.parent == self.child:
            raise SceneError(f"{what}: parent and child are both {self.child!r}; a joint binds two links.")
        for key in ("at", "child_at"):
            values.keep(self, **{key: values.vector(getattr(self, key), f"{what}: {key}", "m", 2)})
        for key in ("angle", "child_angle"):
            values.keep(self, **{key: values.number(getattr(self, key), f"{what}: {key}", "rad")})
            if getattr(self, key) and self.kind == "revolute":
                raise SceneError(f"{what}: {key} has no meaning for a pin; only a guide has a direction.")

    def point(self, link: str) -> complex:
        """Pin, base point or reference point in the frame of one of its links."""
        return complex(*(self.at if link == self.parent else self.child_at))

    def direction(self, link: str) -> complex:
        """Direction of the guide in the frame of one of its links."""
        return cmath.rect(1.0, self.angle if link == self.parent else self.child_angle)

    def other(self, link: str) -> str:
        """Return the link at the other end."""
        return self.parent if link == self.child else self.child


class Here(NamedTuple):
    """Argument of a law of a load: motion of the crank and of the loaded link; arrays with one entry for each crank angle.

    Attributes
    ----------
    crank_angle, crank_speed : ndarray
        Crank [rad, rad/s].
    angle, speed : ndarray
        Link [rad, rad/s].
    position, velocity : ndarray, complex
        Point of application, x + i y [m, m/s].

    Examples
    --------
    >>> import gauss
    >>> bar = gauss.load_linkage("four_bar")
    >>> spring = bar.load("rocker", law=lambda here: (0.0, 0.0, -5.0 * here.angle))
    >>> bar.cycle([0.3]).torque.round(3)
    array([-34.401])
    """

    crank_angle: Any
    crank_speed: Any
    angle: Any
    speed: Any
    position: Any
    velocity: Any


@dataclass(frozen=True)
class Load:
    """Force and moment on a link.

    Parameters
    ----------
    link : str
        Link that it acts on.
    force : array_like (2,)
        Force [N].
    moment : float
        Moment [N m], counter-clockwise.
    at : array_like (2,), optional
        Point of application in the link frame [m]; the centre of mass when not given.
    axes : str
        "world", or "link" for a force that turns with the link.
    resisting : bool
        Whether force and moment reverse where their power would be positive: a resisting load.
    viscous : float
        c [N m s/rad] of a further moment −c ω.
    law : callable, optional
        law(here) → (Fx, Fy, M) in world axes, added to the rest; ``here`` is a :class:`Here`.

    Examples
    --------
    >>> from gauss.linkages import Load
    >>> saw = Load("slider", force=(-300.0, 0.0), resisting=True)
    >>> saw.force, saw.resisting
    ((-300.0, 0.0), True)
    """

    link: str
    force: tuple = (0.0, 0.0)
    moment: float = 0.0
    at: tuple | None = None
    axes: str = "world"
    resisting: bool = False
    viscous: float = 0.0
    law: Callable | None = None

    def __post_init__(self):
        """Check every value and keep plain numbers."""
        what = f"load on link {self.link!r}"
        values.keep(self, force=values.vector(self.force, f"{what}: force", "N", 2))
        values.keep(self, moment=values.number(self.moment, f"{what}: moment", "N m"))
        values.keep(self, viscous=values.number(self.viscous, f"{what}: viscous", "N m s/rad", non_negative=True))
        if self.at is not None:
            values.keep(self, at=values.vector(self.at, f"{what}: at", "m", 2))
        if self.axes not in FORCE_AXES:
            raise SceneError(f"{what}: axes must be 'world' or 'link', got {self.axes!r}.")
        if not isinstance(self.resisting, bool):
            raise SceneError(f"{what}: resisting must be true or false, got {self.resisting!r}.")
        if self.law is not None and not callable(self.law):
            raise SceneError(f"{what}: law must be a function of one argument, got {self.law!r}.")

    @property
    def varies(self) -> bool:
        """Whether it depends on velocities, or on a law."""
        return self.resisting or self.law is not None or self.viscous > 0


@dataclass(frozen=True)
class CrankMotor:
    """Torque–speed characteristic of a motor on the crank, linear between the points and beyond the last ones.

    Parameters
    ----------
    speed : array_like, shape (k,)
        Increasing speeds [rad/s].
    torque : array_like, shape (k,)
        Torques there [N m].
    inertia : float
        Inertia that it adds to the crank, rotor and flywheel [kg m²].

    Examples
    --------
    >>> import gauss
    >>> bar = gauss.load_linkage("four_bar")
    >>> bar.motor(speed=[0, 20], torque=[120, 0], inertia=0.5).torque
    (120.0, 0.0)
    """

    speed: tuple
    torque: tuple
    inertia: float = 0.0

    def __post_init__(self):
        """Check every value."""
        count = len(self.speed) if isinstance(self.speed, list | tuple) else 2
        for key, symbol in (("speed", "rad/s"), ("torque", "N m")):
            values.keep(self, **{key: values.vector(getattr(self, key), f"motor: {key}", symbol, count)})
        values.keep(self, inertia=values.number(self.inertia, "motor: inertia", "kg m²", non_negative=True))
        if count < 2 or any(b <= a for a, b in pairwise(self.speed)):
            raise SceneError(f"motor: speed: expected two or more increasing numbers, got {self.speed}.")

    def __call__(self, t: float, angle: float, speed: float) -> float:
        """Torque [N m] at a speed [rad/s]."""
        k = min(max(bisect(self.speed, speed), 1), len(self.speed) - 1)
        share = (speed - self.speed[k - 1]) / (self.speed[k] - self.speed[k - 1])
        return self.torque[k - 1] + share * (self.torque[k] - self.torque[k - 1])


@dataclass(frozen=True)
class Driver:
    """Crank: its pin on the ground, speed, acceleration and start angle.

    Parameters
    ----------
    joint : str
        Pin between the ground and the crank.
    speed : float
        Speed of the crank [rad/s]; negative when it turns clockwise.
    acceleration : float
        Its acceleration [rad/s²].
    start : float
        Crank angle at which a cycle starts [rad].

    Examples
    --------
    >>> from gauss.linkages import Driver
    >>> Driver("A", speed=10.0)
    Driver(joint='A', speed=10.0, acceleration=0.0, start=0.0)
    """

    joint: str
    speed: float = 1.0
    acceleration: float = 0.0
    start: float = 0.0

    def __post_init__(self):
        """Check every value."""
        units = {"speed": "rad/s", "acceleration": "rad/s²", "start": "rad"}
        for key, symbol in units.items():
            values.keep(self, **{key: values.number(getattr(self, key), f"drive of {self.joint!r}: {key}", symbol)})
