"""Kinematics of a chain of groups at given crank angles: forward, group after group; condition numbers of the groups."""

from dataclasses import dataclass

import numpy as np

from gauss.codegen import Expression
from gauss.linkages import dyad as dyads
from gauss.linkages import triad as triads
from gauss.linkages.chain import Chain, Dyad
from gauss.linkages.placed import FRAME, LinkMotion, PinFreedom, Pose, Real, moved
from gauss.linkages.plane import Cartesian, conjugate, rounded, unit
from gauss.linkages.plane import angle as turned
from gauss.scene import GROUND

CLOSED = 1e-10  # loop residual of a class III group, relative to its size, at which Newton's method has converged


@dataclass(frozen=True)
class LinkageKinematics:
    """Positions, velocities and accelerations of all links; arrays with one entry for each crank angle.

    Parameters
    ----------
    crank_angle, crank_speed : ndarray
        Angle [rad] and speed [rad/s] of the crank.
    links : dict of LinkMotion
        Links by name, the ground among them.
    freedoms : tuple
        Freedoms of the groups at their inner joints, in order.
    slack : tuple of dict
        For each group: reason for a failed assembly, and closure slack [m], negative where it fails.
    """

    chain: Chain
    crank_angle: Real
    crank_speed: Real
    links: dict[str, LinkMotion]
    freedoms: tuple
    slack: tuple[dict, ...]


def move(chain: Chain, angle, speed, acceleration, poses=None) -> LinkageKinematics:
    """Motion at given crank angles, assembled or not.

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
    frame = _frame(angle)
    moving: dict[str, LinkMotion] = {GROUND: frame}
    every: list[dyads.DyadFreedoms | triads.TriadFreedoms] = []
    crank = placed[chain.crank.name]
    moving[chain.crank.name] = moved(crank, PinFreedom(_pivot(chain, frame), 0 * frame.p, 0 * frame.p), speed, acceleration)
    for group, where in zip(chain.groups, found, strict=True):
        links: tuple[LinkMotion, ...]
        if isinstance(group, Dyad):
            assert isinstance(where, dyads.DyadPoses)
            of_dyad = dyads.freedoms_of(group, moving, (where.i, where.j))
            links = dyads.move(of_dyad, (where.i, where.j))
            every.append(of_dyad)
        else:
            assert isinstance(where, triads.Placed)
            of_triad = triads.freedoms_of(group, moving, where)
            links = triads.move(of_triad)
            every.append(of_triad)
        moving |= {link.name: motion for link, motion in zip(group.links, links, strict=True)}
    return LinkageKinematics(chain, angle, speed, moving, tuple(every), slack)


def closure_slack(chain: Chain, angle, poses=None) -> tuple[dict, ...]:
    """Closure slack [m] of each group at crank angles: negative or nan where it cannot be assembled."""
    return _place_all(chain, angle, poses or {})[1]


def ternaries(chain: Chain, angle, poses):
    """Poses (x, y, angle) of the ternary links after Newton's method from the given ones, and their closure slack."""
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
    placed: dict[str, Pose] = {GROUND: frame}
    placed[chain.crank.name] = Pose(_pivot(chain, frame) - chain.pivot.point(chain.crank.name) * e, e)
    slack: list[dict] = []
    found: list[dyads.DyadPoses | triads.Placed] = []
    for group in chain.groups:
        links: tuple[Pose, ...]
        if isinstance(group, Dyad):
            dyad = dyads.place(group, placed)
            slack.append(dyad.slack)
            links = dyad.i, dyad.j
            found.append(dyad)
        else:
            triad = triads.place(group, placed, poses[group.ternary.name])
            slack.append({"not closed by Newton's method": CLOSED * triads.size(group) - sum(map(abs, triad.residuals))})
            links = triad.pose, *triad.legs
            found.append(triad)
        placed |= {link.name: pose for link, pose in zip(group.links, links, strict=True)}
    return placed, tuple(slack), found


def _pivot(chain: Chain, frame: LinkMotion):
    return frame.point(chain.pivot.point(GROUND))


def _frame(angle) -> LinkMotion:
    """Ground, in the arithmetic of the crank angle."""
    if not isinstance(angle, Expression):
        return FRAME
    nought, unity = angle.graph.constant(0.0), angle.graph.constant(1.0)
    zero, one = Cartesian(nought, nought), Cartesian(unity, nought)
    return LinkMotion(zero, one, zero, 0.0, zero, 0.0)


def conditions(motion: LinkageKinematics) -> np.ndarray:
    """Condition numbers (n, k) of the matrices of all groups, lengths made free of units; infinite or nan where singular."""
    size = np.shape(rounded(motion.crank_angle))
    pairs = zip(motion.chain.groups, motion.freedoms, strict=True)
    return np.array([np.broadcast_to(_condition(*pair), size) for pair in pairs]).reshape(-1, *size)


def _condition(group, freedoms) -> np.ndarray:
    """Condition number (k,) of the matrix of a group at its inner joints."""
    if isinstance(group, Dyad):  # of two unit rows at this angle: cot(angle / 2)
        quality = rounded(freedoms.quality)
        return (abs(quality) + quality.real) / quality.imag
    matrix = triads.matrix(freedoms)
    return np.where(np.isfinite(matrix).all((1, 2)), np.linalg.cond(np.nan_to_num(matrix)), np.inf)
