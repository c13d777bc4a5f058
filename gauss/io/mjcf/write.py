"""Scenes as MJCF, the format of MuJoCo: elements with a counterpart in MuJoCo are written, others refused by name.

Bodies keep their frames and names. A joint of several freedoms becomes a chain of hinges and slides, named like the rates
of :attr:`gauss.System.coordinates`. Loops, couplings and constraints become equalities. MuJoCo keeps equalities softly and
corrects them over a time constant; they are written as stiff as the time step of the file bears.
"""

from dataclasses import dataclass, field
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from gauss import rotations
from gauss.dynamics import compile_scene
from gauss.dynamics.kinematics import kinematics
from gauss.errors import FileError
from gauss.io.mjcf.contacts import write_contacts
from gauss.io.mjcf.controls import write_controls
from gauss.io.mjcf.elements import write_elements
from gauss.io.mjcf.inertia import inertial
from gauss.io.mjcf.tree import ElementaryJoint, Limb, joint_frame, limb, mujoco_state, spanning_tree
from gauss.scene import GROUND, Joint, Scene
from gauss.scene.values import rotation_matrix
from gauss.system import System
from gauss.system.frames import relative

AT_WORLD = "origin of the world"  # a mark
WORLD = "world"  # MuJoCo's name of the ground
TIMESTEP = 1e-3  # s
DEEPEST_BODY = 496  # bodies inside bodies: the parser of MuJoCo takes 499 elements, of which three are others
STIFFEST = {"solref": f"{2 * TIMESTEP:g} 1", "solimp": "0.9999 0.9999 0.001 0.5 2"}  # the hardest that MuJoCo takes


@dataclass
class MjcfDocument:
    """MJCF file while it is written."""

    scene: Scene  # what is written
    system: System  # the same, compiled
    limbs: list[Limb]  # bodies of the tree
    root: Element = field(default_factory=lambda: Element("mujoco"))
    bodies: dict[str, Element] = field(default_factory=dict)  # element of every body
    taken: set[tuple[str, str]] = field(default_factory=set)  # names in use, with the kind of element that they name

    def add(self, parent: Element, tag: str, kind: str = "", **attributes) -> Element:
        """Add an element; its name must be unique among elements of the ``kind``."""
        element = SubElement(parent, tag, {key.rstrip("_"): text(value) for key, value in attributes.items()})
        name = element.get("name")
        if name is not None:
            if not name.isprintable():
                raise FileError(f"{name!r}: MJCF cannot hold this name; use letters that can be printed.")
            if (kind or tag, name) in self.taken:
                raise FileError(f"{name!r}: two elements of the kind {kind or tag} get this name in MJCF; rename one.")
            self.taken.add((kind or tag, name))
        return element

    def section(self, tag: str) -> Element:
        """Section of the file, made when it is first needed."""
        found = self.root.find(tag)
        return SubElement(self.root, tag) if found is None else found

    def site(self, name: str, place: str, position, R=None) -> str:
        """Mark a point, and axes, of a body or frame; the name of the mark."""
        carrier, position, R = self.on_body(place, position, np.eye(3) if R is None else R)
        self.add(self.bodies[carrier], "site", name=name, pos=position, quat=rotations.to_quaternion(R))
        return name

    def world_site(self) -> str:
        """Name of the mark that forces in world axes refer to, made when it is first needed."""
        return AT_WORLD if ("site", AT_WORLD) in self.taken else self.site(AT_WORLD, GROUND, np.zeros(3))

    def on_body(self, place: str, position, R) -> tuple[str, np.ndarray, np.ndarray]:
        """Body that carries a body frame or named frame, and a pose given in that frame."""
        frame = self.scene.frames.get(place)
        if frame is None:
            return place, position, R
        turned = rotation_matrix(frame.rotation)
        return frame.body, turned @ np.asarray(position) + frame.position, turned @ R

    def steps(self, joint: str, what: str) -> tuple[ElementaryJoint, ...]:
        """Steps of a joint of the tree."""
        found = next((one.steps for one in self.limbs if one.joint.name == joint), None)
        if found is None:
            raise FileError(f"{what}: joint {joint!r} closes a loop, where MuJoCo has no coordinate; act on another joint.")
        return found

    def coordinate(self, name: str, what: str) -> str:
        """Name of the hinge or slide of a joint of one freedom, or of one rate such as "U.angle1"."""
        placed, rate = self.system.coordinate(name)
        simple = [step.name for step in self.steps(placed.name, what) if step.kind in ("hinge", "slide")]
        wanted = name if rate is None else f"{placed.name}.{placed.pair.rates[rate]}"
        if wanted not in simple:
            raise FileError(f"{what}: {name!r} is no hinge or slide in MuJoCo, so no constraint can act on it there.")
        return wanted


