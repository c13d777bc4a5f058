"""Velocities, accelerations and reactions of a dyad, whatever its joints: one 2 × 2 matrix.

The outer joint of each link leaves it one freedom (:class:`PinFreedom` or :class:`SlideFreedom`), the inner joint constrains
two components of the relative motion. With τ_i, τ_j the motions at the inner joint per unit rate of each freedom, in these
components:

    τ_i q̇_i − τ_j q̇_j = w           velocities, and accelerations with another w
    τ_i · λ = Q_i,   −τ_j · λ = Q_j    virtual power: the inner reaction λ on link i, the outer reactions do no work

The inner joint sees a pin's relative velocity as it is; of a slide it sees n·v + i ω, to which R_n + i R_m is dual.
The six equations of equilibrium of the group fall apart into this and two force balances.
"""

from typing import NamedTuple

from gauss.linkages.chain import Dyad
from gauss.linkages.elements import LinkJoint
from gauss.linkages.forces import Wrench
from gauss.linkages.placed import Complex, LinkMotion, PinFreedom, Pose, Real, SlideFreedom, freedom, moment, moved
from gauss.linkages.plane import cross, dot, left, pair


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
