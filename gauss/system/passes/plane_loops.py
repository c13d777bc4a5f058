"""Loops in a plane, in a mechanism that is none: hinges with parallel axes, and sliders across them.

Whatever carries such a loop, its links stay in one plane of each other: of the five rows of a hinge that closes it, two
rotations and the distance along the axis are 0 = 0. Four-bars in the legs of a walking robot are the usual case.
"""

from dataclasses import replace

from gauss.system.passes.plane import PARALLEL_NORMALS, TRIVIAL_ROWS, normal_beyond
from gauss.system.passes.propagation import propagated
from gauss.system.passes.rigid import loop_of
from gauss.system.subsystem import Subsystem


def plane_loops(subsystem: Subsystem) -> tuple[list[Subsystem], list[str]]:
    """Mark the rows 0 = 0 of the hinges that close loops in a plane as redundant."""
    rows, reasons = set(), []
    for index in subsystem.loop_joints:
        if subsystem.joints[index].pair.kind != "revolute" or not _is_plane(subsystem, index):
            continue
        found = {(index, axis) for axis in TRIVIAL_ROWS["revolute"]} - subsystem.redundant
        rows |= found
        if found:
            reasons.append(f"the loop that {subsystem.joints[index].name!r} closes stays in a plane")
    return [replace(subsystem, redundant=subsystem.redundant | rows) if rows else subsystem], reasons


def _is_plane(subsystem: Subsystem, index: int) -> bool:
    """Whether all hinges of the loop that a hinge closes have one direction, and all sliders lie across it."""
    joints = [subsystem.joints[k] for k in loop_of(subsystem, index)]
    if any(joint.pair.kind not in TRIVIAL_ROWS for joint in joints):
        return False
    closing = subsystem.joints[index]
    return propagated(joints, (closing.parent, closing.R_parent[:, 2]), normal_beyond, PARALLEL_NORMALS) is not None