def to_mjcf(scene: Scene) -> str:
    """Write a scene as MJCF, for MuJoCo.

    FileError if MuJoCo has no counterpart of an element; the message names it.

    Parameters
    ----------
    scene : Scene
        Any scene of bodies, joints, couplings, coincidences, distances, springs, constant drives and forces, stops, ropes
        and contacts without restitution, joint friction, inputs and outputs.

    Returns
    -------
    str
        The file. Its key frame "start" is the start of the scene, if the scene gives one.

    Notes
    -----
    Drives are actuators with their constant effort as bias, to which the control adds; springs between points are tendons.
    A moment of inertia that is zero, or that a planar motion never uses, is replaced by one that MuJoCo accepts; a comment
    in the file says so.
    """
    if scene.states:
        raise FileError(f"state {next(iter(scene.states))!r}: MuJoCo has no counterpart of states with laws of their own.")
    system = compile_scene(scene)
    tree, cut = spanning_tree(scene)
    _require_shallow(tree)
    document = MjcfDocument(scene, system, [limb(system, *edge) for edge in tree])
    _write_head(document)
    _write_bodies(document)
    for joint in cut:
        _close(document, joint)
    write_elements(document)
    write_contacts(document)
    write_controls(document)
    if scene.starts:
        qpos, qvel = mujoco_state(system, document.limbs, kinematics(system, system.initial_state()))
        document.add(document.section("keyframe"), "key", name="start", qpos=qpos, qvel=qvel)
    ElementTree.indent(document.root)
    return ElementTree.tostring(document.root, encoding="unicode") + "\n"


def write_mjcf(scene: Scene, path: Path) -> Path:
    """Write a scene to a file."""
    Path(path).write_text(to_mjcf(scene), encoding="utf-8")
    return Path(path)


def text(value) -> str:
    """Value of an attribute, with all digits."""
    if isinstance(value, str):
        return value
    return " ".join(repr(float(number)) for number in np.atleast_1d(value))


def _require_shallow(tree: list[tuple[Joint, str, str]]):
    """Refuse a tree whose bodies MuJoCo's parser would not open: elements are nested as the bodies are."""
    depths = {GROUND: 0}
    for _, outer, inner in tree:
        depths[outer] = depths[inner] + 1
        if depths[outer] > DEEPEST_BODY:
            raise FileError(
                f"body {outer!r}: it hangs on {depths[inner]} bodies, of which MuJoCo's parser takes {DEEPEST_BODY - 1}; "
                "save the scene as URDF."
            )


def _write_head(document: MjcfDocument):
    root = document.root
    root.set("model", document.scene.name)
    document.add(root, "compiler", angle="radian", inertiafromgeom="false")
    document.add(root, "option", gravity=document.scene.gravity, timestep=TIMESTEP, integrator="RK4")
    document.add(document.section("default"), "equality", **STIFFEST)
    document.bodies[GROUND] = document.section("worldbody")


def _write_bodies(document: MjcfDocument):
    scene = document.scene
    for one in document.limbs:
        if one.body == WORLD:
            raise FileError(f"body {one.body!r}: MuJoCo keeps this name for the ground; rename the body.")
        R, position = relative(scene, one.on, one.body)
        body = document.add(document.bodies[one.on], "body", name=one.body, pos=position, quat=rotations.to_quaternion(R))
        document.bodies[one.body] = body
        attributes, remark = inertial(document.system, document.limbs, one)
        if remark:
            body.append(ElementTree.Comment(f" {remark} "))
        if attributes:
            document.add(body, "inertial", **attributes)
        if one.joint.limits is not None:
            said = f" limits of joint {one.joint.name!r}, for the assembly of a start only, have no counterpart "
            body.append(ElementTree.Comment(said.replace("--", "- -")))
        for step in one.steps:
            _write_step(document, body, step)
        _couple_screw(document, one)
    for frame in scene.frames.values():
        document.site(frame.name, frame.name, np.zeros(3))


def _write_step(document: MjcfDocument, body: Element, step: ElementaryJoint):
    if step.kind == "free":
        document.add(body, "freejoint", "joint", name=step.name)
        return
    axis: dict = {} if step.axis is None else {"axis": step.axis}
    document.add(body, "joint", name=step.name, type=step.kind, pos=step.pos, **axis)


def _couple_screw(document: MjcfDocument, one: Limb):
    if one.joint.kind == "screw":
        name, polynomial = one.joint.name, [0.0, one.joint.pitch, 0.0, 0.0, 0.0]
        equality = {"name": f"pitch of {name}", "joint1": f"{name}.slide", "joint2": name, "polycoef": polynomial}
        document.add(document.section("equality"), "joint", "equality", **equality)


def _close(document: MjcfDocument, joint: Joint):
    """Write a joint that is cut as equality; a hinge is held at two points of its axis."""
    if joint.kind == "free":
        return
    held = {"ball": (0.0,), "revolute": (0.0, 1.0), "fixed": (0.0,)}
    if joint.kind not in held:
        raise FileError(
            f"joint {joint.name!r}: a {joint.kind} joint closes a loop, which MuJoCo has no equality for; "
            "let a revolute, ball or fixed joint of that loop carry no load, so that it can be cut instead."
        )
    tag = "weld" if joint.kind == "fixed" else "connect"
    for number, height in enumerate(held[joint.kind]):
        name = joint.name if not number else f"{joint.name}, along its axis"
        sites = []
        for body in (joint.parent, joint.child):
            R, position = joint_frame(document.system, joint, body)
            sites.append(document.site(f"{name}: {body}", body, position + height * R[:, 2], R))
        document.add(document.section("equality"), tag, "equality", name=name, site1=sites[0], site2=sites[1])
