"""Dyads: positions of the five kinds in closed form; velocities, accelerations and reactions by one 2 × 2 matrix.

For its position a group is a triangle, a foot point or a crossing of two lines; the height of the triangle is written as in
Heron's formula, which loses no digits where links are nearly aligned.

The outer joint of each link leaves it one freedom (:class:`PinFreedom` or :class:`SlideFreedom`), the inner joint constrains
two components of the relative motion. With τ_i, τ_j the motions at the inner joint per unit rate of each freedom, in these
components:

    τ_i q̇_i − τ_j q̇_j = w           velocities, and accelerations with another w
    τ_i · λ = Q_i,   −τ_j · λ = Q_j    virtual power: the inner reaction λ on link i, the outer reactions do no work

The inner joint sees a pin's relative velocity as it is; of a slide it sees n·v + i ω, to which R_n + i R_m is dual.
The six equations of equilibrium of the group fall apart into this and two force balances.
"""

from typing import NamedTuple

from gauss.linkages.chain import Dyad, Leg
from gauss.linkages.elements import LinkJoint
from gauss.linkages.placed import (
    Complex,
    LinkMotion,
    PinFreedom,
    Pose,
    Real,
    SlideFreedom,
    Wrench,
    freedom,
    moment,
    moved,
)
from gauss.linkages.plane import cross, dot, left, pair


class DyadPoses(NamedTuple):
    """Poses of the two links, and the closure slack of the group."""

    i: Pose  # i, j: the links
    j: Pose
    slack: dict  # reason for a failed assembly, and closure slack [m], negative where it fails


def place(dyad: Dyad, placed: dict) -> DyadPoses:
    """Poses of the links of a dyad.

    Parameters
    ----------
    dyad : Dyad
        The group.
    placed : dict
        Poses of links by name; carriers of the group are among them.
    """
    return _PLACE[dyad.kind](dyad, placed)


def _rrr(dyad: Dyad, placed) -> DyadPoses:
    B, D = (_pin(leg, placed) for leg in dyad.legs)
    arm_i, arm_j = (_arm(leg, dyad) for leg in dyad.legs)
    r_i, r_j = abs(arm_i), abs(arm_j)
    d = D - B
    square = dot(d, d)
    distance = square**0.5
    stretched, folded = (r_i + r_j) - distance, (distance - (r_i - r_j)) * (distance + (r_i - r_j))
    along = (square + (r_i - r_j) * (r_i + r_j)) / 2.0
    across = dyad.mode * (stretched * ((r_i + r_j) + distance) * folded) ** 0.5 / 2.0
    to_C = (along * d + across * left(d)) / square  # from B
    slack = {"too short to reach": stretched, "too long to fold": distance - abs(r_i - r_j)}
    return DyadPoses(_turned(dyad.i, B, to_C, arm_i), _turned(dyad.j, D, to_C - d, arm_j), slack)


def _rrp(dyad: Dyad, placed) -> DyadPoses:
    B, arm = _pin(dyad.i, placed), _arm(dyad.i, dyad)
    u, j = _slid(dyad.j, placed)
    w = j.point(dyad.inner.point(dyad.j.name)) - B
    p, r = cross(u, w), abs(arm)
    along = dyad.mode * ((r - p) * (r + p)) ** 0.5
    j = Pose(j.p + (along - dot(u, w)) * u, j.e)
    return DyadPoses(_turned(dyad.i, B, along * u + p * left(u), arm), j, {"too short to reach its guide": r - abs(p)})


def _rpr(dyad: Dyad, placed) -> DyadPoses:
    B, D = (_pin(leg, placed) for leg in dyad.legs)
    inner, d = dyad.inner, B - D
    e = sum(
        sign * cross(inner.direction(leg.name), leg.joint.point(leg.name) - inner.point(leg.name))
        for sign, leg in ((1.0, dyad.i), (-1.0, dyad.j))
    )
    square = dot(d, d)
    s = dyad.mode * (square - e * e) ** 0.5
    u = d * pair(s, -e) / square  # (s + i e) u = d
    i, j = (
        Pose(pin - leg.joint.point(leg.name) * turn, turn)
        for leg, pin in ((dyad.i, B), (dyad.j, D))
        for turn in (u * inner.direction(leg.name).conjugate(),)
    )
    return DyadPoses(i, j, {"too close to its pivot for the offset of its guide": square**0.5 - abs(e)})


