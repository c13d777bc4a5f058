"""Equal chains of a mechanism: legs of a platform or of a walking machine, fingers, branches on a common body.

Chains are what is left of the tree and the loops without the ground and the body on which most joints are. They are equal
if their joints are, one after the other in the order of the scene: their kinds, the bodies that they connect, their part in
the tree. Their dimensions and masses may differ.
"""

from collections import Counter, defaultdict
from typing import NamedTuple

from gauss.backends.structure import GROUND
from gauss.system import Subsystem, System

FEWEST_CHAINS = 3  # two fill too little of a vector register
MOST_CHAINS = 8  # that are computed together


class BodyChain(NamedTuple):
    """Bodies and joints of a chain in a subsystem."""

    bodies: tuple[int, ...]
    joints: tuple[int, ...]


class EqualChains(NamedTuple):
    """Equal chains of a subsystem of a system."""

    subsystem: Subsystem
    chains: list[BodyChain]

    @property
    def of_body(self) -> dict[int, int]:
        """Chain of each of their bodies."""
        return {body: k for k, chain in enumerate(self.chains) for body in chain.bodies}

    @property
    def of_joint(self) -> dict[int, int]:
        """Chain of each of their joints."""
        return {joint: k for k, chain in enumerate(self.chains) for joint in chain.joints}


def equal_chains(system: System) -> EqualChains | None:
    """Equal chains with most joints together; None without any."""
    found = [EqualChains(subsystem, chains) for subsystem in system.subsystems for chains in _classes(subsystem)]
    return max(found, key=lambda one: sum(len(chain.joints) for chain in one.chains), default=None)


def _classes(subsystem: Subsystem) -> list[list[BodyChain]]:
    """Classes of equal chains."""
    classes: dict[tuple, list[BodyChain]] = defaultdict(list)
    for chain in _chains(subsystem):
        classes[_form(subsystem, chain)].append(chain)
    return [chains[:MOST_CHAINS] for chains in classes.values() if len(chains) >= FEWEST_CHAINS]


def _chains(subsystem: Subsystem) -> list[BodyChain]:
    """Chains between the ground and the body on which most joints are."""
    ends = [(joint.parent, joint.child) for joint in subsystem.joints]
    common = {GROUND, _hub(ends)}
    chain_of = {body: {body} for body in range(subsystem.n_bodies)}
    for pair in ends:
        if common.isdisjoint(pair):
            joined = chain_of[pair[0]] | chain_of[pair[1]]
            chain_of |= dict.fromkeys(joined, joined)
    found: dict[tuple[int, ...], list[int]] = defaultdict(list)
    for index, pair in enumerate(ends):
        for body in sorted(set(pair) - common)[:1]:
            found[tuple(sorted(chain_of[body]))].append(index)
    return [BodyChain(bodies, tuple(joints)) for bodies, joints in found.items()]


def _hub(ends: list[tuple[int, int]]) -> int:
    """Body on which most joints are, the first of several."""
    joints_on = Counter(body for pair in ends for body in pair if body != GROUND)
    return max(joints_on, key=lambda body: (joints_on[body], -body), default=GROUND)


def _form(subsystem: Subsystem, chain: BodyChain) -> tuple:
    """What equal chains have in common."""
    local = {body: f"own {k}" for k, body in enumerate(chain.bodies)}
    inner = {edge.constraint: edge.inner for edge in subsystem.tree}
    form = []
    for index in chain.joints:
        joint = subsystem.joints[index]
        ends = (joint.parent, joint.child, inner.get(index))  # of loop joints, no body is the inner one
        redundant = sorted(axis for own, axis in subsystem.redundant if own == index)
        form.append((joint.pair.kind, *(body if body is None else local.get(body, body) for body in ends), *redundant))
    return len(chain.bodies), *form
