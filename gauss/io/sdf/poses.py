"""Poses and numbers of SDFormat elements."""

from math import radians
from xml.etree.ElementTree import Element

import numpy as np

from gauss import rotations
from gauss.errors import FileError, did_you_mean
from gauss.io import numbers as decimal
from gauss.io.guard import Source
from gauss.scene.values import rotation_matrix
from gauss.system.frames import IDENTITY, Pose

FORMATS = ("euler_rpy", "quat_xyzw")
TRUE = ("true", "1")


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

    Raises
    ------
    FileError
        If it holds something else.
    """
    found = decimal.numbers(element.text, count)
    if found is None:
        wanted = "a number" if count == 1 else f"{count} numbers"
        raise FileError(f"{source.place(element)}: <{element.tag}> needs {wanted}, got {element.text!r}.")
    return list(found)


def value(source: Source, element: Element | None, tag: str, default: float = 0.0) -> float:
    """Number of a child of an element; the default where there is none.

    Raises
    ------
    FileError
        If the child holds something else.
    """
    found = None if element is None else element.find(tag)
    return default if found is None else numbers(source, found, 1)[0]


def text(element: Element, tag: str) -> str:
    """Text of a child, without blanks; empty if there is none."""
    return (element.findtext(tag) or "").strip()
