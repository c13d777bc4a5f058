"""Poses of an SDFormat model: every link, joint and frame is given relative to another, all are found in the model frame."""

from math import radians
from xml.etree.ElementTree import Element

import numpy as np

from gauss import rotations
from gauss.errors import FileError, did_you_mean
from gauss.io import numbers as decimal
from gauss.io.guard import Source
from gauss.scene.values import rotation_matrix
from gauss.system.frames import IDENTITY, Pose, compose

MODEL = "__model__"
FORMATS = ("euler_rpy", "quat_xyzw")


class Poses:
    """Poses of everything in a model that has a name.

    Parameters
    ----------
    source : Source
        The file.
    model : Element
        Its model.
    """

    def __init__(self, source: Source, model: Element):
        self.source, self.model = source, model
        self.elements: dict[str, Element] = {}
        for element in model:
            if element.tag in ("link", "joint", "frame"):
                name = element.get("name", "")
                if not name or name in self.elements or name in (MODEL, "world"):
                    raise FileError(
                        f"{source.place(element)}: the name {name!r} is missing, reserved or taken; give another."
                    )
                self.elements[name] = element
        self._found: dict[str, Pose | None] = {MODEL: IDENTITY}

    def of(self, name: str, asked: Element | None = None) -> Pose:
        """Pose (R, p) of a link, joint or frame in the model frame.

        Raises
        ------
        FileError
            If it does not exist, or refers to itself.
        """
        if name in self._found:
            known = self._found[name]
            if known is None:
                raise FileError(f"{self.source.place(asked)}: the pose of {name!r} is given relative to itself.")
            return known
        self._found[name] = None  # while it is looked for
        element = self.element(name, asked)
        found = self._found[name] = compose(self.of(self._base(element), element), pose(self.source, element.find("pose")))
        return found

    def element(self, name: str, asked: Element | None = None) -> Element:
        """Element of a name.

        Raises
        ------
        FileError
            If there is none.
        """
        if name not in self.elements:
            place = self.source.place(asked)
            raise FileError(f"{place}: no link, joint or frame {name!r}. {did_you_mean(name, self.elements)}")
        return self.elements[name]

    def link(self, name: str, asked: Element) -> str:
        """Link that carries a link or frame; a joint's frame is carried by its child, the model's by one of its links."""
        followed = []
        while name != MODEL and (element := self.element(name, asked)).tag != "link":
            if name in followed:
                raise FileError(f"{self.source.place(element)}: frame {name!r} is attached to itself.")
            followed.append(name)
            name = text(element, "child") if element.tag == "joint" else element.get("attached_to") or MODEL
        return self.canonical if name == MODEL else name

    @property
    def canonical(self) -> str:
        """Link that carries the model frame: that which the model names, or the first.

        Raises
        ------
        FileError
            If the model names none of its links.
        """
        links = [name for name, element in self.elements.items() if element.tag == "link"]
        named = self.model.get("canonical_link") or links[0]
        if named not in links:
            raise FileError(
                f"{self.source.place(self.model)}: canonical_link: no link {named!r}. {did_you_mean(named, links)}"
            )
        return named

    def _base(self, element: Element) -> str:
        """What the pose of an element is relative to."""
        placed = element.find("pose")
        named = "" if placed is None else placed.get("relative_to") or placed.get("frame") or ""
        if named:
            return named
        default = {"joint": text(element, "child"), "frame": element.get("attached_to")}.get(element.tag)
        return default or MODEL


def pose(source: Source, element: Element | None) -> Pose:
    """Pose (R, p) that a <pose> holds: a point [m], and roll, pitch, yaw about fixed axes [rad], or a quaternion.

    Raises
    ------
    FileError
        If it does not hold that.
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
    angles = [radians(angle) for angle in entries[3:]] if element.get("degrees") in ("true", "1") else entries[3:]
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


def text(element: Element, tag: str) -> str:
    """Text of a child, without blanks; empty if there is none."""
    return (element.findtext(tag) or "").strip()
