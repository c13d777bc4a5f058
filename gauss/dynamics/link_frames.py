"""Link frames: chosen once so that as many constants as possible are zero.

The link frame of a body is the joint frame through which the tree reaches it. Where the pair is symmetric about its axis
the frame may turn about this axis by any constant angle; it is turned so that the axis of the next joint is reached by a
rotation about x alone, and so that the offset of parallel axes lies along x (the frames of Denavit and Hartenberg 1955).

Inertia of a body that acts as if it belonged to the inner body is regrouped to that one: joint-space dynamics are the same
with fewer numbers (base parameters, Gautier and Khalil 1990).
"""

from functools import singledispatch
from typing import NamedTuple

import numpy as np

from gauss import rotations
from gauss.backends.structure import Edge
from gauss.rotations import skew
from gauss.system import PlacedJoint, Subsystem

SYMMETRIC = frozenset({"revolute", "prismatic", "cylindrical", "screw"})  # about the axis of the pair
PARALLEL = 1e-12  # sine of the angle between axes that are meant as parallel


class Link(NamedTuple):
    """Constants of a link."""

    R: np.ndarray  # R, p: from the inner link frame to the joint: rotation (3, 3), joint point on the inner side (3,) [m]
    p: np.ndarray
    turn: np.ndarray  # (3, 3): constant turn about the axis of the joint that remains, to the outer link frame
    inertia: tuple[np.ndarray, np.ndarray, np.ndarray]  # blocks A, B, C of the regrouped inertia in the outer link frame
    first: np.ndarray  # (3,): regrouped mass times the centre of mass there [kg m]
    # R_central, p_central: the link frame in the principal central frame of the body: rotation, origin [m]; empty in
    # kernels
    R_central: np.ndarray = np.zeros((0, 0))
    p_central: np.ndarray = np.zeros(0)


@singledispatch
def link_frames(subsystem: Subsystem) -> dict[int, Link]:
    """Link of every body by its index; −1 is the ground. Dispatches on the type of the subsystem."""
    edges = {edge.outer: edge for edge in subsystem.tree}
    first: dict[int, Edge] = {}  # edge to the first child of each body
    for edge in subsystem.tree:
        first.setdefault(edge.inner, edge)
    turns = {body: _turn(subsystem, edge, first.get(body)) for body, edge in edges.items()}
    frames = {body: _turned(_sides(subsystem.joints[edge.constraint], edge)[0], turns[body]) for body, edge in edges.items()}
    frames[-1] = np.eye(3), np.zeros(3)
    still = np.eye(3), np.zeros(3)
    ground = Link(*still, np.eye(3), (np.zeros((3, 3)),) * 3, np.zeros(3), *still)
    links = {-1: ground} | {
        body: _link(subsystem, edge, frames, turns[body], first[edge.inner] is edge) for body, edge in edges.items()
    }
    for body, kept in _regrouped(subsystem, links).items():
        if body >= 0:
            inertia = kept.inertia, skew(kept.first), kept.mass * np.eye(3)
            links[body] = links[body]._replace(inertia=inertia, first=kept.first)
    return links


def ground_share(subsystem: Subsystem, links: dict[int, Link]) -> tuple[float, np.ndarray]:
    """Mass, and mass times its centre (3,) in world, of what is regrouped to the ground: it stays in its place."""
    share = _regrouped(subsystem, links)[-1]
    return share.mass, share.first


@singledispatch
def joint_sides(subsystem: Subsystem, links: dict[int, Link], index: int) -> dict[int, tuple[np.ndarray, np.ndarray]]:
    """Frame of a joint on its two bodies, in their link frames, by body. Dispatches on the type of the subsystem."""
    joint = subsystem.joints[index]
    sides = {joint.parent: (joint.R_parent, joint.p_parent), joint.child: (joint.R_child, joint.p_child)}
    turns = {body: (links[body].R_central.T, links[body].p_central) for body in sides}
    return {body: (rotations.clean(turn @ sides[body][0]), turn @ (sides[body][1] - p)) for body, (turn, p) in turns.items()}


def _link(subsystem: Subsystem, edge: Edge, frames, own_turn: float, is_first: bool) -> Link:
    joint = subsystem.joints[edge.constraint]
    _, (R_side, p_side) = _sides(joint, edge)
    R_base, p_base = frames[edge.inner]
    R, remaining = rotations.clean(R_base.T @ R_side), 0.0
    if joint.pair.kind in SYMMETRIC and is_first:
        tilt = rotations.clean(rotations.about_x(np.arctan2(-R[1, 2], R[2, 2])))
        if abs(R[0, 2]) <= PARALLEL:  # the inner frame was turned to this axis: only a turn about it remains
            rest = tilt.T @ R
            R, remaining = tilt, np.arctan2(rest[1, 0], rest[0, 0])
    turn = rotations.clean(rotations.about_z(remaining + own_turn))
    offset = _clean(R_base.T @ (p_side - p_base))
    return Link(R, offset, turn, (np.zeros((3, 3)),) * 3, np.zeros(3), *frames[edge.outer])