def _prp(dyad: Dyad, placed) -> DyadPoses:
    (u_i, i), (u_j, j) = (_slid(leg, placed) for leg in dyad.legs)
    w = j.point(dyad.inner.point(dyad.j.name)) - i.point(dyad.inner.point(dyad.i.name))
    sigma = cross(u_i, u_j)
    return DyadPoses(Pose(i.p + cross(w, u_j) / sigma * u_i, i.e), Pose(j.p + cross(w, u_i) / sigma * u_j, j.e), {})


def _rpp(dyad: Dyad, placed) -> DyadPoses:
    B, inner = _pin(dyad.i, placed), dyad.inner
    u, j = _slid(dyad.j, placed)
    slot = inner.direction(dyad.j.name) * j.e
    e = slot * inner.direction(dyad.i.name).conjugate()
    i = Pose(B - dyad.i.joint.point(dyad.i.name) * e, e)
    offset = i.point(inner.point(dyad.i.name)) - j.point(inner.point(dyad.j.name))
    return DyadPoses(i, Pose(j.p + cross(slot, offset) / cross(slot, u) * u, j.e), {})


_PLACE = {"RRR": _rrr, "RRP": _rrp, "RPR": _rpr, "PRP": _prp, "RPP": _rpp}


def _pin(leg: Leg, placed) -> Complex:
    """Outer pin in world."""
    return placed[leg.carrier].point(leg.joint.point(leg.carrier))


def _arm(leg: Leg, dyad: Dyad) -> complex:
    """From the outer pin to the inner one, in the frame of the link."""
    return dyad.inner.point(leg.name) - leg.joint.point(leg.name)


def _turned(leg: Leg, pin: Complex, to: Complex, arm: complex) -> Pose:
    """Pose of a link on a pin whose arm points as given."""
    e = to * (arm.conjugate() / abs(arm) ** 2)
    return Pose(pin - leg.joint.point(leg.name) * e, e)


def _slid(leg: Leg, placed) -> tuple[Complex, Pose]:
    """Direction of the outer guide, and the pose of the link with base and reference point in one place."""
    carrier = placed[leg.carrier]
    u = leg.joint.direction(leg.carrier) * carrier.e
    e = u * leg.joint.direction(leg.name).conjugate()
    return u, Pose(carrier.point(leg.joint.point(leg.carrier)) - leg.joint.point(leg.name) * e, e)


class Inner(NamedTuple):
    """Inner joint in world axes."""

    x: Complex  # pin, or reference point of the slider
    u: Complex | None  # direction of the guide
    sign: float  # +1 if link i is the child of the joint: then the joint's reaction is the one on link i

    def seen(self, velocity: Complex, turning: Real) -> Complex:
        """Components of a relative motion at x that the joint constrains."""
        return velocity if self.u is None else pair(dot(left(self.u), velocity), turning)

    def wrench(self, reaction: Complex) -> tuple[Complex, Real]:
        """Force at x and free moment of a reaction."""
        return (reaction, 0.0) if self.u is None else (reaction.real * left(self.u), reaction.imag)


class DyadFreedoms(NamedTuple):
    """The two freedoms of a dyad at its inner joint."""

    inner: Inner  # the inner joint
    frees: tuple[PinFreedom | SlideFreedom, PinFreedom | SlideFreedom]  # freedoms of i and j
    tau: tuple[Complex, Complex]  # motions τ_i, τ_j in the components of the inner joint
    det: Real  # τ_i × τ_j
    # angle in [0, π/2] from the singular positions of the group, as cos + i sin up to a factor: the transmission angle of
    # RRR, |cos| of the pressure angle of RRP as sine
    quality: Complex


