"""Elements of SDFormat: what is read, what moves nothing, what a warning names, and what is refused; poses and numbers."""

from math import radians
from xml.etree.ElementTree import Element

import numpy as np

from gauss import rotations
from gauss.errors import FileError, did_you_mean
from gauss.io import numbers as decimal
from gauss.io.guard import Source
from gauss.scene.values import rotation_matrix
from gauss.system.frames import IDENTITY, Pose

SEVERAL = ("link", "joint", "frame", "model", "collision")  # what is read and may stand in its parent more than once
READ = {
    "world": {"gravity", "model", "frame", "joint"},
    "model": {"pose", "link", "joint", "frame", "model", "static"},
    "link": {"pose", "inertial", "gravity", "kinematic", "velocity_decay"},
    "inertial": {"pose", "mass", "inertia", "density"},
    "joint": {"pose", "parent", "child", "axis", "axis2", "screw_thread_pitch", "thread_pitch"},
    "axis": {"xyz", "limit", "dynamics", "use_parent_model_frame", "mimic"},
    "limit": {"lower", "upper", "effort", "velocity", "stiffness", "dissipation"},
    "dynamics": {"damping", "friction", "spring_reference", "spring_stiffness"},
    "mimic": {"multiplier", "offset", "reference"},
}
READ["axis2"] = READ["axis"]
IGNORED = {"visual", "sensor", "light", "self_collide", "enable_wind", "must_be_base_link", "allow_auto_disable", "density"}
IGNORED |= {"audio_sink", "audio_source", "projector", "particle_emitter", "material", "gripper", "initial_position"}
IGNORED |= {"scene", "gui", "audio", "atmosphere", "magnetic_field", "spherical_coordinates", "road"}
WARNED = {"collision": "collisions", "plugin": "plugins", "physics": "settings of a solver"}
WARNED |= {"ball": "damping and friction of ball joints, which have no axis", "wind": "wind"}
WARNED |= {"contact": "contact coefficients of links"}  # of pybullet
WARNED |= {"actor": "actors, which move along paths of their own"}
FORMATS = ("euler_rpy", "quat_xyzw")
TRUE = ("true", "1")


def check(source: Source, element: Element, left: set[str]):
    """Refuse children that are neither read nor known not to move anything, and repeated ones.

    Parameters
    ----------
    source : Source
        The file.
    element : Element
        A world, a model, or a part of one.
    left : set of str
        Gets the tags of what a warning is to name.

    Raises
    ------
    FileError
        Naming the first such child, with file and line.
    """
    for child in element:
        if child.tag in READ[element.tag] and child.tag not in SEVERAL and child is not element.find(child.tag):
            named = f"{element.tag} {element.get('name', '')!r}"
            raise FileError(f"{source.place(child)}: <{child.tag}> stands twice in {named}; keep one.")
        if child.tag in WARNED:
            left.add(child.tag)
        elif child.tag not in READ[element.tag] | IGNORED and ":" not in child.tag:
            what = f"<{child.tag}> of {element.tag} {element.get('name', '')!r}"
            raise FileError(f"{source.place(child)}: {what} is not modelled; remove it.")
        elif child.tag in READ:
            check(source, child, left)


def check_link(source: Source, element: Element):
    """Refuse what moves a link beside its joints and gravity; FileError with file and line."""
    moved = []
    if text(element, "kinematic") not in ("false", "0", ""):
        moved.append(element.find("kinematic"))
    decay = element.find("velocity_decay")
    moved += [one for one in ([] if decay is None else decay) if (one.text or "").strip().strip("0.") != ""]
    for one in moved:
        tag = "" if one is None else one.tag
        raise FileError(f"{source.place(one)}: <{tag}> of link {element.get('name')!r} is not modelled; remove it.")


def pose(source: Source, element: Element | None) -> Pose:
    """Pose (R, p) that a <pose> holds: a point [m], and roll, pitch, yaw about fixed axes [rad], or a quaternion.

    FileError if it does not hold that.
    """
    if element is None or not (element.text or "").strip():
        return IDENTITY
    form = element.get("rotation_format", FORMATS[0])
    if form not in FORMATS:
        raise FileError(f"{source.place(element)}: <pose> rotation_format: {did_you_mean(form, FORMATS)}")
    by_quaternion = form == FORMATS[1]
    entries = numbers(source, element, 7 if by_quaternion else 6)
    if by_quaternion:
        return rotations.clean(rotation_matrix((entries[6], *entries[3:6]))), np.array(entries[:3])
    angles = [radians(angle) for angle in entries[3:]] if element.get("degrees") in TRUE else entries[3:]
    return rotations.clean(rotations.from_rpy(*angles)), np.array(entries[:3])


def numbers(source: Source, element: Element, count: int) -> list[float]:
    """So many finite numbers of an element.

    FileError if it holds something else.
    """
    found = decimal.numbers(element.text, count)
    if found is None:
        wanted = "a number" if count == 1 else f"{count} numbers"
        raise FileError(f"{source.place(element)}: <{element.tag}> needs {wanted}, got {element.text!r}.")
    return list(found)


def value(source: Source, element: Element | None, tag: str, default: float = 0.0) -> float:
    """Number of a child of an element; the default where there is none.

    FileError if the child holds something else.
    """
    found = None if element is None else element.find(tag)
    return default if found is None else numbers(source, found, 1)[0]


def text(element: Element, tag: str) -> str:
    """Text of a child, without blanks; empty if there is none."""
    return (element.findtext(tag) or "").strip()
