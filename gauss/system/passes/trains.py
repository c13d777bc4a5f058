"""Ideal gear and belt trains: joints of one carrier with one coordinate become one reduced inertia.

The coordinates q_i = r_i x + const of bodies that hang on the same inner body have the inertia Σ r_i² Sᵢᵀ Î_i Sᵢ and the
force Σ r_i P_i. This is built into the recursion, and the rows of the couplings are not needed. A coupling between joints on
different carriers stays a row.
"""

from dataclasses import replace

from gauss.system.subsystem import Subsystem, Train


def trains(subsystem: Subsystem) -> tuple[list[Subsystem], list[str]]:
    """Collapse couplings between joints of the tree that start from the same inner body."""
    inner = {subsystem.joints[edge.constraint].name: edge.inner for edge in subsystem.tree}
    ratios: dict[str, tuple[str, float]] = {}  # joint → (first joint of its train, ratio of its rate to that of the first)
    kept, collapsed = [], []
    for coupling in subsystem.couplings:
        driver, driven = coupling.driver, coupling.driven
        on_one = driver in inner and driven in inner and inner[driver] == inner[driven]
        first, ratio = ratios.get(driver, (driver, 1.0))
        if not on_one or not coupling.ratio or not _join(ratios, driven, first, ratio * coupling.ratio):
            kept.append(coupling)
            continue
        ratios.setdefault(first, (first, 1.0))
        collapsed.append(coupling)
    reasons = [f"{c.driven!r} moves {c.ratio:.6g} times as fast as {c.driver!r}" for c in collapsed]
    return [replace(subsystem, couplings=tuple(kept), trains=_grouped(subsystem, inner, ratios))], reasons


def _grouped(subsystem: Subsystem, joints, ratios: dict[str, tuple[str, float]]) -> tuple[Train, ...]:
    """Trains of the joints with a ratio, in the order of the joints."""
    groups: dict[str, list[str]] = {}
    for joint in joints:
        if joint in ratios:
            groups.setdefault(ratios[joint][0], []).append(joint)
    return tuple(
        Train(tuple(subsystem.index(j) for j in group), tuple(ratios[j][1] / ratios[group[0]][1] for j in group))
        for group in groups.values()
    )


def _join(ratios: dict, joint: str, first: str, ratio: float) -> bool:
    """Let a joint follow the first of a train; its own train comes with it. False if it follows that train already."""
    old, old_ratio = ratios.get(joint, (joint, 1.0))
    if old == first:
        return False
    for name, (leader, own) in list(ratios.items()):
        if leader == old:
            ratios[name] = first, own * ratio / old_ratio
    ratios[joint] = first, ratio
    return True
