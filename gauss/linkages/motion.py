"""Kinematics of a chain of groups at given crank angles: forward, group after group."""

from dataclasses import dataclass

import numpy as np

from gauss.codegen import Expression
from gauss.linkages import dyad as dyads
from gauss.linkages import position
from gauss.linkages import triad as triads
from gauss.linkages.chain import Chain, Dyad
from gauss.linkages.elements import GROUND
from gauss.linkages.placed import FRAME, Moving, Pinned, Pose, Real, moved
from gauss.linkages.plane import Cartesian, conjugate, unit
from gauss.linkages.plane import angle as turned

CLOSED = 1e-10  # gap of a class III group, relative to its pins, that Newton's method leaves when it does not converge


@dataclass(frozen=True)
class Motion:
    """Where all links are and how they move. Arrays have one entry for each crank angle.

    Parameters
    ----------
    chain : Chain
        What moves.
    crank_angle, crank_speed : ndarray
        Angle [rad] and speed [rad/s] of the crank.
    links : dict of Moving
        Links by name, the ground among them.
    meetings : tuple
        The groups at their inner joints, in order.
    slack : tuple of dict
        For each group: what is wrong with its lengths when the value [m] is negative, and the value.
    """

    chain: Chain
    crank_angle: Real
    crank_speed: Real
    links: dict[str, Moving]
    meetings: tuple
    slack: tuple[dict, ...]


def move(chain: Chain, angle, speed, acceleration, poses=None) -> Motion:
    """Motion at given crank angles, whether they close or not.

    Parameters
    ----------
    chain : Chain
        The linkage.
    angle, speed, acceleration : float, ndarray (k,) or Expression
        Of the crank [rad, rad/s, rad/s²].
    poses : dict, optional
        For each ternary link a pose (x, y, angle) near the one wanted.
    """
    placed, slack, found = _place_all(chain, angle, poses or {})
    frame = placed[GROUND]
    moving, meetings = {GROUND: frame}, []
    crank = placed[chain.crank.name]
    moving[chain.crank.name] = moved(crank, Pinned(_pivot(chain, frame), 0 * frame.p, 0 * frame.p), speed, acceleration)
    for group, where in zip(chain.groups, found, strict=True):
        if isinstance(group, Dyad):
            meeting = dyads.meet(group, moving, (where.i, where.j))
            links = dyads.move(meeting, (where.i, where.j))
        else:
            meeting = triads.meet(group, moving, where)
            links = triads.move(meeting)
        meetings.append(meeting)
        moving |= {link.name: motion for link, motion in zip(group.links, links, strict=True)}
    return Motion(chain, angle, speed, moving, tuple(meetings), slack)


def gaps(chain: Chain, angle, poses=None) -> tuple[dict, ...]:
    """For each group by how much it can close [m] at given crank angles; negative or nan where it cannot."""
    return _place_all(chain, angle, poses or {})[1]


def ternaries(chain: Chain, angle, poses):
    """Poses (x, y, angle) of the ternary links after Newton's method from the given ones, and what ``gaps`` returns."""
    placed, slack, _ = _place_all(chain, angle, poses)
    found = {}
    for triad in chain.triads:
        pose, name = placed[triad.ternary.name], triad.ternary.name
        turn = turned(pose.e * conjugate(unit(poses[name][2])))
        found[name] = np.stack([pose.p.real, pose.p.imag, poses[name][2] + turn])
    return found, slack


def _place_all(chain: Chain, angle, poses):
    frame = _frame(angle)
    e = unit(angle)
    placed = {GROUND: frame}
    placed[chain.crank.name] = Pose(_pivot(chain, frame) - chain.pivot.point(chain.crank.name) * e, e)
    slack, found = [], []
    for group in chain.groups:
        if isinstance(group, Dyad):
            where = position.place(group, placed)
            slack.append(where.slack)
            poses_found = where.i, where.j
        else:
            where = triads.place(group, placed, poses[group.ternary.name])
            slack.append({"not closed by Newton's method": CLOSED * triads.size(group) - sum(map(abs, where.gaps))})
            poses_found = where.pose, *where.legs
        found.append(where)
        placed |= {link.name: pose for link, pose in zip(group.links, poses_found, strict=True)}
    return placed, tuple(slack), found


def _pivot(chain: Chain, frame: Moving):
    return frame.point(chain.pivot.point(GROUND))


def _frame(angle) -> Moving:
    """Ground, in the arithmetic of the crank angle."""
    if not isinstance(angle, Expression):
        return FRAME
    nought, unity = angle.graph.constant(0.0), angle.graph.constant(1.0)
    zero, one = Cartesian(nought, nought), Cartesian(unity, nought)
    return Moving(zero, one, zero, 0.0, zero, 0.0)
