"""What of a system is stepped: a mechanism that moves by itself, modelled by no more than it needs.

A :class:`System` says everything, in maximal coordinates; it is what is assembled, certified and audited. Its parts are what
forward dynamics in joint coordinates sees. Each pass of ``gauss.system.passes`` turns a part into smaller ones; all of them
keep the names of joints, so that coordinates and forces find their way.
"""

from dataclasses import dataclass, field
from functools import cached_property
from heapq import heappop, heappush
from typing import NamedTuple

import numpy as np

from gauss.backends.structure import Edge
from gauss.errors import StateError
from gauss.scene import Coupling
from gauss.system.elimination_cost import GROUND, loop_elimination_work, meetings
from gauss.system.placed_elements import PlacedFrame, PlacedJoint


class Train(NamedTuple):
    """Joints that one coordinate moves: q̇ of each is its ratio times the rate of the first."""

    joints: tuple[int, ...]
    ratios: tuple[float, ...]


class Bound(NamedTuple):
    """A relation that binds a part: its number among those of the system, its bodies there, names of its joints, rows."""

    index: int
    bodies: tuple[int, ...]
    joints: tuple[str, ...]
    size: int


@dataclass(frozen=True)
class Subsystem:
    """Mechanism in joint coordinates.

    Parameters
    ----------
    names : tuple of str
        Names of its n bodies; what is welded together is called after one of them.
    Phi : ndarray, shape (6n,)
        Inertias J1, J2, J3 [kg m²] and masses m, m, m [kg] of its bodies.
    gravity : ndarray, shape (3,)
        Acceleration of gravity in world axes [m/s²].
    joints : tuple of PlacedJoint
        Its joints; bodies, coordinates and rates are numbered within the part.
    couplings : tuple of Coupling
        Couplings that are met by rows.
    tree : tuple of Edge
        Spanning tree, inner bodies first; an edge names the index of its joint.
    carried : dict
        Principal central frame of each body of the system that it carries, by the index of that body, on its own bodies.
    q, v : ndarray of int
        Places of its coordinates and rates among those of the system.
    relations : tuple of Bound
        Relations that bind it.
    redundant : frozenset of (int, int)
        Rows (joint, axis) that say 0 = 0 or repeat others; axes of the joint frame, rotation 0 to 2, translation 3 to 5.
    trains : tuple of Train
        Couplings that are built into the recursion.
    held : dict
        Joints that cannot move, which no part has any more, and the coordinates at which they were found.
    """

    names: tuple[str, ...]
    Phi: np.ndarray
    gravity: np.ndarray
    joints: tuple[PlacedJoint, ...]
    couplings: tuple[Coupling, ...]
    tree: tuple[Edge, ...]
    carried: dict[int, PlacedFrame]
    q: np.ndarray
    v: np.ndarray
    relations: tuple[Bound, ...] = ()
    redundant: frozenset = frozenset()
    trains: tuple[Train, ...] = ()
    held: dict[str, tuple] = field(default_factory=dict)

    @property
    def n_bodies(self) -> int:
        """Number of bodies, n."""
        return len(self.names)

    @property
    def n_v(self) -> int:
        """Number of rates."""
        return len(self.v)

    @cached_property
    def size(self) -> float:
        """Largest component of the places of its joints on their bodies [m]."""
        return max((float(np.abs(p).max()) for joint in self.joints for p in (joint.p_parent, joint.p_child)), default=0.0)

    @cached_property
    def closing(self) -> tuple[int, ...]:
        """Joints outside the tree: they close loops."""
        in_tree = {edge.constraint for edge in self.tree}
        return tuple(i for i in range(len(self.joints)) if i not in in_tree)

    @property
    def n_coordinates(self) -> int:
        """Number of coordinates that are stepped."""
        return self.n_v - sum(len(train.joints) - 1 for train in self.trains)

    @property
    def n_rows(self) -> int:
        """Number of rows that bind its bodies and coordinates."""
        return 6 * len(self.joints) + len(self.couplings) - len(self.redundant) + sum(r.size for r in self.relations)

    @property
    def n_loop_constraints(self) -> int:
        """Number of rows that close loops or tie coordinates together."""
        held = sum(6 - self.joints[i].pair.n_v for i in self.closing)
        tied = len(self.couplings) + sum(relation.size for relation in self.relations)
        return held + tied - sum(i in self.closing for i, _ in self.redundant)

    @cached_property
    def loop_elimination_work(self) -> int:
        """Operations that meeting the closing rows takes, roughly."""
        return loop_elimination_work(self)

    @cached_property
    def meetings(self) -> int:
        """Pairs of loops that meet at a joint of the tree, summed over the joints."""
        return meetings(self)

    def has(self, name: str) -> bool:
        """Whether it has a joint of this name."""
        return any(joint.name == name for joint in self.joints)

    def joint(self, name: str) -> PlacedJoint:
        """Return the joint of this name."""
        return self.joints[self.index(name)]

    def index(self, name: str) -> int:
        """Return the index of the joint of this name.

        Raises
        ------
        StateError
            If there is none.
        """
        found = next((i for i, joint in enumerate(self.joints) if joint.name == name), None)
        if found is None:
            raise StateError(f"joint {name!r} is not part of what is stepped.")
        return found


def whole(system) -> Subsystem:
    """All of a system as one part, nothing reduced."""
    n = system.structure.n_bodies
    return Subsystem(
        names=system.structure.bodies,
        Phi=system.Phi,
        gravity=np.array(system.scene.gravity),
        joints=system.joints,
        couplings=tuple(system.scene.couplings.values()),
        tree=system.structure.tree,
        carried={i: PlacedFrame(i, np.eye(3), np.zeros(3)) for i in range(n)},
        q=np.arange(system.n_q),
        v=np.arange(system.n_v),
        relations=tuple(
            Bound(index, placed.bodies, tuple(system.joints[j].name for j in placed.joints), placed.size)
            for index, placed in enumerate(system.relations.placed)
        ),
    )


def spanning_tree(joints, preference=None) -> tuple[Edge, ...]:
    """Edges from the ground to every body, inner bodies first.

    Parameters
    ----------
    joints : sequence of PlacedJoint
        Joints.
    preference : callable, optional
        Which joints are taken first: those of the least value; among equals those whose outer body turns with the fewest
        joints, then those near the ground. Without it, joints are taken in their order.
    """
    at: dict[int, list[int]] = {}
    for index, joint in enumerate(joints):
        for body in (joint.parent, joint.child):
            at.setdefault(body, []).append(index)
    turns, depth, edges, waiting = {GROUND: 0}, {GROUND: 0}, [], []

    def look_out(body: int):
        for index in at.get(body, ()):
            joint = joints[index]
            rank = (0,) if preference is None else (preference(joint), turns[body] + joint.pair.turns, depth[body])
            heappush(waiting, (rank, index, body))

    look_out(GROUND)
    while waiting:
        _, index, inner = heappop(waiting)
        joint = joints[index]
        outer = joint.child if joint.parent == inner else joint.parent
        if outer not in depth:
            turns[outer], depth[outer] = turns[inner] + joint.pair.turns, depth[inner] + 1
            edges.append(Edge(index, outer, inner))
            look_out(outer)
    return tuple(edges)
