"""Loops and couplings of a scene as elements of URDF+; see :mod:`gauss.io.urdf.plus` for their meaning."""

from pathlib import Path
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from gauss.io.guard import Source
from gauss.io.mjcf.tree import joint_frame
from gauss.io.urdf.closures import chain_to_root
from gauss.io.urdf.numbers import roll_pitch_yaw, text_of
from gauss.io.urdf.plus import LOOP_KINDS
from gauss.scene import GROUND, Joint, LinearCoupling
from gauss.scene.relation import Relation

TYPES = {kind: name for name, kind in LOOP_KINDS.items() if name != "continuous"}
Z_AXIS = (0.0, 0.0, 1.0)


def write_loop(document, joint: Joint, ground: str) -> bool:
    """Write a joint that is cut as a loop; False where URDF+ has none like it, or no place for its limits."""
    if joint.kind not in TYPES or joint.limits is not None or joint.second_axis is not None:
        return False
    loop = SubElement(document.root, "loop", name=joint.name, type=TYPES[joint.kind])
    for side, body, frame in (("predecessor", joint.parent, joint.frame), ("successor", joint.child, joint.child_frame)):
        if joint.child_frame is None:
            frame, (R, p) = body, joint_frame(document.system, joint, body)
        else:  # the axis is given apart
            R, p = (np.eye(3) if joint.kind not in ("ball", "fixed") else joint.axes()), np.array(joint.at)
        p = p - document.shifts.get(frame, np.zeros(3))
        end = SubElement(loop, side, link=ground if frame == GROUND else str(frame))
        if p.any() or not np.array_equal(R, np.eye(3)):
            SubElement(end, "origin", xyz=text_of(p), rpy=text_of(roll_pitch_yaw(R)))
    if joint.kind not in ("ball", "fixed"):
        SubElement(loop, "axis", xyz=text_of(Z_AXIS if joint.child_frame is None else joint.axis))
    return True


def write_coupling(document, relation: Relation) -> bool:
    """Write a linear coupling of two chains; False where it is none."""
    if not isinstance(relation, LinearCoupling) or relation.constant:
        return False
    groups: dict[float, set[str]] = {}
    for joint, coefficient in zip(relation.coupled, relation.coefficients, strict=True):
        groups.setdefault(coefficient, set()).add(joint)
    if len(groups) != 2:
        return False
    source = Source(Path("-"), document.root, {})
    (one, predecessors), (other, successors) = groups.items()
    ends = [_end(document.root, source, joints) for joints in (predecessors, successors)]
    chains = [_moving(document.root, source, end) for end in ends if end is not None]
    if len(chains) != 2 or chains[0] - chains[1] != predecessors or chains[1] - chains[0] != successors:
        return False
    coupling = SubElement(document.root, "coupling", name=relation.name, type="rolling")
    for side, end in zip(("predecessor", "successor"), ends, strict=True):
        SubElement(coupling, side, link=str(end))
    SubElement(coupling, "ratio", value=text_of(-one / other))
    return True


def _end(root: Element, source: Source, joints: set[str]) -> str | None:
    """Link of some joints that is farthest from the root; None if there is none."""
    moved = {joint.get("name"): joint.find("child") for joint in root.findall("joint")}
    links = [child.get("link", "") for name in joints if (child := moved.get(name)) is not None]
    return max(links, key=lambda link: (len(chain_to_root(source, link)), link), default=None)


def _moving(root: Element, source: Source, link: str) -> set[str]:
    """Moving joints from the root to a link."""
    kinds = {joint.get("name", ""): joint.get("type") for joint in root.findall("joint")}
    return {joint for joint, _ in chain_to_root(source, link) if kinds[joint] != "fixed"}
