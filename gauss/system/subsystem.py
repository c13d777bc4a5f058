"""Reduced subsystems: independent mechanisms in joint coordinates, without what does not influence their motion.

A :class:`System` is complete, in maximal coordinates: it is assembled, certified and analysed. Forward dynamics in joint
coordinates works on its subsystems. Each pass of ``gauss.system.passes`` turns a subsystem into smaller ones; all of them
keep the names of joints, by which coordinates and forces are mapped.
"""

from dataclasses import dataclass, field, replace
from functools import cached_property
from heapq import heappop, heappush
from typing import NamedTuple

import numpy as np

from gauss.backends.structure import GROUND, Edge
from gauss.errors import StateError
from gauss.scene import Coupling
from gauss.system import elimination_cost
from gauss.system.placed_elements import PlacedFrame, PlacedJoint
from gauss.versions import FormerAttribute


class Train(NamedTuple):
    """Gear train: joints with one coordinate."""

    joints: tuple[int, ...]  # indices of the joints, the first one leading
    ratios: tuple[float, ...]  # q of each is its ratio times that of the first,
    offsets: tuple[float, ...]  # plus its offset


@dataclass(frozen=True)
class BoundRelation:
    """A relation in a subsystem."""

    index: int  # its index in the system
    bodies: tuple[int, ...]  # its bodies there
    joints: tuple[str, ...]  # names of its joints
    size: int  # number of rows


@dataclass(frozen=True)
class Subsystem:
    """Mechanism in joint coordinates.

    Parameters
    ----------
    names : tuple of str
        Names of its n bodies; welded bodies have the name of one of them.
    Phi : ndarray, shape (6n,)
        Inertias J1, J2, J3 [kg m²] and masses m, m, m [kg] of its bodies.
    gravity : ndarray, shape (3,)
        Acceleration of gravity in world axes [m/s²].
    joints : tuple of PlacedJoint
        Its joints; bodies, coordinates and rates are numbered within the subsystem.
    couplings : tuple of Coupling
        Couplings with rows.
    tree : tuple of Edge
        Spanning tree, inner bodies first; an edge names the index of its joint.
    carried : dict
        Principal central frame of each body of the system that it carries, by the index of that body, on its own bodies.
    q, v : ndarray of int
        Indices of its coordinates and rates in the system.
    relations : tuple of BoundRelation
        Its relations.
    redundant : frozenset of (int, int)
        Redundant rows (joint, axis); axes of the joint frame, rotation 0 to 2, translation 3 to 5.
    trains : tuple of Train
        Couplings that the recursion eliminates.
    held : dict
        Coordinates of joints that cannot move and were removed, by name.
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
    relations: tuple[BoundRelation, ...] = ()
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
        """Largest component of the positions of its joints on their bodies [m]."""
        return max((float(np.abs(p).max()) for joint in self.joints for p in (joint.p_parent, joint.p_child)), default=0.0)

    @cached_property
    def loop_joints(self) -> tuple[int, ...]:
        """Joints outside the tree: they close loops."""
        in_tree = {edge.constraint for edge in self.tree}
        return tuple(i for i in range(len(self.joints)) if i not in in_tree)

    closing = FormerAttribute("loop_joints")

    @property
    def n_coordinates(self) -> int:
        """Number of independent coordinates."""
        return self.n_v - sum(len(train.joints) - 1 for train in self.trains)

    @property
    def n_rows(self) -> int:
        """Number of constraint rows, joints of the tree included."""
        return 6 * len(self.joints) + len(self.couplings) - len(self.redundant) + sum(r.size for r in self.relations)

    @property
    def n_loop_constraints(self) -> int:
        """Number of rows of loop joints, couplings and relations."""
        loops = sum(6 - self.joints[i].pair.n_v for i in self.loop_joints)
        others = len(self.couplings) + sum(relation.size for relation in self.relations)
        return loops + others - sum(i in self.loop_joints for i, _ in self.redundant)

    loop_elimination_work = cached_property(elimination_cost.loop_elimination_work)
    shared_joints = cached_property(elimination_cost.shared_joints)
    joints_shared_in_kernels = cached_property(elimination_cost.joints_shared_in_kernels)

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
            raise StateError(f"joint {name!r} is in no reduced subsystem.")
        return found


def whole(system) -> Subsystem:
    """The whole system as one subsystem, nothing reduced."""
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
            BoundRelation(index, placed.bodies, tuple(system.joints[j].name for j in placed.joints), placed.size)
            for index, placed in enumerate(system.relations.placed)
        ),
    )


def kept_joints(subsystem: Subsystem, joints) -> Subsystem:
    """Subsystem with some of its joints, perhaps with other frames; its tree is left empty."""
    kept, q, v, q_places, v_places = [], 0, 0, [], []
    for joint in joints:
        q_places.append(subsystem.q[joint.q])
        v_places.append(subsystem.v[joint.v])
        kept.append(replace(joint, q=slice(q, q + joint.pair.n_q), v=slice(v, v + joint.pair.n_v)))
        q, v = q + joint.pair.n_q, v + joint.pair.n_v
    names = {joint.name for joint in kept}
    nothing = np.zeros(0, dtype=int)
    return replace(
        subsystem,
        joints=tuple(kept),
        couplings=tuple(c for c in subsystem.couplings if {c.driver, c.driven} <= names),
        q=np.concatenate([nothing, *q_places]),
        v=np.concatenate([nothing, *v_places]),
        tree=(),
    )


def spanning_tree(joints, preference=None) -> tuple[Edge, ...]:
    """Edges from the ground to every body, inner bodies first.

    ``preference``: joints of the least value are taken first; among equals those whose outer body turns with the fewest
    joints, then those near the ground. Without it, joints are taken in their order.
    """
    at: dict[int, list[int]] = {}
    for index, joint in enumerate(joints):
        for body in (joint.parent, joint.child):
            at.setdefault(body, []).append(index)
    turns, depth, edges = {GROUND: 0}, {GROUND: 0}, list[Edge]()
    waiting: list[tuple[tuple, int, int]] = []

    def push_joints(body: int):
        for index in at.get(body, ()):
            joint = joints[index]
            rank: tuple = (0,) if preference is None else (preference(joint), turns[body] + joint.pair.turns, depth[body])
            heappush(waiting, (rank, index, body))

    push_joints(GROUND)
    while waiting:
        _, index, inner = heappop(waiting)
        joint = joints[index]
        outer = joint.child if joint.parent == inner else joint.parent
        if outer not in depth:
            turns[outer], depth[outer] = turns[inner] + joint.pair.turns, depth[inner] + 1
            edges.append(Edge(index, outer, inner))
            push_joints(outer)
    return tuple(edges)
