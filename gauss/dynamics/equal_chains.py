"""Equal chains of a mechanism: legs of a platform or of a walking machine, arms, fingers, branches on a common body.

Chains are what is left of the tree and the loops without the ground and one body. They are equal if their joints can be
numbered so that they are, one after the other: their kinds, the bodies that they connect, their part in the tree. Their
dimensions and masses may differ.
"""

from collections import Counter, defaultdict
from typing import NamedTuple

from gauss.backends.structure import GROUND
from gauss.system import Subsystem, System

FEWEST_CHAINS, MOST_CHAINS = 2, 8  # chains that are computed together
MOST_TRIALS = 1000  # partial numberings of a chain: equal trees need one for each joint


class BodyChain(NamedTuple):
    """A chain of a subsystem, in the order of the first chain that it equals."""

    bodies: tuple[int, ...]  # bodies, joints: their indices
    joints: tuple[int, ...]


class EqualChains(NamedTuple):
    """Equal chains of a subsystem."""

    subsystem: Subsystem  # the one they are in
    chains: list[BodyChain]  # two or more

    @property
    def of_body(self) -> dict[int, tuple[int, int]]:
        """Chain of each of their bodies, and its place there."""
        return {body: (k, place) for k, chain in enumerate(self.chains) for place, body in enumerate(chain.bodies)}

    @property
    def of_joint(self) -> dict[int, tuple[int, int]]:
        """Chain of each of their joints, and its place there."""
        return {joint: (k, place) for k, chain in enumerate(self.chains) for place, joint in enumerate(chain.joints)}


class _Edge(NamedTuple):
    """Joint of a subsystem as chains are compared by it."""

    label: tuple  # its kind, and the axes along which it repeats other joints
    ends: tuple[int, int, int | None]  # parent, child, and the inner one of them if it is in the tree


def equal_chains(system: System) -> list[EqualChains]:
    """Equal chains of each kind, those with most joints together first; those of a subsystem meet on one body."""
    found = [EqualChains(subsystem, chains) for subsystem in system.subsystems for chains in _kinds(subsystem)]
    return sorted(found, key=lambda one: -_size([one.chains]))


def _kinds(subsystem: Subsystem) -> list[list[BodyChain]]:
    """Kinds of equal chains on the body with which they have most joints, the first of several."""
    inner = {edge.constraint: edge.inner for edge in subsystem.tree}
    axes: dict[int, list] = defaultdict(list)
    for index, axis in sorted(subsystem.redundant):
        axes[index].append(axis)
    edges = [
        _Edge((joint.pair.kind, *axes[index]), (joint.parent, joint.child, inner.get(index)))
        for index, joint in enumerate(subsystem.joints)
    ]
    joints_on = Counter(body for edge in edges for body in edge.ends[:2])
    hubs = [GROUND, *sorted(body for body, count in joints_on.items() if body != GROUND and count > FEWEST_CHAINS)]
    return max((_on_hub(edges, subsystem.n_bodies, hub) for hub in hubs), key=_size)


def _size(kinds: list[list[BodyChain]]) -> int:
    return sum(len(chain.joints) for chains in kinds for chain in chains)


def _on_hub(edges: list[_Edge], n_bodies: int, hub: int) -> list[list[BodyChain]]:
    """Kinds of equal chains between the ground and a body."""
    kinds: list[list[BodyChain]] = []
    for chain in _chains(edges, n_bodies, {GROUND, hub}):
        for own in kinds:
            if found := _in_order(edges, own[0], chain):
                own.append(found)
                break
        else:
            kinds.append([chain])
    return [chains[:MOST_CHAINS] for chains in kinds if len(chains) >= FEWEST_CHAINS]


def _chains(edges: list[_Edge], n_bodies: int, common: set[int]) -> list[BodyChain]:
    """Chains between common bodies."""
    chain_of = {body: {body} for body in range(n_bodies)}
    for edge in edges:
        if common.isdisjoint(edge.ends[:2]):
            joined = chain_of[edge.ends[0]] | chain_of[edge.ends[1]]
            chain_of |= dict.fromkeys(joined, joined)
    found: dict[tuple[int, ...], list[int]] = defaultdict(list)
    for index, edge in enumerate(edges):
        for body in sorted(set(edge.ends[:2]) - common)[:1]:
            found[tuple(sorted(chain_of[body]))].append(index)
    return [BodyChain(bodies, tuple(joints)) for bodies, joints in found.items()]


def _in_order(edges: list[_Edge], first: BodyChain, chain: BodyChain) -> BodyChain | None:
    """A chain in the order of the first one; None where it does not equal it."""
    if _parts(edges, first) != _parts(edges, chain):
        return None
    waiting: list[tuple[dict, tuple[int, ...]]] = [({}, ())]  # counterparts of bodies, and of the first joints
    for _ in range(MOST_TRIALS):
        if not waiting:
            break
        bodies, joints = waiting.pop()
        if len(joints) == len(first.joints):
            return BodyChain(tuple(bodies[body] for body in first.bodies), joints)
        edge = edges[first.joints[len(joints)]]
        for joint in reversed([joint for joint in chain.joints if joint not in joints]):
            more = _counterparts(edge, edges[joint], bodies, first, chain)
            waiting += [] if more is None else [(more, (*joints, joint))]
    return None


def _parts(edges: list[_Edge], chain: BodyChain) -> tuple[int, Counter]:
    """Number of bodies, and of joints of each label."""
    return len(chain.bodies), Counter(edges[joint].label for joint in chain.joints)


def _counterparts(edge: _Edge, other: _Edge, bodies: dict, first: BodyChain, chain: BodyChain) -> dict | None:
    """Counterparts of bodies with those of the ends of two joints; None where they contradict each other."""
    if edge.label != other.label:
        return None
    found = dict(bodies)
    for body, counterpart in zip(edge.ends, other.ends, strict=True):
        if body in first.bodies and body not in found:
            if counterpart not in chain.bodies or counterpart in found.values():
                return None
            found[body] = counterpart
        if found.get(body, body) != counterpart:
            return None
    return found
