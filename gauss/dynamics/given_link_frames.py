"""Parts that know their links: where they cannot be found anew, or are to be others."""

from dataclasses import dataclass, field, fields, replace

import numpy as np

from gauss.dynamics.link_frames import Link, joint_sides, link_frames
from gauss.rotations import skew
from gauss.system import Subsystem


@dataclass(frozen=True)
class GivenLinkFrames(Subsystem):
    """Part whose link frames are known, because they cannot be found from parameters.

    Parameters
    ----------
    links : dict
        Link of every body.
    sides : dict
        Frames of the joints that close loops on their two bodies, by index of the joint.
    """

    links: dict[int, Link] = field(default_factory=dict)
    sides: dict[int, dict] = field(default_factory=dict)


@link_frames.register
def _(part: GivenLinkFrames) -> dict[int, Link]:
    return part.links


@joint_sides.register
def _(part: GivenLinkFrames, links, index: int) -> dict:
    return part.sides[index]


def known(part: Subsystem) -> GivenLinkFrames:
    """The same part with its links."""
    links = link_frames(part)
    own = {f.name: getattr(part, f.name) for f in fields(Subsystem)}
    return GivenLinkFrames(**own, links=links, sides={index: joint_sides(part, links, index) for index in part.closing})


def ungrouped(part: Subsystem) -> GivenLinkFrames:
    """The same part with links each of which has the inertia of its own body and nothing else.

    What is given to inner links moves as they do only as long as joints hold exactly.
    """
    part = known(part)
    links = {body: own_inertia(link, part.Phi[6 * body : 6 * body + 6]) for body, link in part.links.items() if body >= 0}
    return replace(part, links=part.links | links)


def own_inertia(link: Link, Phi) -> Link:
    """Link with the inertia of a body with moments and mass Φ (6,)."""
    R, mass = link.R_central, Phi[3]
    first = -mass * (R.T @ link.p_central)
    lever = skew(-R.T @ link.p_central)
    inertia = R.T @ (Phi[:3, None] * R) - mass * (lever @ lever)
    return link._replace(inertia=(inertia, skew(first), mass * np.eye(3)), first=first)
