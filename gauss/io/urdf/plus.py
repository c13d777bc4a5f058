"""URDF+: loops and couplings in the file itself (IEEE document 10769903).

``<loop>`` closes a joint between a frame on a predecessor and a frame on a successor link, ``<coupling>`` ties the rates of
two links by a ratio. ``independent`` of a joint names the coordinates that others follow: it has no influence on the motion.
"""

from pathlib import Path
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from gauss.errors import FileError, did_you_mean
from gauss.io.guard import Source
from gauss.io.mjcf.tree import joint_frame
from gauss.io.urdf.closures import FrameOnLink, LoopClosure, add_coupling, chain_to_root, pose_of
from gauss.io.urdf.guard import placed
from gauss.io.urdf.numbers import roll_pitch_yaw, text_of, value, values
from gauss.scene import GROUND, Joint, LinearCoupling, Scene
from gauss.scene.relation import Relation

LOOP_KINDS = {  # type of a loop: kind of joint
    "revolute": "revolute",
    "continuous": "revolute",
    "prismatic": "prismatic",
    "planar": "planar",
    "spherical": "ball",
    "fixed": "fixed",
}
WITHOUT_AXIS = ("spherical", "fixed")
COUPLING_TYPES = ("rolling",)
TRUTH = ("true", "false", "1", "0")
PARTS_OF = {"loop": ("predecessor", "successor", "axis"), "coupling": ("predecessor", "successor", "ratio")}
ORIGIN = (0.0, 0.0, 0.0)
TYPES = {kind: name for name, kind in LOOP_KINDS.items() if name != "continuous"}
Z_AXIS = (0.0, 0.0, 1.0)


def add_loops_and_couplings(scene: Scene, source: Source):
    """Add the loops and couplings of a URDF+ file to the scene of its tree.

    FileError if one is incomplete, of an unknown type, or names a link that does not exist; the message says where.
    """
    for joint in source.root.findall("joint"):
        independent = joint.get("independent")
        if independent is not None and independent.strip().lower() not in TRUTH:
            raise FileError(f"{source.place(joint)}: <joint> independent: expected true or false, got {independent!r}.")
    for element in source.root.findall("loop"):
        with placed(source, element):
            _loop(source, element).add_to(scene)
    for number, element in enumerate(source.root.findall("coupling"), start=1):
        with placed(source, element):
            name = element.get("name") or f"coupling {number}"
            one, other = (_link(source, element, side).get("link", "") for side in ("predecessor", "successor"))
            kind = element.get("type", COUPLING_TYPES[0])
            _require_known(source, element, kind, COUPLING_TYPES)
            ratio = value(source, _part(source, element, "ratio"), "value")
            add_coupling(scene, source, name, one, other, ratio)


def _loop(source: Source, element: Element) -> LoopClosure:
    kind = element.get("type", "")
    _require_known(source, element, kind, LOOP_KINDS)
    if not element.get("name"):
        raise FileError(f"{source.place(element)}: <loop> has no name.")
    one, other = (_frame(source, element, side) for side in ("predecessor", "successor"))
    axis = element.find("axis")
    along = (1.0, 0.0, 0.0) if axis is None else values(source, axis, "xyz")
    return LoopClosure(element.get("name", ""), LOOP_KINDS[kind], one, other, None if kind in WITHOUT_AXIS else along)


def _frame(source: Source, element: Element, side: str) -> FrameOnLink:
    end = _link(source, element, side)
    origin = end.find("origin")
    if origin is None:
        return FrameOnLink(end.get("link", ""))
    return FrameOnLink(end.get("link", ""), pose_of(*(values(source, origin, key, ORIGIN) for key in ("xyz", "rpy"))))


def _link(source: Source, element: Element, side: str) -> Element:
    end = _part(source, element, side)
    if not end.get("link"):
        raise FileError(f"{source.place(end)}: <{side}> of <{element.tag}> names no link.")
    return end


def _part(source: Source, element: Element, tag: str) -> Element:
    found = element.find(tag)
    if found is None:
        raise FileError(f"{source.place(element)}: <{element.tag}> has no <{tag}>.")
    return found


def _require_known(source: Source, element: Element, kind: str, known):
    """Refuse an unknown type, unknown children, and children that stand twice."""
    if kind not in known:
        raise FileError(f"{source.place(element)}: <{element.tag}> of type {kind!r}: {did_you_mean(kind, known)}")
    parts = PARTS_OF[element.tag]
    for child in element:
        if child.tag not in parts:
            raise FileError(f"{source.place(child)}: <{element.tag}> has no <{child.tag}>. {did_you_mean(child.tag, parts)}")
        if child is not element.find(child.tag):
            raise FileError(f"{source.place(child)}: <{child.tag}> stands twice in one <{element.tag}>; keep one.")
        strange = [part.tag for part in child if part.tag != "origin"]
        if strange or len(child.findall("origin")) > 1:
            raise FileError(f"{source.place(child)}: <{child.tag}> may hold one <origin> and nothing else.")


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
