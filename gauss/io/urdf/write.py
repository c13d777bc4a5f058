"""Scenes as URDF: the spanning tree and its loops (URDF+) in the file itself, and in a file beside it everything else.

Hinges, slides and fixed joints keep their names; other joints of hinges and slides become chains of them, named like the
rates of :attr:`gauss.System.coordinates`; ball and free joints leave a link floating, and a ball joint then closes a loop.
A link's frame is moved to the joint that moves it, as URDF has it.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Comment, Element, SubElement

import numpy as np

from gauss.dynamics import compile_scene
from gauss.errors import FileError
from gauss.io.mjcf.inertia import inertial
from gauss.io.mjcf.tree import ElementaryJoint, Limb, joint_frame, limb, spanning_tree
from gauss.io.urdf.numbers import roll_pitch_yaw, text_of
from gauss.io.urdf.plus import write_coupling, write_loop
from gauss.io.urdf.side import ENDS, side_file
from gauss.io.urdf.starts import whole_start
from gauss.rotations import from_quaternion
from gauss.scene import GROUND, Coupling, Drive, Joint, Output, Scene, Start
from gauss.scene.inputs import SENSORS
from gauss.scene.toml import toml_text
from gauss.scene.values import rotation_matrix
from gauss.system import System
from gauss.system.frames import relative

ROOT = "world"
NO_LIMIT = 1e9  # rad, m, N m, N, rad/s, m/s: limits that URDF wants where a scene has none
TYPES = {"hinge": "continuous", "slide": "prismatic"}


@dataclass
class UrdfDocument:
    """URDF file while it is written, and what goes beside it."""

    scene: Scene
    system: System
    limbs: list[Limb]  # bodies of the tree
    root: Element
    rest: Scene  # what the file cannot say
    # where the frame of each body is moved to, in its old frame (3,) [m]
    shifts: dict[str, np.ndarray] = field(default_factory=dict)
    # element of each joint of the file of one freedom, by name, that mimics no other yet
    mimics: dict[str, Element] = field(default_factory=dict)


def write_urdf(scene: Scene, path: Path) -> Path:
    """Write a scene as URDF, and beside it, where URDF does not suffice, as PATH.loops.toml; see :func:`to_urdf`."""
    text, beside = to_urdf(scene)
    path = Path(path)
    path.write_text(text, encoding="utf-8")
    if beside or side_file(path).exists():  # one of another scene must not be read with this
        side_file(path).write_text(beside, encoding="utf-8")
    return path


def to_urdf(scene: Scene) -> tuple[str, str]:
    """Write a scene as URDF.

    FileError if a name or a law cannot be written; the message names it.

    Parameters
    ----------
    scene : Scene
        Any scene without functions of Python in it.

    Returns
    -------
    tuple of str
        The file, which lists in a comment what it cannot say, and the contents of the file beside it, empty if not needed.
    """
    system = compile_scene(scene)
    tree, cut = spanning_tree(scene)
    limbs = [limb(system, *edge) for edge in tree]
    rest = Scene(scene.name, scene.gravity)
    document = UrdfDocument(scene, system, limbs, Element("robot", name=scene.name), rest)
    SubElement(document.root, "link", name=_ground(scene))
    for one in limbs:
        _write_limb(document, one)
    for frame in scene.frames.values():
        _write_frame(document, frame)
    for joint in cut:
        if not write_loop(document, joint, _ground(scene)):
            document.rest.joints[joint.name] = _moved(joint, document.shifts)
    _keep_rest(document)
    said = [f"{kind} {name!r}" for kind, name in _listed(document.rest)]
    beside = "" if not said and rest.gravity == Scene().gravity else toml_text(document.rest)
    if said:
        listed = f" Not in this file, but in the one beside it: {', '.join(said)}. ".replace("--", "- -")
        document.root.insert(0, Comment(listed))
    _check_names(document)
    ElementTree.indent(document.root)
    return ElementTree.tostring(document.root, encoding="unicode") + "\n", beside


def _ground(scene: Scene) -> str:
    name = ROOT
    while name in scene.bodies or name in scene.frames:
        name += "_"
    return name


def _names(root: Element):
    return [element.get("name") for element in root.iter() if isinstance(element.tag, str) and element.get("name")]


def _check_names(document: UrdfDocument):
    """Refuse names that URDF cannot hold, and links or joints of the same name, as those that are made for chains."""
    for name in _names(document.root):
        if not name.isprintable():
            raise FileError(f"{name!r}: URDF cannot hold this name; use letters that can be printed.")
    joints = [element for tag in ("joint", "loop") for element in document.root.findall(tag)]
    for kind, elements in (("link", document.root.findall("link")), ("joint", joints)):
        names = [element.get("name") for element in elements] + (list(document.rest.joints) if kind == "joint" else [])
        twice = next((name for name in names if names.count(name) > 1), None)
        if twice is not None:
            raise FileError(f"{twice!r}: two elements of the kind {kind} get this name in URDF; rename one.")


def _write_limb(document: UrdfDocument, one: Limb):
    """Link of a body, and the joints that lead to it."""
    scene, name = document.scene, one.body
    floats = _floats(scene, one)
    steps = () if floats else one.steps
    shift = document.shifts[name] = np.array(steps[-1].pos) if steps else np.zeros(3)
    R, p = relative(scene, one.on, name)
    p = p + R @ shift - document.shifts.get(one.on, np.zeros(3))
    on = _ground(scene) if one.on == GROUND else one.on
    for number, step in enumerate(steps):
        child = name if number == len(steps) - 1 else f"{name} before {steps[number + 1].name}"
        _write_step(document, one, step, on, child, R, p)
        if child != name:
            SubElement(document.root, "link", name=child)
        on, R, p = child, np.eye(3), np.zeros(3)
    if one.joint.kind == "screw":
        _mimic(document, f"{one.joint.name}.slide", one.joint.name, one.joint.pitch, 0.0)
    if floats:
        _float(document, one, on, R, p)
    elif not steps:
        _joint(document, one.joint.name, "fixed", on, name, R, p)
    _write_link(document, one)


def _floats(scene: Scene, one: Limb) -> bool:
    """Whether a link floats; quadratic programmes, which contacts need, have no form for links without mass."""
    with_contacts = bool(scene.contacts or scene.set_valued)
    return any(step.kind in ("ball", "free") for step in one.steps) or (len(one.steps) > 1 and with_contacts)


def _write_step(document: UrdfDocument, one: Limb, step: ElementaryJoint, on: str, child: str, R, p):
    """Hinge or slide with its limits."""
    limits, kind = (-NO_LIMIT, NO_LIMIT), TYPES[step.kind]
    if one.joint.limits is not None and step.name == one.joint.name:
        limits, kind = one.joint.limits, "revolute" if step.kind == "hinge" else kind
    joint = _joint(document, step.name, kind, on, child, R, p)
    SubElement(joint, "axis", xyz=text_of(step.axis))
    if kind != "continuous":
        ends = {"lower": limits[0], "upper": limits[1], "effort": NO_LIMIT, "velocity": NO_LIMIT}
        SubElement(joint, "limit", {key: text_of(value) for key, value in ends.items()})
    document.mimics[step.name] = joint


def _float(document: UrdfDocument, one: Limb, on: str, R, p):
    """Floating link; a joint with more data goes beside it."""
    plain = _is_plain(document.system, one)
    _joint(document, one.joint.name if plain else f"{one.body} floats", "floating", on, one.body, R, p)
    if not plain:
        document.rest.joints[one.joint.name] = one.joint


def _is_plain(system: System, one: Limb) -> bool:
    """Whether a joint is free and counts from the frame of its child, as that of a floating link does in URDF."""
    if one.joint.kind != "free" or one.joint.child != one.body:
        return False
    R, p = joint_frame(system, one.joint, one.body)
    return bool(np.array_equal(R, np.eye(3)) and not p.any())


def _joint(document: UrdfDocument, name: str, kind: str, parent: str, child: str, R, p) -> Element:
    joint = SubElement(document.root, "joint", name=name, type=kind)
    SubElement(joint, "parent", link=parent)
    SubElement(joint, "child", link=child)
    SubElement(joint, "origin", xyz=text_of(p), rpy=text_of(roll_pitch_yaw(R)))
    return joint


def _write_link(document: UrdfDocument, one: Limb):
    body, shift = document.scene.bodies[one.body], document.shifts[one.body]
    link = SubElement(document.root, "link", name=one.body)
    if body.inertia_as_given:
        (J, R), remark = body.principal(), "no body has this inertia"
    elif body.mass:
        values, remark = inertial(document.system, document.limbs, one, strict=False)
        J, R = values["diaginertia"], from_quaternion(values["quat"])
    else:
        return
    tensor = R @ np.diag(J) @ R.T
    if remark:
        link.append(Comment(f" {remark} "))
    given = SubElement(link, "inertial")
    SubElement(given, "origin", xyz=text_of(np.array(body.com) - shift), rpy="0 0 0")
    SubElement(given, "mass", value=text_of(body.mass))
    entries = {f"i{'xyz'[i]}{'xyz'[j]}": text_of(tensor[i, j]) for i in range(3) for j in range(i, 3)}
    SubElement(given, "inertia", entries)


def _write_frame(document: UrdfDocument, frame):
    position = np.array(frame.position) - document.shifts.get(frame.body, np.zeros(3))
    SubElement(document.root, "link", name=frame.name)
    on = _ground(document.scene) if frame.body == GROUND else frame.body
    _joint(document, f"{frame.name} is fixed", "fixed", on, frame.name, rotation_matrix(frame.rotation), position)


def _mimic(document: UrdfDocument, driven: str, driver: str, ratio: float, offset: float):
    joint = document.mimics.pop(driven)
    SubElement(joint, "mimic", joint=driver, multiplier=text_of(ratio), offset=text_of(offset))


def _keep_rest(document: UrdfDocument):
    """Put into the second file all that the first does not hold."""
    scene, rest = document.scene, document.rest
    for coupling in scene.couplings.values():
        if coupling.driven in document.mimics and _in_file(document, coupling):
            _mimic(document, coupling.driven, coupling.driver, coupling.ratio, coupling.offset)
        else:
            rest.couplings[coupling.name] = coupling
    for group in ("relations", "shapes", "contacts", "set_valued"):
        kept = {name: one for name, one in getattr(scene, group).items() if not write_coupling(document, one)}
        getattr(rest, group).update((name, _moved(one, document.shifts)) for name, one in kept.items())
    _keep_loads(document)
    rest.inputs.update(scene.inputs)
    rest.outputs.update((name, _measured(document, output)) for name, output in scene.outputs.items())


def _measured(document: UrdfDocument, output: Output) -> Output:
    """Output in the file, at the same point of its body.

    FileError if it measures a joint that becomes a chain in the file, or from a body whose frame is another there.
    """
    if SENSORS[output.kind][0] == "joint":
        rates = document.scene.joints[output.of].pair.rates
        if len(rates) > 1 and f"{output.of}.{rates[0]}" in _names(document.root):
            raise FileError(
                f"output {output.name!r}: joint {output.of!r} is a chain of joints in URDF; measure one of a body."
            )
        return output
    if np.any(document.shifts.get(output.relative_to, 0.0)):
        raise FileError(
            f"output {output.name!r}: the frame of {output.relative_to!r} moves in URDF; measure from a named frame."
        )
    shift = document.shifts.get(output.of, np.zeros(3))
    return replace(output, at=_tuple(output.at - shift)) if SENSORS[output.kind][0] == "frame" else output


def _keep_loads(document: UrdfDocument):
    """Put loads and starts into the second file, those of a joint that became a chain one by one."""
    scene, rest = document.scene, document.rest
    for name, load in scene.loads.items():
        for number, part in enumerate(_split(document, load) if isinstance(load, Drive) else [load]):
            rest.loads[f"{name}{number or ''}"] = _moved(part, document.shifts)
    for part in _starts(document):
        rest.starts[part.joint] = part


def _starts(document: UrdfDocument) -> list[Start]:
    """Starts of the joints of the file: those of the scene, or all where the file has loops that the scene has not."""
    scene, floating = document.scene, {}
    for one in document.limbs:
        if _floats(scene, one):
            floating[one.body] = one.joint.name if _is_plain(document.system, one) else f"{one.body} floats"
    closes = any(
        one.joint.kind == "screw" or floating.get(one.body, one.joint.name) != one.joint.name for one in document.limbs
    )
    if scene.starts and closes:
        return list(whole_start(document.system, document.limbs, floating))
    return [part for start in scene.starts.values() for part in _split(document, start)]


def _in_file(document: UrdfDocument, coupling: Coupling) -> bool:
    return any(joint.get("name") == coupling.driver for joint in document.root.iter("joint"))


def _split(document: UrdfDocument, element: Drive | Start) -> list:
    """Drive or start of a joint that became a chain, one for each joint of it."""
    joint = document.scene.joints[element.joint]
    rates = joint.pair.rates
    names = [f"{joint.name}.{rate}" for rate in rates]
    if joint.pair.n_v < 2 or names[0] not in _names(document.root):
        return [element]
    if isinstance(element, Start):
        position: Iterable = (None,) * len(names) if element.position is None else np.atleast_1d(element.position).tolist()
        rate = np.broadcast_to(element.rate, len(names))
        return [Start(name, p, float(v)) for name, p, v in zip(names, position, rate, strict=True)]
    if callable(element.effort):
        raise FileError(f"drive {element.name!r}: its law is a Python function, which a file cannot hold; give numbers.")
    efforts = zip(names, rates, np.atleast_1d(element.effort), strict=True)
    return [Drive(f"{element.name}.{rate}", name, float(effort), element.limit) for name, rate, effort in efforts]


def _moved(element, shifts: dict[str, np.ndarray]):
    """Element whose points are given in the moved frames of their bodies."""
    if isinstance(element, Joint):
        if element.frame not in shifts:
            return replace(element, child_at=None)
        return replace(element, at=_tuple(element.at - shifts[element.frame]), child_at=None)
    for end, at in ENDS:
        if hasattr(element, at) and getattr(element, at) is not None and getattr(element, end) in shifts:
            element = replace(element, **{at: _tuple(getattr(element, at) - shifts[getattr(element, end)])})
    return element


def _listed(rest: Scene):
    kinds = ("joints", "couplings", "relations", "shapes", "contacts", "set_valued", "loads", "starts", "inputs", "outputs")
    return [(kind.removesuffix("s"), name) for kind in kinds for name in getattr(rest, kind)]


def _tuple(values) -> tuple:
    return tuple(float(value) for value in values)
