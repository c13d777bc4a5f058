"""Planar mechanics of single links: poses, velocities, accelerations, wrenches, freedoms of outer joints."""

from dataclasses import dataclass
from typing import Any, NamedTuple

from gauss.linkages.plane import cross, left

Complex = Any  # complex numbers, complex arrays (k,) or traced pairs
Real = Any  # numbers, arrays (k,) or expressions


@dataclass(frozen=True)
class Pose:
    """Pose of a link: a point c of its frame is at p + c e.

    Parameters
    ----------
    p : complex
        Origin of the link frame [m].
    e : complex
        Unit vector along its x axis.
    """

    p: Complex
    e: Complex

    def point(self, c: complex) -> Complex:
        """Point of the link in world."""
        return self.p + c * self.e if c else self.p


@dataclass(frozen=True)
class LinkMotion(Pose):
    """A link with its velocity and acceleration.

    Parameters
    ----------
    v, a : complex
        Velocity [m/s] and acceleration [m/s²] of the origin of the link frame.
    omega, alpha : float
        Angular velocity [rad/s] and acceleration [rad/s²].
    """

    v: Complex
    omega: Real
    a: Complex
    alpha: Real

    def velocity(self, x: Complex) -> Complex:
        """Velocity of the point of the link that is at x."""
        return self.v + self.omega * left(x - self.p)

    def acceleration(self, x: Complex) -> Complex:
        """Acceleration of the point of the link that is at x."""
        r = x - self.p
        return self.a + self.alpha * left(r) - self.omega * self.omega * r


FRAME = LinkMotion(0j, 1 + 0j, 0j, 0.0, 0j, 0.0)  # the ground


@dataclass(frozen=True)
class PinFreedom:
    """Freedom of a link on an outer pin: it turns about the pin.

    Parameters
    ----------
    center, velocity_there, acceleration_there : complex
        The pin, given by its carrier.
    """

    center: Complex
    velocity_there: Complex
    acceleration_there: Complex

    turning = 1.0  # rate of turn per unit of the freedom's rate
    base_speed = base_alpha = 0.0

    def direction(self, x):
        """Velocity at x per unit of the freedom's rate."""
        return left(x - self.center)

    def base_velocity(self, x):
        """Velocity at x when the freedom rests."""
        return self.velocity_there

    def base_acceleration(self, x, rate):
        """Acceleration at x when the freedom's rate does not change."""
        return self.acceleration_there - rate * rate * (x - self.center)


@dataclass(frozen=True)
class SlideFreedom:
    """Freedom of a link on an outer slide: it is carried along and slides in the direction u.

    Parameters
    ----------
    carrier : LinkMotion
        Link at the other end.
    u : complex
        Direction of the guide.
    """

    carrier: LinkMotion
    u: Complex

    turning = 0.0

    @property
    def base_speed(self):
        """Angular velocity when the freedom rests."""
        return self.carrier.omega

    @property
    def base_alpha(self):
        """Angular acceleration when the freedom's rate does not change."""
        return self.carrier.alpha

    def direction(self, x):
        """Velocity at x per unit of the freedom's rate."""
        return self.u

    def base_velocity(self, x):
        """Velocity at x when the freedom rests."""
        return self.carrier.velocity(x)

    def base_acceleration(self, x, rate):
        """Acceleration at x when the freedom's rate does not change; twice ω × ṡ is Coriolis' part."""
        return self.carrier.acceleration(x) + 2.0 * self.carrier.omega * rate * left(self.u)


def freedom(leg, carrier: LinkMotion, pose: Pose) -> PinFreedom | SlideFreedom:
    """Freedom of a placed leg on its outer joint."""
    if leg.joint.kind == "revolute":
        B = carrier.point(leg.joint.point(leg.carrier))
        return PinFreedom(B, carrier.velocity(B), carrier.acceleration(B))
    return SlideFreedom(carrier, leg.joint.direction(leg.name) * pose.e)


def moved(pose: Pose, free: PinFreedom | SlideFreedom, rate, acceleration) -> LinkMotion:
    """Link with its velocity and acceleration from rate and acceleration of its freedom."""
    return LinkMotion(
        pose.p,
        pose.e,
        free.base_velocity(pose.p) + rate * free.direction(pose.p),
        free.base_speed + rate * free.turning,
        free.base_acceleration(pose.p, rate) + acceleration * free.direction(pose.p),
        free.base_alpha + acceleration * free.turning,
    )


def moment(x: Complex, force: Complex, about: Complex) -> Real:
    """Moment about a point of a force at x."""
    return cross(x - about, force)


class Wrench(NamedTuple):
    """Force and moment about a point."""

    x: Complex  # the point [m]
    force: Complex  # force [N]
    moment: Real  # moment about x [N m]

    def about(self, x: Complex) -> "Wrench":
        """Return the same wrench about another point."""
        return Wrench(x, self.force, self.moment + moment(self.x, self.force, x))

    def __add__(self, other: "Wrench") -> "Wrench":  # type: ignore[override]  # a sum, not a longer tuple
        other = other.about(self.x)
        return Wrench(self.x, self.force + other.force, self.moment + other.moment)

    def __neg__(self) -> "Wrench":
        return Wrench(self.x, -self.force, -self.moment)
