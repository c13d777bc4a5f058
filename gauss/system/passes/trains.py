"""Ideal gear and belt trains: joints of one carrier with one coordinate become one reduced inertia.

The coordinates q_i = r_i x + o_i of bodies that hang on the same inner body have the inertia Σ r_i² Sᵢᵀ Î_i Sᵢ and the
force Σ r_i P_i. This is built into the recursion, and the rows of the couplings are not needed. A coupling between joints on
different carriers stays a row.
"""

from dataclasses import replace
from typing import NamedTuple

from gauss.system.subsystem import Subsystem, Train


class Line(NamedTuple):
    """Coordinate of a joint over that of the first joint of its train: q = ratio · q_first + offset."""

    first: str  # name of the first joint
    ratio: float = 1.0
    offset: float = 0.0  # [rad, m]


def trains(subsystem: Subsystem) -> tuple[list[Subsystem], list[str]]:
    """Collapse couplings between joints of the tree that start from the same inner body."""
    inner = {subsystem.joints[edge.constraint].name: edge.inner for edge in subsystem.tree}
    lines: dict[str, Line] = {}
    kept, collapsed = [], []
    for coupling in subsystem.couplings:
        driver, driven = coupling.driver, coupling.driven
        on_one = driver in inner and driven in inner and inner[driver] == inner[driven]
        first, ratio, offset = lines.get(driver, Line(driver))
        line = Line(first, ratio * coupling.ratio, offset * coupling.ratio + coupling.offset)
        if not on_one or not coupling.ratio or not _join(lines, driven, line):
            kept.append(coupling)
            continue
        lines.setdefault(first, Line(first))
        collapsed.append(coupling)
    reasons = [f"{c.driven!r} moves {c.ratio:.6g} times as fast as {c.driver!r}" for c in collapsed]
    return [replace(subsystem, couplings=tuple(kept), trains=_grouped(subsystem, inner, lines))], reasons


def _grouped(subsystem: Subsystem, joints, lines: dict[str, Line]) -> tuple[Train, ...]:
    """Trains of the joints with a line, in the order of the joints."""
    groups: dict[str, list[str]] = {}
    for joint in joints:
        if joint in lines:
            groups.setdefault(lines[joint].first, []).append(joint)
    found = []
    for group in groups.values():
        _, base, shift = lines[group[0]]
        ratios = tuple(lines[joint].ratio / base for joint in group)
        offsets = tuple(lines[joint].offset - ratio * shift for joint, ratio in zip(group, ratios, strict=True))
        found.append(Train(tuple(subsystem.index(joint) for joint in group), ratios, offsets))
    return tuple(found)


def _join(lines: dict[str, Line], joint: str, line: Line) -> bool:
    """Let a joint follow the first of a train; its own train comes with it. False if it follows that train already."""
    old = lines.get(joint, Line(joint))
    if old.first == line.first:
        return False
    for name, own in list(lines.items()):
        if own.first == old.first:
            offset = own.offset + own.ratio * (line.offset - old.offset) / old.ratio
            lines[name] = Line(line.first, own.ratio * line.ratio / old.ratio, offset)
    lines[joint] = line
    return True
