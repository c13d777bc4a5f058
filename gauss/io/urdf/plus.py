"""URDF+: loops and couplings in the file itself (IEEE document 10769903).

``<loop>`` closes a joint between a frame on a predecessor and a frame on a successor link, ``<coupling>`` ties the rates of
two links by a ratio. ``independent`` of a joint names the coordinates that others follow: it has no influence on the motion.
"""

from xml.etree.ElementTree import Element

from gauss.errors import FileError, did_you_mean
from gauss.io.guard import Source
from gauss.io.urdf.closures import FrameOnLink, LoopClosure, add_coupling, pose_of
from gauss.io.urdf.guard import placed
from gauss.io.urdf.numbers import value, values
from gauss.scene import Scene

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
