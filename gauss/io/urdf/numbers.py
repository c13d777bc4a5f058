"""Numbers of a URDF file, read here and written down anew for Pinocchio's parser.

That parser takes less than XML allows: white space around a number, or a tab between two, makes the number unreadable, and
an unreadable ``<inertial>`` is none: the link weighs nothing, and nothing is said but a line on the standard error. So every
number that a robot is made of is read by :mod:`gauss.io.numbers` and refused with its place, or handed on in one form.
"""

from copy import deepcopy
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np

from gauss.errors import FileError, did_you_mean
from gauss.io.guard import Source
from gauss.io.numbers import numbers

MOMENTS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
COUNTS = {  # how many numbers an attribute holds, by element
    "origin": {"xyz": 3, "rpy": 3},
    "mass": {"value": 1},
    "inertia": dict.fromkeys(MOMENTS, 1),
    "axis": {"xyz": 3},
    "limit": dict.fromkeys(("lower", "upper", "effort", "velocity"), 1),
    "dynamics": {"damping": 1, "friction": 1},
    "mimic": {"multiplier": 1, "offset": 1},
    "calibration": dict.fromkeys(("rising", "falling", "reference_position"), 1),
    "safety_controller": dict.fromkeys(("soft_lower_limit", "soft_upper_limit", "k_position", "k_velocity"), 1),
    "sphere": {"radius": 1},
    "box": {"size": 3},
    "cylinder": {"radius": 1, "length": 1},
    "capsule": {"radius": 1, "length": 1},
    "mesh": {"scale": 3},
    "color": {"rgba": 4},
    "ratio": {"value": 1},
}
UNIFORM = {("mesh", "scale")}  # one number stands for those of all axes, as for Drake
REQUIRED = {"mass", "inertia", "axis", "sphere", "box", "cylinder", "capsule"}  # elements that need all of these attributes
EXACT = {"origin", "mass", "inertia", "mimic"}  # elements in which another attribute is a misspelt one
# What is read here alone, or by nobody; the parser is not given it, but for limits that it insists on.
KEPT_BACK = {"limit", "dynamics", "mimic", "calibration", "safety_controller", "collision"}
IDLE = {"lower": "0", "upper": "0", "effort": "0", "velocity": "0"}
PARTS = {"link": ("inertial", "visual", "collision"), "joint": tuple(COUNTS), "material": ("color",)}
PLUS = ("loop", "coupling")  # of URDF+, read here
LIMITED = ("revolute", "prismatic")  # joints that the parser wants limits of


def for_parser(source: Source) -> str:
    """Text of a file with its numbers in the one form that every parser reads, as Pinocchio's is given it.

    FileError if something else stands where a number belongs, or a number that is needed is missing; the message tells file,
    line, element and attribute.
    """
    root = deepcopy(source.root)
    for given, written in zip(source.root, root, strict=True):
        for child, copy in zip(given, written, strict=True):
            if child.tag in PARTS.get(given.tag, ()):
                for element, target in zip(child.iter(), copy.iter(), strict=True):
                    _normalise(source, element, target)
        if written.tag in ("link", "joint"):
            written[:] = [child for child in written if child.tag not in KEPT_BACK]
        if written.tag == "joint" and written.get("type") in LIMITED:
            written.append(Element("limit", IDLE))
    root[:] = [element for element in root if element.tag not in PLUS]
    return ElementTree.tostring(root, encoding="unicode")


def values(source: Source, element: Element, key: str, default: tuple[float, ...] | None = None) -> tuple[float, ...]:
    """Numbers of an attribute.

    FileError if it holds something else, or is missing and has no default.
    """
    text, count = element.get(key), COUNTS[element.tag][key]
    if text is None and default is not None:
        return default
    found = numbers(text, count)
    if found is None and (element.tag, key) in UNIFORM:
        alike = numbers(text, 1)
        found = None if alike is None else alike * count
    if found is None:
        wanted = "a number such as 0.5 or -2e-3" if count == 1 else f"{count} numbers with blanks between them"
        got = "there is none" if text is None else f"got {_short(text)}"
        raise FileError(f"{source.place(element)}: <{element.tag}> {key}: expected {wanted}, {got}.")
    return found


def value(source: Source, element: Element, key: str, default: float | None = None) -> float:
    """The number of an attribute; see :func:`values`."""
    return values(source, element, key, None if default is None else (default,))[0]


def _normalise(source: Source, element: Element, target: Element):
    """Numbers of one element, written to a copy of it."""
    keys = COUNTS.get(element.tag, {})
    if element.tag in EXACT:
        unknown = [key for key in element.keys() if key not in (*keys, "joint")]
        if unknown:
            place = source.place(element)
            raise FileError(f"{place}: <{element.tag}> has no attribute {unknown[0]!r}. {did_you_mean(unknown[0], keys)}")
    if element.tag == "inertial":
        for part in ("mass", "inertia"):
            if element.find(part) is None:
                raise FileError(
                    f"{source.place(element)}: <inertial> has no <{part}>; both are needed for a link that moves."
                )
    for key in keys:
        if key in element.keys() or element.tag in REQUIRED:
            target.set(key, " ".join(map(repr, values(source, element, key))))


def _short(text: str) -> str:
    return repr(text if len(text) <= 40 else f"{text[:40]}…")


def text_of(value) -> str:
    """One or several numbers as text, with all digits."""
    return " ".join(repr(float(number)) for number in np.atleast_1d(value))


def roll_pitch_yaw(R) -> tuple[float, float, float]:
    """Angles [rad] about the fixed axes x, y, z in this order; exact, too, where the pitch is a right angle."""
    yaw = np.arctan2(R[1, 0], R[0, 0]) if R[0, 0] or R[1, 0] else 0.0
    s, c = np.sin(yaw), np.cos(yaw)
    roll = np.arctan2(s * R[0, 2] - c * R[1, 2], c * R[1, 1] - s * R[0, 1])
    return float(roll), float(np.arctan2(-R[2, 0], c * R[0, 0] + s * R[1, 0])), float(yaw)
