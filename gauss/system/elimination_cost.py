"""Estimate of the operations that eliminating the loop constraints of a subsystem takes, before any is traced."""

from collections import Counter
from collections.abc import Mapping

import numpy as np

from gauss.backends.structure import GROUND

MOST_ROWS = 6  # of a block of couplings, as of a loop joint
MOST_WORK = 250_000  # operations: traced in a few seconds
MOST_SHARED_JOINTS = 100  # pairs of loops that share a joint of the tree, per body, up to which K M⁻¹ Kᵀ is sparse
OPERATIONS_PER_LINK = 30  # for the response of one link to one loop constraint


def loop_elimination_work(subsystem) -> int:
    """Operations that eliminating the loop constraints takes, roughly.

    A row acts on whole branches, from the ground on, and is coupled with all other rows on these branches; the matrix K
    M⁻¹ Kᵀ is factored by least degree. With short branches, as of a ladder, the work grows with the number of rows; with all
    loops on one long branch, with its cube.
    """
    groups = _closing_groups(subsystem)
    sizes = Counter(_branches(subsystem).values())
    work = sum(rows * OPERATIONS_PER_LINK * sum(sizes[branch] for branch in branches) for rows, branches in groups)
    on: dict[int, set[int]] = {}
    for k, (_, branches) in enumerate(groups):
        for branch in branches:
            on.setdefault(branch, set()).add(k)
    coupled = {k: set().union(*(on[branch] for branch in branches)) - {k} for k, (_, branches) in enumerate(groups)}
    while coupled and work <= MOST_WORK:
        k = min(coupled, key=lambda k: len(coupled[k]))
        others = coupled.pop(k)
        work += groups[k][0] * sum(groups[other][0] for other in others) ** 2
        for other in others:
            coupled[other] |= others
            coupled[other] -= {k, other}
    return work


def _branches(subsystem) -> dict[int, int]:
    """First body from the ground of the branch of each body."""
    branch: dict[int, int] = {}
    for edge in subsystem.tree:
        branch[edge.outer] = branch.get(edge.inner, edge.outer)
    return branch


def _closing_groups(subsystem) -> list[tuple[int, set[int]]]:
    """Number of rows, and branches, of each loop joint, coupling and relation."""
    branch, redundant = _branches(subsystem), Counter(joint for joint, _ in subsystem.redundant)
    at = {joint.name: {joint.parent, joint.child} for joint in subsystem.joints}
    groups = [(6 - subsystem.joints[k].pair.n_v - redundant[k], at[subsystem.joints[k].name]) for k in subsystem.loop_joints]
    groups += [(1, at[coupling.driven] | at[coupling.driver]) for coupling in subsystem.couplings]
    for relation in subsystem.relations:
        bodies = {subsystem.carried[body].body for body in relation.bodies}
        groups.append((relation.size, bodies.union(*(at.get(name, set()) for name in relation.joints))))
    return [(rows, {branch[body] for body in bodies if body != GROUND}) for rows, bodies in groups]


def shared_joints(subsystem) -> int:
    """Number of pairs of loops that share a joint of the tree, summed over the joints: blocks of the sum K M⁻¹ Kᵀ."""
    loops = _loop_paths(subsystem)
    return _shared_joints(loops, [GROUND for _ in loops])


def joints_shared_in_kernels(subsystem) -> int:
    """The same where each loop is eliminated at its link of :func:`elimination_roots`."""
    return _shared_joints(_loop_paths(subsystem), elimination_roots(subsystem))


def elimination_roots(subsystem) -> list[int]:
    """Link at which kernels eliminate each loop joint and block of couplings: the ground, or the innermost of its loop.

    Where few loops share a joint all are eliminated together, K M⁻¹ Kᵀ being sparse. Loops that stand on each other, as
    stacked platforms, are all coupled there, and are eliminated one after the other.
    """
    if subsystem.shared_joints > MOST_SHARED_JOINTS * subsystem.n_bodies:
        return innermost_links(subsystem)
    return [GROUND for _ in _loop_paths(subsystem)]


def innermost_links(subsystem) -> list[int]:
    """Link of each loop, by loop joint and block of couplings, that is nearest to the ground; the ground itself is one."""
    return list(map(innermost, _loop_paths(subsystem)))


def _shared_joints(loops, roots) -> int:
    crossed: Counter = Counter()
    for paths, root in zip(loops, roots, strict=True):
        crossed.update({body for path in paths for body in path[: path.index(root)]})
    return sum(count**2 for count in crossed.values())


def _loop_paths(subsystem) -> list[list[list[int]]]:
    """Links from each body on the joints of each loop joint and block of couplings to the ground."""
    inner = {edge.outer: edge.inner for edge in subsystem.tree}
    loops = [{subsystem.joints[index].parent, subsystem.joints[index].child} for index in subsystem.loop_joints]
    loops += [set().union(*(_coupled_bodies(subsystem, int(k)) for k in block)) for block in coupling_blocks(subsystem)]
    return [[path_to_ground(body, inner) for body in ends] for ends in loops]


def path_to_ground(body: int, inner: Mapping[int, int]) -> list[int]:
    """Links from one to the ground, by the inner neighbour of each."""
    found = [body]
    while found[-1] != GROUND:
        found.append(inner[found[-1]])
    return found


def innermost(paths: list[list[int]]) -> int:
    """First link that some paths to the ground have in common."""
    return next(body for body in paths[0] if all(body in path for path in paths))


def coupling_blocks(subsystem) -> list[np.ndarray]:
    """Indices of couplings, in blocks that share branches: their rows are carried inward, and factored, together."""
    branch, order = _branches(subsystem), {edge.outer: place for place, edge in enumerate(subsystem.tree)}
    alike: dict[frozenset, list[int]] = {}
    for k in range(len(subsystem.couplings)):
        bodies = _coupled_bodies(subsystem, k) - {GROUND}
        alike.setdefault(frozenset(branch[body] for body in bodies), []).append(k)
    outermost = lambda k: max(order[body] for body in _coupled_bodies(subsystem, k) - {GROUND})  # noqa: E731
    return [
        np.array(block)
        for some in alike.values()
        for block in np.array_split(sorted(some, key=outermost), -(-len(some) // MOST_ROWS))
    ]


def _coupled_bodies(subsystem, k: int) -> set[int]:
    """Bodies on the joints of a coupling."""
    coupling = subsystem.couplings[k]
    joints = subsystem.joint(coupling.driven), subsystem.joint(coupling.driver)
    return {body for joint in joints for body in (joint.parent, joint.child)}
