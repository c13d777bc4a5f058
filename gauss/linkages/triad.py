"""Class III group: a ternary link on three legs, placed by Newton's method; rates and reactions by the same 3 × 3 matrix.

Each leg leaves its pin on the ternary link free along τ_k and constrains it along the normal N_k = i τ_k: along the leg
where its outer joint is a pin, along the guide's normal where it is a slide. With r_k from the origin of the ternary link to
the pin,

    N_k · (v + i ω r_k) = w_k                      velocities, accelerations and Newton steps (v, ω)
    Σ μ_k N_k = f,   Σ μ_k r_k × N_k = m             forces μ_k along the normals on the ternary link
"""

from typing import NamedTuple

import numpy as np

from gauss.linkages.chain import Triad
from gauss.linkages.placed import Complex, LinkMotion, PinFreedom, Pose, Real, SlideFreedom, Wrench, freedom, moved
from gauss.linkages.plane import cross, dot, left, pair, rounded, unit

STEPS = 5  # of Newton's method from a neighbour on the cycle: quadratic convergence


class Lines(NamedTuple):
    """Lines along which the legs constrain the ternary link: matrix of rows (N_x, N_y, r × N)."""

    rows: tuple
    minors: tuple
    det: Real

    def solve(self, w) -> tuple[Complex, Real]:
        """Velocity (v, ω) with given components w_k along the lines."""
        x, y, z = (sum(w_k * minor[i] for w_k, minor in zip(w, self.minors, strict=True)) / self.det for i in range(3))
        return pair(x, y), z

    def balance(self, force: Complex, moment: Real) -> list:
        """Forces μ_k along the lines with a given sum and moment."""
        return [(m[0] * force.real + m[1] * force.imag + m[2] * moment) / self.det for m in self.minors]


def lines(normals, arms) -> Lines:
    """Lines with normals N_k through the ends of the arms r_k."""
    rows = tuple((N.real, N.imag, cross(r, N)) for N, r in zip(normals, arms, strict=True))
    minors = tuple(_cross3(rows[(k + 1) % 3], rows[(k + 2) % 3]) for k in range(3))
    return Lines(rows, minors, sum(a * b for a, b in zip(rows[0], minors[0], strict=True)))


def _cross3(a, b) -> tuple:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


class Placed(NamedTuple):
    """A class III group at its pins."""

    pose: Pose  # the ternary link
    legs: tuple[Pose, ...]  # the legs
    pins: tuple[Complex, ...]  # pins of the ternary link in world
    residuals: tuple[Real, ...]  # loop residuals of the legs after Newton's last step [m]


def place(triad: Triad, placed, guess, steps: int = STEPS) -> Placed:
    """Poses near a guess.

    Parameters
    ----------
    triad : Triad
        The group.
    placed : dict
        Poses of links by name; carriers of the group are among them.
    guess : sequence of 3
        x, y [m] and angle [rad] of the ternary link.
    steps : int
        Number of Newton steps.
    """
    p, theta = pair(guess[0], guess[1]), guess[2]
    constraints = [_constraint(leg, joint, placed) for leg, joint in zip(triad.legs, triad.inners, strict=True)]
    for step in range(steps + 1):
        e = unit(theta)
        arms = [joint.point(triad.ternary.name) * e for joint in triad.inners]
        pins = [p + arm for arm in arms]
        residuals, normals = zip(*(at(pin) for at, pin in zip(constraints, pins, strict=True)), strict=True)
        if step < steps:
            dp, dtheta = lines(normals, arms).solve([-residual for residual in residuals])
            p, theta = p + dp, theta + dtheta
    pose = Pose(p, e)
    legs = tuple(_leg(leg, joint, placed, pin) for leg, joint, pin in zip(triad.legs, triad.inners, pins, strict=True))
    return Placed(pose, legs, tuple(pins), residuals)


def size(triad: Triad) -> float:
    """Largest distance of a pin from the origin of the ternary link, or length of a leg [m]."""
    pins = [abs(joint.point(triad.ternary.name)) for joint in triad.inners]
    legs = [abs(i.point(leg.name) - leg.joint.point(leg.name)) for leg, i in zip(triad.legs, triad.inners, strict=True)]
    return max(float(np.max(rounded(size))) for size in pins + legs)


def _constraint(leg, joint, placed):
    """Loop residual of a leg and its gradient, for any position of its pin on the ternary link."""
    carrier = placed[leg.carrier]
    outer, inner = carrier.point(leg.joint.point(leg.carrier)), joint.point(leg.name) - leg.joint.point(leg.name)
    if leg.joint.kind == "revolute":
        r = abs(inner)
        return lambda x: ((dot(x - outer, x - outer) - r * r) / (2.0 * r), (x - outer) / r)
    u = leg.joint.direction(leg.carrier) * carrier.e
    start = outer + inner * u * leg.joint.direction(leg.name).conjugate()
    return lambda x: (dot(left(u), x - start), left(u))


