"""What it takes to meet the rows that close a part, estimated before they are written down."""

from collections import Counter

GROUND = -1
MOST_WORK = 250_000  # operations: written down in a few seconds
PER_LINK = 30  # operations for the answer of one link to a closing row


def loop_elimination_work(part) -> int:
    """Operations that meeting the closing rows takes, roughly.

    A row moves the whole branches, from the ground on, that it acts on, and is felt by all other rows on these branches;
    the matrix of the rows is factored by least degree. Where branches are short, a ladder for instance, the work grows with
    the number of rows; where all loops are on one long branch, with its cube.
    """
    groups = _closing_groups(part)
    sizes = Counter(_branches(part).values())
    work = sum(rows * PER_LINK * sum(sizes[branch] for branch in branches) for rows, branches in groups)
    on: dict[int, set[int]] = {}
    for k, (_, branches) in enumerate(groups):
        for branch in branches:
            on.setdefault(branch, set()).add(k)
    tied = {k: set().union(*(on[branch] for branch in branches)) - {k} for k, (_, branches) in enumerate(groups)}
    while tied and work <= MOST_WORK:
        k = min(tied, key=lambda k: len(tied[k]))
        others = tied.pop(k)
        work += groups[k][0] * sum(groups[other][0] for other in others) ** 2
        for other in others:
            tied[other] |= others
            tied[other] -= {k, other}
    return work


def _branches(part) -> dict[int, int]:
    """Body of each branch that is next to the ground, by the bodies of the branch."""
    branch: dict[int, int] = {}
    for edge in part.tree:
        branch[edge.outer] = branch.get(edge.inner, edge.outer)
    return branch


def _closing_groups(part) -> list[tuple[int, set[int]]]:
    """Rows and branches of each closing joint, coupling and relation."""
    branch, redundant = _branches(part), Counter(joint for joint, _ in part.redundant)
    at = {joint.name: {joint.parent, joint.child} for joint in part.joints}
    groups = [(6 - part.joints[k].pair.n_v - redundant[k], at[part.joints[k].name]) for k in part.closing]
    groups += [(1, at[tie.driven] | at[tie.driver]) for tie in part.couplings]
    for relation in part.relations:
        bodies = {part.carried[body].body for body in relation.bodies}
        groups.append((relation.size, bodies.union(*(at.get(name, set()) for name in relation.joints))))
    return [(rows, {branch[body] for body in bodies if body != GROUND}) for rows, bodies in groups]


def meetings(part) -> int:
    """Number of pairs of loops that meet at a joint of the tree, summed over the joints.

    So many blocks the matrix of all closing rows is put together from.
    """
    inner = {edge.outer: edge.inner for edge in part.tree}
    crossed: Counter = Counter()
    for index in part.closing:
        bodies = set()
        for body in (part.joints[index].parent, part.joints[index].child):
            while body != GROUND:
                bodies.add(body)
                body = inner[body]
        crossed.update(bodies)
    return sum(count**2 for count in crossed.values())
