"""Link frames: chosen once so that as many constants as possible are zero.

The link frame of a body is the joint frame through which the tree reaches it. Where the pair is symmetric about its axis
the frame may turn about this axis by any constant angle; it is turned so that the axis of the next joint is reached by a
rotation about x alone, and so that the offset of parallel axes lies along x (the frames of Denavit and Hartenberg 1955).
"""

from typing import NamedTuple

import numpy as np

from gauss import rotations
from gauss.compulsion.structure import Edge
from gauss.rotations import skew
from gauss.system import PlacedJoint, System

SYMMETRIC = frozenset({"revolute", "prismatic", "cylindrical", "screw"})  # about the axis of the pair
PARALLEL = 1e-12  # sine of the angle between axes that are meant as parallel


class Link(NamedTuple):
    """Constants of a link.

    Attributes
    ----------
    R, p : ndarray
        From the inner link frame to the joint: rotation (3, 3), joint point on the inner side (3,) [m].
    turn : ndarray, shape (3, 3)
        Constant turn about the axis of the joint that remains, to the outer link frame.
    inertia : tuple of ndarray
        Blocks A, B, C of the rigid-body inertia in the outer link frame.
    mass : float
        Mass [kg].
    first : ndarray, shape (3,)
        Mass times the centre of mass there [kg m].
    R_central, p_central : ndarray
        The link frame in the principal central frame of the body: rotation, origin [m].
    """

    R: np.ndarray
    p: np.ndarray
    turn: np.ndarray
    inertia: tuple[np.ndarray, np.ndarray, np.ndarray]
    mass: float
    first: np.ndarray
    R_central: np.ndarray
    p_central: np.ndarray


def link_frames(system: System) -> dict[int, Link]:
    """Link of every body by its index; −1 is the ground."""
    edges = {edge.outer: edge for edge in system.structure.tree}
    turns = {body: _turn(system, edge, _first_child(system, body)) for body, edge in edges.items()}
    frames = {body: _turned(_sides(system.joints[edge.constraint], edge)[0], turns[body]) for body, edge in edges.items()}
    frames[-1] = np.eye(3), np.zeros(3)
    still = np.eye(3), np.zeros(3)
    ground = Link(*still, np.eye(3), (np.zeros((3, 3)),) * 3, 0.0, np.zeros(3), *still)
    return {-1: ground} | {body: _link(system, edge, frames, turns[body]) for body, edge in edges.items()}


def _link(system: System, edge: Edge, frames, own_turn: float) -> Link:
    joint = system.joints[edge.constraint]
    _, (R_side, p_side) = _sides(joint, edge)
    R_base, p_base = frames[edge.inner]
    R, remaining = rotations.clean(R_base.T @ R_side), 0.0
    if joint.pair.kind in SYMMETRIC and edge.outer == _first_child(system, edge.inner):
        tilt = rotations.clean(rotations.about_x(np.arctan2(-R[1, 2], R[2, 2])))
        if abs(R[0, 2]) <= PARALLEL:  # the inner frame was turned to this axis: only a turn about it remains
            rest = tilt.T @ R
            R, remaining = tilt, np.arctan2(rest[1, 0], rest[0, 0])
    turn = rotations.clean(rotations.about_z(remaining + own_turn))
    R_link, p_link = frames[edge.outer]
    J, mass = system.Phi[6 * edge.outer : 6 * edge.outer + 3], float(system.Phi[6 * edge.outer + 3])
    com = -R_link.T @ p_link
    central = R_link.T @ np.diag(J) @ R_link
    inertia = (central + mass * (com @ com * np.eye(3) - np.outer(com, com)), skew(mass * com), mass * np.eye(3))
    offset = _clean(R_base.T @ (p_side - p_base))
    return Link(R, offset, turn, inertia, mass, mass * com, R_link, p_link)


def _turn(system: System, edge: Edge, child: int | None) -> float:
    """Angle by which the joint frame of a body is turned about its axis, towards the joint of its first child."""
    if child is None or system.joints[edge.constraint].pair.kind not in SYMMETRIC:
        return 0.0
    onward = next(e for e in system.structure.tree if e.outer == child)
    R_own, p_own = _sides(system.joints[edge.constraint], edge)[0]
    _, (R_next, p_next) = _sides(system.joints[onward.constraint], onward)
    axis, offset = R_own.T @ R_next[:, 2], R_own.T @ (p_next - p_own)
    if np.hypot(axis[0], axis[1]) > PARALLEL:
        return float(np.arctan2(axis[0], -axis[1]))
    return float(np.arctan2(offset[1], offset[0]))


def _first_child(system: System, body: int) -> int | None:
    return next((edge.outer for edge in system.structure.tree if edge.inner == body), None)


def _sides(joint: PlacedJoint, edge: Edge):
    """Joint frame on the outer and on the inner body, in their central frames."""
    on_parent, on_child = (joint.R_parent, joint.p_parent), (joint.R_child, joint.p_child)
    return (on_child, on_parent) if edge.outer == joint.child else (on_parent, on_child)


def _turned(frame, angle: float):
    return rotations.clean(frame[0] @ rotations.about_z(angle)), frame[1]


def _clean(p: np.ndarray) -> np.ndarray:
    """Offsets without rounding dirt: what is 1e-15 of the largest is zero."""
    return np.where(np.abs(p) <= 1e-15 * np.abs(p).max(initial=0.0), 0.0, p)