class Mass(NamedTuple):
    """Inertia about the origin of a frame."""

    mass: float  # [kg]
    first: np.ndarray  # (3,) mass times its centre [kg m]
    inertia: np.ndarray  # (3, 3) moments and products [kg m²]

    def plus(self, other: "Mass") -> "Mass":
        """Sum of both."""
        return Mass(self.mass + other.mass, self.first + other.first, self.inertia + other.inertia)


def _mass(subsystem: Subsystem, body: int, link: Link) -> Mass:
    J, mass = subsystem.Phi[6 * body : 6 * body + 3], float(subsystem.Phi[6 * body + 3])
    com = -link.R_central.T @ link.p_central
    central = link.R_central.T @ np.diag(J) @ link.R_central
    return Mass(mass, mass * com, central + mass * (com @ com * np.eye(3) - np.outer(com, com)))


def _regrouped(subsystem: Subsystem, links: dict[int, Link]) -> dict[int, Mass]:
    """Inertia of each link about its origin, with shares of outer ones that act as if they belonged to it; −1: ground."""
    masses = {-1: Mass(0.0, np.zeros(3), np.zeros((3, 3)))}
    masses |= {edge.outer: _mass(subsystem, edge.outer, links[edge.outer]) for edge in subsystem.tree}
    for edge in reversed(subsystem.tree):
        joint, link = subsystem.joints[edge.constraint], links[edge.outer]
        masses[edge.outer], given = _split(joint.pair.kind, masses[edge.outer])
        masses[edge.inner] = masses[edge.inner].plus(_moved(given, link.R @ link.turn, link.p))
    return masses


def _split(kind: str, own: Mass) -> tuple[Mass, Mass]:
    """Share of an inertia that stays with a link, and the share that is regrouped to the inner link."""
    none = Mass(0.0, np.zeros(3), np.zeros((3, 3)))
    if kind == "fixed":
        return none, own
    if kind == "prismatic":  # same rotation as the inner link
        return own._replace(inertia=none.inertia), none._replace(inertia=own.inertia)
    if kind != "revolute":
        return own, none
    # a thin rod along the axis is regrouped
    along = Mass(own.mass, np.array([0.0, 0.0, own.first[2]]), np.diag([1.0, 1.0, 0.0]) * own.inertia[1, 1])
    return Mass(0.0, own.first * [1.0, 1.0, 0.0], own.inertia - along.inertia), along


def _moved(own: Mass, R: np.ndarray, p: np.ndarray) -> Mass:
    """The same inertia about the origin of another frame."""
    first, inertia = R @ own.first, R @ own.inertia @ R.T
    about = lambda a, b: a @ b * np.eye(3) - (np.outer(a, b) + np.outer(b, a)) / 2  # noqa: E731
    return Mass(own.mass, first + own.mass * p, inertia + own.mass * about(p, p) + 2 * about(p, first))


def _turn(subsystem: Subsystem, edge: Edge, onward: Edge | None) -> float:
    """Angle by which the joint frame of a body is turned about its axis, towards the joint of its first child."""
    if onward is None or subsystem.joints[edge.constraint].pair.kind not in SYMMETRIC:
        return 0.0
    R_own, p_own = _sides(subsystem.joints[edge.constraint], edge)[0]
    _, (R_next, p_next) = _sides(subsystem.joints[onward.constraint], onward)
    axis, offset = R_own.T @ R_next[:, 2], R_own.T @ (p_next - p_own)
    if np.hypot(axis[0], axis[1]) > PARALLEL:
        return float(np.arctan2(axis[0], -axis[1]))
    return float(np.arctan2(offset[1], offset[0]))


def _sides(joint: PlacedJoint, edge: Edge):
    """Joint frame on the outer and on the inner body, in their central frames."""
    on_parent, on_child = (joint.R_parent, joint.p_parent), (joint.R_child, joint.p_child)
    return (on_child, on_parent) if edge.outer == joint.child else (on_parent, on_child)


def _turned(frame, angle: float):
    return rotations.clean(frame[0] @ rotations.about_z(angle)), frame[1]


def _clean(p: np.ndarray) -> np.ndarray:
    """Offsets with entries below 1e-15 of the largest set to zero."""
    return np.where(np.abs(p) <= 1e-15 * np.abs(p).max(initial=0.0), 0.0, p)
