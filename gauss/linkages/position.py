"""Positions of the five dyads in closed form, from where their carriers are.

Each group is a triangle, a foot point or a crossing of two lines; the height of the triangle is written as in Heron's
formula, which loses no digits where links are nearly aligned.
"""

from typing import NamedTuple

from gauss.linkages.chain import Dyad, Leg
from gauss.linkages.placed import Complex, Pose
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