def inner_joint(joint: LinkJoint, child: Pose, sign: float) -> Inner:
    """Inner joint of a dyad whose child link is placed."""
    u = joint.direction(joint.child) * child.e if joint.kind == "prismatic" else None
    return Inner(child.point(joint.point(joint.child)), u, sign)


def freedoms_of(dyad: Dyad, carriers, poses: tuple[Pose, Pose]) -> DyadFreedoms:
    """Freedoms of a placed dyad at its inner joint."""
    child = 0 if dyad.inner.child == dyad.i.name else 1
    inner = inner_joint(dyad.inner, poses[child], 1.0 if child == 0 else -1.0)
    i, j = (freedom(leg, carriers[leg.carrier], pose) for leg, pose in zip(dyad.legs, poses, strict=True))
    tau = (inner.seen(i.direction(inner.x), i.turning), inner.seen(j.direction(inner.x), j.turning))
    det = cross(*tau)
    if inner.u is None:
        cosine = dot(*tau)
    elif isinstance(i, PinFreedom) and isinstance(j, PinFreedom):
        cosine = dot(left(inner.u), i.center - j.center)
    else:
        assert isinstance(j, SlideFreedom)  # RPP: the first link is the one on a pin
        cosine = dot(inner.u, j.u)
    return DyadFreedoms(inner, (i, j), tau, det, pair(abs(cosine), abs(det)))


def move(freedoms: DyadFreedoms, poses: tuple[Pose, Pose]) -> tuple[LinkMotion, LinkMotion]:
    """Velocities and accelerations of the links of a dyad."""
    inner, frees = freedoms.inner, freedoms.frees
    base = [inner.seen(free.base_velocity(inner.x), free.base_speed) for free in frees]
    rates = _solve(freedoms, base[1] - base[0])
    velocities = [
        free.base_velocity(inner.x) + rate * free.direction(inner.x) for free, rate in zip(frees, rates, strict=True)
    ]
    bias = [
        inner.seen(free.base_acceleration(inner.x, rate), free.base_alpha) for free, rate in zip(frees, rates, strict=True)
    ]
    w = bias[1] - bias[0]
    if inner.u is not None:
        omega = frees[0].base_speed + rates[0] * frees[0].turning
        sliding = dot(inner.u, velocities[0] - velocities[1])
        w = w + pair(2.0 * omega * sliding, 0.0 * sliding)  # Coriolis: i slides along the turning guide
    accelerations = _solve(freedoms, w)
    i, j = (moved(*each) for each in zip(poses, frees, rates, accelerations, strict=True))
    return i, j


def _solve(freedoms: DyadFreedoms, w: Complex) -> tuple[Real, Real]:
    tau_i, tau_j = freedoms.tau
    return cross(w, tau_j) / freedoms.det, cross(w, tau_i) / freedoms.det


def react(freedoms: DyadFreedoms, required: tuple[Wrench, Wrench]) -> tuple[Complex, Wrench, Wrench]:
    """Reactions of a dyad.

    Parameters
    ----------
    freedoms : DyadFreedoms
        The dyad at its inner joint.
    required : tuple of Wrench
        Wrenches that the joints of i and j must exert on them together.

    Returns
    -------
    reaction : complex
        Of the inner joint, on its child: R_x + i R_y, or R_n + i R_m.
    outer : tuple of Wrench
        Wrenches of the outer joints on i and on j.
    """
    inner = freedoms.inner
    Q = [
        dot(free.direction(wrench.x), wrench.force) + free.turning * wrench.moment
        for free, wrench in zip(freedoms.frees, required, strict=True)
    ]
    tau_i, tau_j = freedoms.tau
    on_i = -left(Q[1] * tau_i + Q[0] * tau_j) / freedoms.det
    force, turn = inner.wrench(on_i)
    outer = tuple(
        Wrench(wrench.x, wrench.force - sign * force, wrench.moment - sign * (turn + moment(inner.x, force, wrench.x)))
        for sign, wrench in zip((1.0, -1.0), required, strict=True)
    )
    return inner.sign * on_i, *outer
