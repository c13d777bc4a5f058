"""Plane mechanisms: hinges with parallel axes, and sliders across them.

Nothing leaves the plane, so three of six rows of every joint are 0 = 0, and two of three moments of inertia and the heights
of the joints above the plane have no influence. Here the mechanism is laid into the plane exactly: its normal is the
z-axis of every body. Terms without influence are then exact zeros, for which no operation is emitted.

Of a loop in a plane in a mechanism that is none, the links stay in one plane of each other whatever carries it: of the five
rows of a hinge that closes it, two rotations and the distance along the axis are 0 = 0. Four-bars in the legs of a walking
robot are the usual case.
"""

from dataclasses import replace

import numpy as np

from gauss import rotations
from gauss.system.passes.propagation import propagated
from gauss.system.passes.rigid import loop_of
from gauss.system.placed_elements import PlacedFrame, PlacedJoint
from gauss.system.subsystem import GROUND, Subsystem

NORMAL = np.array([0.0, 0.0, 1.0])
PARALLEL_NORMALS = 1e-12  # sine of the angle between axes that are meant as parallel
TRIVIAL_ROWS = {"revolute": (0, 1, 5), "planar": (0, 1, 5), "prismatic": (0, 2, 4)}  # rows 0 = 0, in the axes of this pass


def plane(subsystem: Subsystem) -> tuple[list[Subsystem], list[str]]:
    """Lay a plane mechanism into its plane; leave any other as it is."""
    normals = _normals(subsystem)
    if normals is None:
        return [subsystem], []
    turns = {body: rotations.along(normal) for body, normal in normals.items() if body != GROUND}
    Phi = subsystem.Phi.reshape(-1, 6).copy()
    for body, normal in normals.items():
        if body != GROUND:
            Phi[body, :3] = 0.0, 0.0, normal @ (subsystem.Phi[6 * body : 6 * body + 3] * normal)
    carried = {
        body: frame if frame.body == GROUND else PlacedFrame(frame.body, *_turned(turns[frame.body], frame.R, frame.p))
        for body, frame in subsystem.carried.items()
    }
    flat = replace(
        subsystem,
        Phi=Phi.ravel(),
        joints=tuple(_laid(joint, normals, turns) for joint in subsystem.joints),
        carried=carried,
        redundant=subsystem.redundant
        | {(i, axis) for i, joint in enumerate(subsystem.joints) for axis in TRIVIAL_ROWS[joint.pair.kind]},
    )
    axis = " ".join(f"{entry:.3g}" for entry in normals[GROUND] + 0.0)
    return [flat], [f"all hinges have the direction ({axis}), all sliders lie across it"]


def _normals(subsystem: Subsystem) -> dict[int, np.ndarray] | None:
    """Normal of the plane in the central axes of every body and in world; None if there is no such plane."""
    seed = next((joint for joint in subsystem.joints if joint.pair.kind in ("revolute", "planar")), None)
    if seed is None or any(joint.pair.kind not in TRIVIAL_ROWS for joint in subsystem.joints):
        return None
    return propagated(subsystem.joints, (seed.parent, seed.R_parent[:, 2]), normal_beyond, PARALLEL_NORMALS)


def normal_beyond(joint: PlacedJoint, body: int, normal: np.ndarray) -> np.ndarray | None:
    """Normal in the other body of a joint; None if the joint moves out of the plane."""
    here, there = (joint.R_parent, joint.R_child) if body == joint.parent else (joint.R_child, joint.R_parent)
    across = _across(joint.pair.kind, here.T @ normal)
    return None if across is None else there @ across


def _across(kind: str, normal: np.ndarray) -> np.ndarray | None:
    """Normal in the joint frame, made exact; None if the joint moves out of the plane."""
    if kind == "prismatic":
        inside = normal * [1.0, 1.0, 0.0]
        return inside / np.linalg.norm(inside) if abs(normal[2]) <= PARALLEL_NORMALS else None
    return np.array([0.0, 0.0, np.sign(normal[2])]) if np.hypot(normal[0], normal[1]) <= PARALLEL_NORMALS else None


def _laid(joint: PlacedJoint, normals, turns) -> PlacedJoint:
    sides = {}
    for side, body in (("parent", joint.parent), ("child", joint.child)):
        R, p = getattr(joint, f"R_{side}"), getattr(joint, f"p_{side}")
        if body == GROUND:
            normal = normals[GROUND]
            p = p - normal * (normal @ p)
        else:
            normal = NORMAL
            R, p = _turned(turns[body], R, p)
            R, p = _upright(R), p * [1.0, 1.0, 0.0]
        if joint.pair.kind == "prismatic":  # its frame may turn about the direction of sliding, by as much on both sides
            R = rotations.clean(np.column_stack([rotations.cross(normal, R[:, 2]), normal, R[:, 2]]))
        sides[f"R_{side}"], sides[f"p_{side}"] = R, p
    return replace(joint, **sides)


def _turned(turn: np.ndarray, R, p):
    return rotations.clean(turn.T @ R), turn.T @ p


def _upright(R: np.ndarray) -> np.ndarray:
    """Rotation whose third axis is exactly up, down, or in the plane."""
    z = R[:, 2] * [1.0, 1.0, 0.0] if abs(R[2, 2]) < 0.5 else np.round(R[:, 2])
    x = R[:, 0] * [1.0, 1.0, 0.0] if z[2] else NORMAL
    z, x = z / np.linalg.norm(z), x / np.linalg.norm(x)
    return np.column_stack([x, rotations.cross(z, x), z])


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
