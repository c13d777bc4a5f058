"""Loads: drives of joints, forces on bodies, springs and dampers. Every law is a constant or a function.

A law is called as ``law(t)`` or ``law(t, motion)``; ``motion`` is the kinematics of the present state
(:class:`gauss.Kinematics`: ``motion.coordinate("A")``, ``motion.position("crank")``, …).
"""

from collections.abc import Callable, Sized
from dataclasses import dataclass
from typing import cast

import numpy as np

from gauss.errors import SceneError
from gauss.scene import values


@dataclass(frozen=True)
class Drive:
    """Generalised force of a joint: an actuator.

    Parameters
    ----------
    name, joint : str
        Name of the drive and of the joint that it acts on.
    effort : float, sequence or callable
        Torque [N m] or force [N] along each rate of the joint, or a law that returns it.
    limit : float, optional
        Largest effort along each rate; more is cut off.
    breaks : sequence of float
        Times at which the law switches [s], for a law that cannot be traced; conditions of traced laws are found.
    """

    name: str
    joint: str
    effort: float | tuple | Callable
    limit: float | None = None
    breaks: tuple = ()

    def __post_init__(self):
        what = f"drive {values.text(self.name, 'name of a drive')!r}"
        effort = self.effort
        if isinstance(effort, (list, tuple)) or getattr(effort, "ndim", False):
            effort = values.vector(effort, f"{what}: effort", "N m or N", len(cast(Sized, effort)))
        else:
            effort = values.law(effort, f"{what}: effort", "N m or N")
        values.keep(self, effort=effort)
        if self.limit is not None:
            values.keep(self, limit=values.number(self.limit, f"{what}: limit", "N m or N", positive=True))
        values.keep(self, breaks=values.times(self.breaks, f"{what}: breaks"))


@dataclass(frozen=True)
class StateLaw(Drive):
    """Law ẋ = f of a state of one's own: x is the rate of a joint of a body with a moment of inertia of 1 kg m².

    Such a body adds ½ (ẋ − f)² to Gauss's compulsion, the least of which is the law. See :meth:`gauss.Scene.state`.

    Parameters
    ----------
    name, joint, effort, limit, breaks
        As of a drive; the effort is the law of ẋ.
    """

    @property
    def what(self) -> str:
        """Kind and name of the state."""
        return f"state {self.joint!r}"


@dataclass(frozen=True)
class Force:
    """Force and moment on a body.

    Parameters
    ----------
    name, body : str
        Name of the load and of the body that it acts on.
    force : array_like (3,) or callable
        Force [N], or a law that returns it.
    moment : array_like (3,) or callable
        Moment [N m], or a law that returns it.
    at : array_like, shape (3,), optional
        Point of application in the body frame [m]; the centre of mass when not given.
    axes : str
        "world", or "body" for components that turn with the body.
    breaks : sequence of float
        Times at which a law switches [s], for one that cannot be traced; conditions of traced laws are found.
    """

    name: str
    body: str
    force: tuple | Callable = (0.0, 0.0, 0.0)
    moment: tuple | Callable = (0.0, 0.0, 0.0)
    at: tuple | None = None
    axes: str = "world"
    breaks: tuple = ()

    def __post_init__(self):
        what = f"force {values.text(self.name, 'name of a force')!r}"
        values.keep(self, force=values.law(self.force, f"{what}: force", "N", 3))
        values.keep(self, moment=values.law(self.moment, f"{what}: moment", "N m", 3))
        if self.at is not None:
            values.keep(self, at=values.vector(self.at, f"{what}: at", "m"))
        values.keep(self, breaks=values.times(self.breaks, f"{what}: breaks"))
        if self.axes not in ("world", "body"):
            raise SceneError(f"{what}: axes must be 'world' or 'body', got {self.axes!r}.")


@dataclass(frozen=True)
class JointSpring:
    """Linear spring and damper along the coordinate of a joint of one freedom: −k (q − q₀) − d q̇.

    Parameters
    ----------
    name, joint : str
        Name of the element and of its joint.
    stiffness : float
        k [N m/rad or N/m].
    damping : float
        d [N m s/rad or N s/m].
    rest : float
        q₀, coordinate at which the spring is relaxed [rad or m].
    """

    name: str
    joint: str
    stiffness: float = 0.0
    damping: float = 0.0
    rest: float = 0.0

    def __post_init__(self):
        what = f"joint spring {values.text(self.name, 'name of a spring')!r}"
        _check_spring(self, what)
        values.keep(self, rest=values.number(self.rest, f"{what}: rest", "rad or m"))


@dataclass(frozen=True)
class Spring:
    """Linear spring and damper between two points: tension k (l − l₀) + d l̇.

    Parameters
    ----------
    name, body, other : str
        Name of the element and of the two bodies that it joins.
    at, other_at : array_like, shape (3,)
        Its end points in the frames of the two bodies [m].
    stiffness : float
        k [N/m].
    damping : float
        d [N s/m].
    length : float
        l₀, relaxed length [m].
    """

    name: str
    body: str
    other: str
    at: tuple = (0.0, 0.0, 0.0)
    other_at: tuple = (0.0, 0.0, 0.0)
    stiffness: float = 0.0
    damping: float = 0.0
    length: float = 0.0

    def __post_init__(self):
        what = f"spring {values.text(self.name, 'name of a spring')!r}"
        _check_spring(self, what)
        values.keep(self, length=values.number(self.length, f"{what}: length", "m", non_negative=True))
        values.keep(self, at=values.vector(self.at, f"{what}: at", "m"))
        values.keep(self, other_at=values.vector(self.other_at, f"{what}: other_at", "m"))
        if self.body == self.other:
            raise SceneError(f"{what}: both ends are on {self.body!r}; it would do nothing.")


def _check_spring(spring, what: str):
    values.keep(spring, stiffness=values.number(spring.stiffness, f"{what}: stiffness", "N/m or N m/rad"))
    values.keep(spring, damping=values.number(spring.damping, f"{what}: damping", "N s/m or N m s/rad"))
    if not spring.stiffness and not spring.damping:
        raise SceneError(f"{what}: has neither stiffness nor damping; give one, or leave it out.")


@dataclass(frozen=True)
class Start:
    """Where and how fast a joint starts.

    Parameters
    ----------
    joint : str
        Joint.
    position : float or sequence
        Coordinates at the start [rad, m]; a quaternion is (w, x, y, z).
    rate : float or sequence
        Rates at the start [rad/s, m/s]; ω of a ball or free joint is in the axes of the joint frame on the child, see
        :meth:`gauss.Scene.ball`.
    """

    joint: str
    position: float | tuple | None = None
    rate: float | tuple = 0.0

    def __post_init__(self):
        what = f"start of joint {values.text(self.joint, 'name of a joint')!r}"
        for key, unit in (("position", "rad or m"), ("rate", "rad/s or m/s")):
            value = getattr(self, key)
            if value is None:
                continue
            is_one = not np.asarray(value, dtype=object).ndim
            what_of = f"{what}: {key}"
            checked = values.number(value, what_of, unit) if is_one else values.vector(value, what_of, unit, len(value))
            values.keep(self, **{key: checked})