def _leg(leg, joint, placed, pin) -> Pose:
    carrier = placed[leg.carrier]
    arm = joint.point(leg.name) - leg.joint.point(leg.name)
    if leg.joint.kind == "revolute":
        e = (pin - carrier.point(leg.joint.point(leg.carrier))) * (arm.conjugate() / abs(arm) ** 2)
    else:
        e = leg.joint.direction(leg.carrier) * carrier.e * leg.joint.direction(leg.name).conjugate()
    return Pose(pin - joint.point(leg.name) * e, e)


class TriadFreedoms(NamedTuple):
    """Freedoms of the legs at the pins of the ternary link."""

    found: Placed
    frees: tuple[PinFreedom | SlideFreedom, ...]
    tau: tuple[Complex, ...]
    lines: Lines


def freedoms_of(triad: Triad, carriers, found: Placed) -> TriadFreedoms:
    """Freedoms of the placed group."""
    frees = tuple(freedom(leg, carriers[leg.carrier], pose) for leg, pose in zip(triad.legs, found.legs, strict=True))
    tau = tuple(free.direction(pin) for free, pin in zip(frees, found.pins, strict=True))
    return TriadFreedoms(found, frees, tau, lines([left(t) for t in tau], [pin - found.pose.p for pin in found.pins]))


def move(freedoms: TriadFreedoms) -> tuple[LinkMotion, ...]:
    """Velocities and accelerations: of the ternary link, then of the legs."""
    found, frees, tau = freedoms.found, freedoms.frees, freedoms.tau
    base = [free.base_velocity(pin) for free, pin in zip(frees, found.pins, strict=True)]
    v, omega = freedoms.lines.solve([dot(left(t), b) for t, b in zip(tau, base, strict=True)])
    arms = [pin - found.pose.p for pin in found.pins]
    rates = [dot(t, v + omega * left(r) - b) / dot(t, t) for t, r, b in zip(tau, arms, base, strict=True)]
    bias = [free.base_acceleration(pin, rate) for free, pin, rate in zip(frees, found.pins, rates, strict=True)]
    a, alpha = freedoms.lines.solve([dot(left(t), b + omega * omega * r) for t, b, r in zip(tau, bias, arms, strict=True)])
    ternary = LinkMotion(found.pose.p, found.pose.e, v, omega, a, alpha)
    accelerations = [
        dot(t, ternary.acceleration(pin) - b) / dot(t, t) for t, pin, b in zip(tau, found.pins, bias, strict=True)
    ]
    return ternary, *(moved(*each) for each in zip(found.legs, frees, rates, accelerations, strict=True))


def react(freedoms: TriadFreedoms, required: tuple[Wrench, ...]) -> tuple[tuple[Complex, ...], tuple[Wrench, ...]]:
    """Pin forces on the legs and wrenches of the outer joints, from the required wrenches on ternary link and legs."""
    found, frees, tau = freedoms.found, freedoms.frees, freedoms.tau
    ternary, legs = required[0].about(found.pose.p), required[1:]
    along = [
        ((dot(free.direction(w.x), w.force) + free.turning * w.moment) / dot(t, t)) * t
        for free, w, t in zip(frees, legs, tau, strict=True)
    ]
    arms = [pin - found.pose.p for pin in found.pins]
    force = -ternary.force - (along[0] + along[1] + along[2])
    moment = -ternary.moment - sum(cross(r, c) for r, c in zip(arms, along, strict=True))
    on_legs = tuple(c + mu * left(t) for c, mu, t in zip(along, freedoms.lines.balance(force, moment), tau, strict=True))
    outer = tuple(w + -Wrench(pin, on_leg, 0.0) for w, pin, on_leg in zip(legs, found.pins, on_legs, strict=True))
    return on_legs, outer


def matrix(freedoms: TriadFreedoms) -> np.ndarray:
    """Rows of the lines (k, 3, 3) with unit normals and lengths relative to the spread of the pins: free of units."""
    pins, tau = [rounded(pin) for pin in freedoms.found.pins], [rounded(t) for t in freedoms.tau]
    center = sum(pins) / 3.0
    arms = [np.atleast_1d(pin - center) for pin in pins]
    spread = np.sqrt(sum(abs(arm) ** 2 for arm in arms) / 3.0)
    normals = [np.atleast_1d(left(t) / abs(t)) for t in tau]
    rows = [
        np.stack(np.broadcast_arrays(N.real, N.imag, cross(r, N) / spread), -1) for N, r in zip(normals, arms, strict=True)
    ]
    return np.stack(rows, axis=-2)
