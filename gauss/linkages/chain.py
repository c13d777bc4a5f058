"""Decomposition of a linkage: crank and Assur groups in the order in which they are placed."""

from dataclasses import dataclass

import numpy as np

from gauss.linkages.elements import Driver, LinkJoint, Load, PlanarLink

# Kinds of dyads by their joints, outer, inner, outer: R a pin, P a slide.
WITH_MODES = ("RRR", "RRP", "RPR")  # two assembly modes; the others have one


@dataclass(frozen=True)
class Leg:
    """Link of a group with its outer joint, on a carrier placed before."""

    link: PlanarLink
    joint: LinkJoint

    @property
    def name(self) -> str:
        """Name of the link."""
        return self.link.name

    @property
    def carrier(self) -> str:
        """Link placed before."""
        return self.joint.other(self.link.name)


@dataclass(frozen=True)
class Dyad:
    """Group of class II: two links, an inner joint and two outer ones.

    Parameters
    ----------
    kind : str
        RRR, RRP, RPR, PRP or RPP.
    i, j : Leg
        First and second link. i is the one on the outer pin where only one is on a pin, else the child of the inner joint.
    inner : LinkJoint
        Joint between them.
    mode : int
        Assembly mode, +1 or −1. RRR: +1 when the inner pin lies to the left of the line from the outer pin of i
        to that of j; RRP: the inner pin lies further along the guide than the foot of the outer pin; RPR: so does the outer
        pin of i against that of j.

    Examples
    --------
    >>> import gauss
    >>> bar = gauss.load_linkage("four_bar")
    >>> dyad = bar.chain.groups[0]
    >>> dyad.kind, dyad.name, dyad.mode
    ('RRR', 'RRR group (coupler, rocker)', 1)
    """

    kind: str
    i: Leg
    j: Leg
    inner: LinkJoint
    mode: int

    @property
    def legs(self) -> tuple[Leg, ...]:
        """Links with their outer joints."""
        return self.i, self.j

    @property
    def inners(self) -> tuple[LinkJoint, ...]:
        """Inner joints: one."""
        return (self.inner,)

    @property
    def links(self) -> tuple[PlanarLink, ...]:
        """Links of the group."""
        return self.i.link, self.j.link

    @property
    def name(self) -> str:
        """Name for messages."""
        return f"{self.kind} group ({self.i.name}, {self.j.name})"


@dataclass(frozen=True)
class Triad:
    """Group of class III: a ternary link pinned to three legs with outer joints on carriers placed before.

    Parameters
    ----------
    ternary : PlanarLink
        The link in the middle.
    legs : tuple of Leg
        The three legs.
    inners : tuple of LinkJoint
        Pins between the ternary link and the legs, in their order.
    pose : tuple
        Pose of the ternary link near the start of the cycle: x, y [m], angle [rad].

    Examples
    --------
    >>> import gauss
    >>> linkage = gauss.load_linkage("class_three")
    >>> triad = linkage.chain.triads[0]
    >>> triad.ternary.name, [joint.name for joint in triad.inners]
    ('ternary', ['E', 'F', 'G'])
    """

    ternary: PlanarLink
    legs: tuple[Leg, ...]
    inners: tuple[LinkJoint, ...]
    pose: tuple[float, float, float]

    kind = "class III"

    @property
    def links(self) -> tuple[PlanarLink, ...]:
        """Links of the group."""
        return self.ternary, *(leg.link for leg in self.legs)

    @property
    def name(self) -> str:
        """Name for messages."""
        return f"class III group ({', '.join(link.name for link in self.links)})"


@dataclass(frozen=True)
class Chain:
    """Linkage in the order of its analysis: kinematics forward along the groups, forces backward.

    Parameters
    ----------
    name : str
        Name of the linkage.
    gravity : complex
        Acceleration of gravity [m/s²].
    driver : Driver
        Motion of the crank.
    pivot : LinkJoint
        Pin of the crank on the ground.
    crank : PlanarLink
        The crank.
    groups : tuple of Dyad or Triad
        Groups in order.
    loads : tuple of Load
        All loads.

    Examples
    --------
    >>> import gauss
    >>> bar = gauss.load_linkage("four_bar")
    >>> chain = bar.chain
    >>> [group.kind for group in chain.groups], [joint.name for joint in chain.joints]
    (['RRR'], ['A', 'B', 'C', 'D'])
    """

    name: str
    gravity: complex
    driver: Driver
    pivot: LinkJoint
    crank: PlanarLink
    groups: tuple[Dyad | Triad, ...]
    loads: tuple[Load, ...]

    @property
    def links(self) -> tuple[PlanarLink, ...]:
        """All moving links, in the order in which they are placed."""
        return self.crank, *(link for group in self.groups for link in group.links)

    @property
    def joints(self) -> tuple[LinkJoint, ...]:
        """All joints, in the order of the groups."""
        found = [self.pivot]
        for group in self.groups:
            found += [group.legs[0].joint, *group.inners, *(leg.joint for leg in group.legs[1:])]
        return tuple(found)

    @property
    def triads(self) -> tuple[Triad, ...]:
        """Groups of class III."""
        return tuple(group for group in self.groups if isinstance(group, Triad))

    @property
    def mode_joints(self) -> tuple[str, ...]:
        """Inner joints of the dyads with two assembly modes."""
        dyads = (group for group in self.groups if isinstance(group, Dyad) and group.kind in WITH_MODES)
        return tuple(dyad.inner.name for dyad in dyads)

    def __str__(self):
        lines = [f"{self.name}: kinematics from top to bottom, forces from bottom to top"]
        lines.append(f"  crank      {self.crank.name}, on the ground at {self.pivot.name}")
        for group in self.groups:
            hung = ", ".join(f"{leg.name} on {leg.carrier} at {leg.joint.name}" for leg in group.legs)
            if isinstance(group, Triad):
                met = f"{group.ternary.name} on {', '.join(joint.name for joint in group.inners)}"
            else:
                mode = f", mode {group.mode:+d}" if group.kind in WITH_MODES else ""
                met = f"joined at {group.inner.name}{mode}"
            lines.append(f"  {group.kind:10} {hung}; {met}")
        return "\n".join(lines)


def full_turn(chain: Chain, count: int) -> np.ndarray:
    """Crank angles (count,) [rad] of one turn from the start of the cycle, end left out, in the sense of its motion."""
    return np.linspace(chain.driver.start, end_of_turn(chain), count, endpoint=False)


def end_of_turn(chain: Chain) -> float:
    """Crank angle after a turn from the start of the cycle [rad]."""
    return chain.driver.start + float(np.copysign(2 * np.pi, chain.driver.speed))
