"""Subsystems with given link frames: with symbolic geometry (parameters), or with inertias that are not regrouped."""

from dataclasses import dataclass, field, fields, replace

import numpy as np

from gauss.dynamics.link_frames import Link, joint_sides, link_frames
from gauss.rotations import skew
from gauss.system import Subsystem


@dataclass(frozen=True)
class GivenLinkFrames(Subsystem):
    """Subsystem with given link frames, which do not follow from parameters."""

    links: dict[int, Link] = field(default_factory=dict)  # link of every body
    # frames of the loop joints on their two bodies, by index of the joint
    sides: dict[int, dict] = field(default_factory=dict)


@link_frames.register
def _(subsystem: GivenLinkFrames) -> dict[int, Link]:
    return subsystem.links


@joint_sides.register
def _(subsystem: GivenLinkFrames, links, index: int) -> dict:
    return subsystem.sides[index]


def with_given_frames(subsystem: Subsystem) -> GivenLinkFrames:
    """Subsystem with its present link frames given."""
    links = link_frames(subsystem)
    own = {f.name: getattr(subsystem, f.name) for f in fields(Subsystem)}
    return GivenLinkFrames(
        **own, links=links, sides={index: joint_sides(subsystem, links, index) for index in subsystem.loop_joints}
    )


def ungrouped(subsystem: Subsystem) -> GivenLinkFrames:
    """Subsystem with the inertia of its own body at each link.

    Regrouped inertias move with inner links only as far as joints are exact.
    """
    subsystem = with_given_frames(subsystem)
    links = {
        body: own_inertia(link, subsystem.Phi[6 * body : 6 * body + 6])
        for body, link in subsystem.links.items()
        if body >= 0
    }
    return replace(subsystem, links=subsystem.links | links)


def with_moved_joint(subsystem: Subsystem, index: int, body: int, shift) -> GivenLinkFrames:
    """Subsystem, its inertias not regrouped, whose joint has another place on one of its bodies.

    ``index``, ``body``: the joint, and the body on which it moves. ``shift`` (3,): displacement of the joint in the
    principal central frame of the body [m], floats or expressions.
    """
    given = ungrouped(subsystem)
    links, sides, turned = dict(given.links), dict(given.sides), given.links[body].R_central.T @ shift
    outer = next((edge.outer for edge in given.tree if edge.constraint == index), None)

    def on_body(k: int, by):
        """The joint k with its place on the body displaced by a vector of the link frame."""
        R, p = sides[k][body]
        sides[k] = sides[k] | {body: (R, p + by)}

    if outer is None:
        on_body(index, turned)
    elif outer != body:
        links[outer] = links[outer]._replace(p=links[outer].p + turned)
    else:  # the link frame moves with the joint, and all else on the body against it
        link = links[body]._replace(p_central=links[body].p_central + shift)
        links[body] = own_inertia(link, given.Phi[6 * body : 6 * body + 6])
        for edge in given.tree:
            if edge.inner == body:
                links[edge.outer] = links[edge.outer]._replace(p=links[edge.outer].p - turned)
        for k in given.loop_joints:
            if body in sides[k]:
                on_body(k, -turned)
    return replace(given, links=links, sides=sides)


def own_inertia(link: Link, Phi) -> Link:
    """Link with the inertia of a body with moments and mass Φ (6,)."""
    R, mass = link.R_central, Phi[3]
    first = -mass * (R.T @ link.p_central)
    lever = skew(-R.T @ link.p_central)
    inertia = R.T @ (Phi[:3, None] * R) - mass * (lever @ lever)
    return link._replace(inertia=(inertia, skew(first), mass * np.eye(3)), first=first)
