"""Roots of loops, the innermost link of each, and hubs: links where many chains of loops meet."""

from collections import Counter

from gauss.codegen import as_number
from gauss.dynamics.aba import is_zero
from gauss.dynamics.coupling_constraints import RelationRows
from gauss.dynamics.embedded_loops import GROUND, LoopRow
from gauss.dynamics.rnea import KinematicTree
from gauss.system.elimination_cost import innermost, path_to_ground

CUT = frozenset({"revolute", "prismatic", "ball"})  # inner joints of hubs
HUB_CHAINS = 4  # chains that meet at a hub, its own inner joint among them; fewer are eliminated faster without one


class LoopTopology:
    """Chains of the loops of a tree."""

    def __init__(self, tree: KinematicTree):
        self.tree = tree
        self.inner = {edge.outer: edge.inner for edge in tree.edges}
        self.joints = {edge.constraint: edge for edge in tree.edges}

    def path(self, body: int) -> list[int]:
        """Links from one to the ground."""
        return path_to_ground(body, self.inner)

    def root(self, bodies) -> int:
        """Innermost common link of some."""
        return innermost([self.path(body) for body in bodies])

    def ends(self, constraint, wrenches, tau) -> list[int]:
        """Links whose innermost common one is the root of a row."""
        if isinstance(constraint, RelationRows):
            return [GROUND]
        subsystem, found = self.tree.subsystem, [*wrenches]
        if joint := getattr(constraint, "joint", None):
            found += [joint.parent, joint.child]
        for own in subsystem.joints:
            if not is_zero(tau[own.v]):
                found += [own.parent, own.child]
        return found


def loop_rows(tree: KinematicTree, constraints, with_loop_forces) -> list[LoopRow]:
    """Rows of the loop constraints with their roots."""
    topology, found = LoopTopology(tree), []
    for constraint in constraints:
        for wrenches, tau in constraint.unit_forces:
            ends = topology.ends(constraint, wrenches, tau)
            found.append(LoopRow(with_loop_forces(wrenches, tau), tau, topology.root(ends)))
    return found


def hubs(tree: KinematicTree, rows) -> dict[int, int]:
    """Hubs, with the roots of their fronts: of each root the link inside the loops where most chains meet."""
    topology, found = LoopTopology(tree), {}
    trains = {joint for train in tree.subsystem.trains for joint in train.joints}
    for root in dict.fromkeys(row.root for row in rows):
        chains, meeting = _chains(topology, [row for row in rows if row.root == root], root)
        many = [body for body in chains if meeting[body] >= HUB_CHAINS]
        fit = [body for body in many if _is_fit(topology, body, root, trains)]
        if fit:
            found[max(fit, key=lambda body: (meeting[body], -body))] = root  # noqa: B023 (called at once)
    return found


def _chains(topology: LoopTopology, rows, root: int) -> tuple[set[int], Counter]:
    """Links whose inner joints lie in the loops of a root, and how many chains meet at each."""
    links, meeting = set[int](), Counter[int]()
    for row in rows:
        for body in row.wrenches:
            path = topology.path(body)
            links |= set(path[: path.index(root)])
    for body in links:
        meeting.update([body, topology.inner[body]])
    for pair in {frozenset(row.wrenches) for row in rows}:
        meeting.update(pair)
    return links, meeting


def _is_fit(topology: LoopTopology, body: int, root: int, trains) -> bool:
    """Whether a link has mass and inertia, and an inner joint whose rows the chain from the root can meet."""
    subsystem, path = topology.tree.subsystem, topology.path(body)
    joints = [edge.constraint for edge in topology.tree.edges if edge.outer in path[: path.index(root)]]
    own, freedoms = subsystem.joints[joints[-1]], sum(subsystem.joints[joint].pair.n_v for joint in joints)
    heavy = all(as_number(entry) != 0.0 for entry in subsystem.Phi[6 * body : 6 * body + 4])
    return heavy and joints[-1] not in trains and own.pair.kind in CUT and freedoms >= 6
