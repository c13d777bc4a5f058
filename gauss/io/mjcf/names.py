"""Names of the parts of a compiled MuJoCo model, and where the file gives them."""

from dataclasses import dataclass
from functools import cached_property
from xml.etree.ElementTree import Element

import mujoco

from gauss.io.guard import Source
from gauss.io.mjcf.actuators import COUNT
from gauss.scene import GROUND

KINDS = {
    mujoco.mjtJoint.mjJNT_HINGE: "revolute",
    mujoco.mjtJoint.mjJNT_SLIDE: "prismatic",
    mujoco.mjtJoint.mjJNT_BALL: "ball",
    mujoco.mjtJoint.mjJNT_FREE: "free",
}
SCALAR = ("revolute", "prismatic")
BODY, SITE = int(mujoco.mjtObj.mjOBJ_BODY), int(mujoco.mjtObj.mjOBJ_SITE)
SECTIONS = ("equality", "actuator", "tendon")  # their children are numbered in the order of the file
MOVING = ("joint", "freejoint")
COUNTS = {"body": "nbody", "joint": "njnt", "geom": "ngeom", "equality": "neq", "actuator": COUNT, "tendon": "ntendon"}


@dataclass(frozen=True)
class Named:
    """A compiled model beside its file."""

    model: mujoco.MjModel  # what MuJoCo made of it
    source: Source  # the file, with all that it includes

    @cached_property
    def bodies(self) -> dict[int, str]:
        """Names of bodies; body 0 is the ground."""
        return {0: GROUND} | {i: self.name("body", i) for i in range(1, self.model.nbody)}

    @cached_property
    def joints(self) -> list[str]:
        """Names of joints."""
        return [self.name("joint", i) for i in range(self.model.njnt)]

    @cached_property
    def kinds(self) -> list[str]:
        """Kinds of joints, as gauss calls them."""
        return [KINDS[mujoco.mjtJoint(kind)] for kind in self.model.jnt_type]

    def name(self, kind: str, number: int) -> str:
        """Name of a part; its number where the file gives none."""
        name = getattr(self.model, kind)(number).name or f"{kind} {number}"
        return f"{kind} {name}" if name == GROUND else name

    def where(self, kind: str, number: int) -> str:
        """File and line of a part, as " (arm.xml:12)"; nothing where MuJoCo made it up, as it does of replicated bodies."""
        name, elements = getattr(self.model, kind)(number).name, self._elements.get(kind, [])
        found = [element for element in elements if name and element.get("name") == name]
        if not found and len(elements) == getattr(self.model, COUNTS[kind]):
            found = [elements[number]]
        return f" ({self.source.place(found[0])})" if len(found) == 1 else ""

    def mark(self, tag: str, attribute: str = "") -> str:
        """File and line of the first element of a kind that has an attribute."""
        found = next((e for e in self.source.root.iter(tag) if not attribute or e.get(attribute) is not None), None)
        return "" if found is None else f" ({self.source.place(found)})"

    @cached_property
    def _elements(self) -> dict[str, list[Element]]:
        """Elements of every kind, in the order in which MuJoCo numbers them."""
        root = self.source.root
        world = [Element("body"), *(child for section in root.iter("worldbody") for child in section.iter("body"))]
        places = [*root.iter("worldbody"), *world[1:]]
        found = {"body": world, "joint": _children(world, MOVING), "geom": _children(places, ("geom",))}
        for kind in SECTIONS:
            found[kind] = [child for section in root if section.tag == kind for child in section]
        return found


def _children(elements: list[Element], tags) -> list[Element]:
    return [child for element in elements for child in element if child.tag in tags]
