"""Optional content of a URDF file beside masses and joints: limits, resistance, collision shapes, motors."""

import warnings
from collections.abc import Iterable
from dataclasses import replace
from itertools import chain
from pathlib import Path
from xml.etree.ElementTree import Element

from gauss import rotations
from gauss.errors import FileError, NotImportedWarning, SceneError, did_you_mean, listed
from gauss.io.collision_meshes import mesh_path, mesh_vertices
from gauss.io.guard import Source
from gauss.io.numbers import LIMITS, add_stop, bounds, check_option, numbers
from gauss.io.urdf.guard import guarded, placed
from gauss.io.urdf.numbers import value, values
from gauss.scene import GROUND, Box, Capsule, Collider, ConvexMesh, Cylinder, Scene, Sphere

SIMPLE = "SimpleTransmission"  # what its type ends with
REDUCTION = "mechanicalReduction"


def with_extras(
    scene: Scene,
    path: Path,
    limits: str | None = None,
    resistance: bool = False,
    collisions: bool = False,
    motors: bool = False,
):
    """Scene of a URDF file with its limits, resistance, collision shapes and motors, as requested.

    FileError if an option is unknown, or a number is none.

    Parameters
    ----------
    scene : Scene
        Its bodies and joints; elements are added to it.
    limits : str, optional
        "start": the limits of joints are kept where a start is assembled; "stops": joints run against them, too. Robots
        are started at zero, which many files exclude: so limits are not read when this is not given.
    resistance : bool
        Whether ``<dynamics>`` is read: damping as a damper [N m s/rad, N s/m], friction as a joint that sticks and slips.
    collisions : bool
        Whether spheres, boxes, capsules, cylinders and hulls of meshes of ``<collision>`` become shapes, named LINK or
        LINK.2 …; contacts are added with ``scene.contacts_all``, of all shapes but those of neighbours, or with
        ``scene.contact``.
    motors : bool
        Whether each simple ``<transmission>`` becomes an input, named like its actuator: the torque [N m] or force [N] of
        the motor, which acts on the joint times the reduction, limited by the effort of the joint.

    Warns
    -----
    NotImportedWarning
        Of damping and friction that are left out, of limits that leave no motion, and of collision shapes and transmissions
        that are not modelled.
    """
    if limits is not None:
        check_option(path, "limits", limits, LIMITS)
    source, left = guarded(path), []
    joints = [joint for joint in source.root.findall("joint") if joint.get("name") in scene.joints]
    if limits:
        shut = [_limit(scene, source, joint, stops=limits == "stops") for joint in joints]
        left += _named("limits that leave no motion, of {}", shut)
    resisting = [_resist(scene, source, joint, resistance) for joint in joints]
    if not resistance:
        left += _named("damping and friction of {} (resistance=True or --read resistance reads them)", resisting)
    if collisions:
        unlike = chain.from_iterable(_shapes(scene, source, link) for link in source.root.findall("link"))
        left += _named("collision shapes that are not modelled: {}", unlike)
    if motors:
        left += _named("transmissions that are not modelled: {}", add_motors(scene, source))
    if left:
        warnings.warn(f"{path}: not read: {'; '.join(left)}.", NotImportedWarning, stacklevel=4)
    return scene


def _named(text: str, names: Iterable[str | None]) -> list[str]:
    """Message with the given names; none without names."""
    found = [name for name in names if name]
    return [text.format(listed(found))] if found else []


def _limit(scene: Scene, source: Source, element: Element, stops: bool) -> str | None:
    """Add the limits of a joint; its name if they leave no motion: such limits are placeholders, and are not read."""
    given, joint = element.find("limit"), scene.joints[element.get("name", "")]
    if given is None or element.get("type") == "continuous" or joint.pair.n_v != 1:
        return None
    lowest, highest = (value(source, given, key, 0.0) for key in ("lower", "upper"))
    if lowest >= highest:
        return joint.name
    with placed(source, given):
        scene.joints[joint.name] = replace(joint, limits=bounds(lowest, highest))
        if stops:
            add_stop(scene, joint.name)
    return None


def _resist(scene: Scene, source: Source, element: Element, read: bool) -> str | None:
    """Add damping and friction of a joint if they are requested; its name if it has any."""
    given, name = element.find("dynamics"), element.get("name", "")
    if given is None or scene.joints[name].pair.n_v != 1:
        return None
    damping, friction = (value(source, given, key, 0.0) for key in ("damping", "friction"))
    with placed(source, given):
        if read and damping:
            scene.joint_spring(f"damper of {name}", name, damping=damping)
        if read and friction:
            scene.joint_friction(name, friction)
    return name if damping or friction else None


def _shapes(scene: Scene, source: Source, link: Element) -> list[str]:
    """Add the shapes of a link; names of those that are not modelled."""
    unlike = []
    with placed(source, link):
        frame = _frame(scene, link.get("name", ""))
    for number, collision in enumerate(link.findall("collision"), start=1):
        geometry = collision.find("geometry")
        shape = None if geometry is None else next(iter(geometry), None)
        if shape is None:
            continue
        name = link.get("name", "") if number == 1 else f"{link.get('name')}.{number}"
        with placed(source, collision):
            made = _shape(source, name, frame, shape, collision.find("origin"))
            if made is not None:
                scene.add(made)
            else:
                unlike.append(f"{name} ({shape.tag})")
    return unlike


def _shape(source: Source, name: str, frame: str, shape: Element, origin: Element | None) -> Collider | None:
    """Shape of the geometry of a collision; None if there is no such shape."""
    none = (0.0, 0.0, 0.0)
    at, rpy = (none if origin is None else values(source, origin, key, none) for key in ("xyz", "rpy"))
    R = rotations.clean(rotations.from_rpy(*rpy))
    if shape.tag == "sphere":
        return Sphere(name, frame, at, value(source, shape, "radius"))
    if shape.tag == "box":
        return Box(name, frame, at, values(source, shape, "size"), R)
    if shape.tag == "capsule":
        radius, length = (value(source, shape, key) for key in ("radius", "length"))
        return Capsule(name, frame, at, radius, length, tuple(R[:, 2]))
    if shape.tag == "cylinder":
        radius, length = (value(source, shape, key) for key in ("radius", "length"))
        return Cylinder(name, frame, at, radius, length, tuple(R[:, 2]))
    path = mesh_path(Path(source.path), shape.get("filename", "")) if shape.tag == "mesh" else None
    if path is None:
        return None
    vertices = mesh_vertices(path, values(source, shape, "scale", (1.0, 1.0, 1.0)))
    return ConvexMesh(name, frame, at, tuple(map(tuple, vertices)), R)


def _frame(scene: Scene, link: str) -> str:
    """Body or frame of a link; one that is called like the world has another name."""
    name = f"{GROUND} link" if link == GROUND else link
    if name not in scene.bodies and name not in scene.frames:
        raise SceneError(f"no link {link!r} in the tree of the robot. {did_you_mean(name, [*scene.bodies, *scene.frames])}")
    return name


def add_motors(scene: Scene, source: Source) -> list[str]:
    """Add an input for each simple transmission, named like its actuator; names of the others.

    The format is that of ros_control (wiki.ros.org/urdf/XML/Transmission); the PR2 has the reduction beside the actuator.
    The torque u of a motor acts on its joint as the reduction n times u.
    The input is the torque [N m] or force [N] of the motor, limited by the effort of its joint over the reduction.

    FileError if a transmission names no actuator, no joint of the robot, or a reduction that is no number or zero.
    """
    joints = {joint.get("name", ""): joint for joint in source.root.findall("joint")}
    return [
        transmission.get("name", "")
        for transmission in source.root.findall("transmission")
        if not _added(scene, source, transmission, joints)
    ]


def _added(scene: Scene, source: Source, transmission: Element, joints: dict[str, Element]) -> bool:
    kind, ends = transmission.find("type"), transmission.findall("joint")
    named = transmission.get("type", "") if kind is None else (kind.text or "").strip()
    actuators = transmission.findall("actuator")
    if not named.endswith(SIMPLE) or len(ends) != 1 or len(actuators) != 1:
        return False
    where, joint = source.place(transmission), ends[0].get("name", "")
    if joint not in joints:
        raise FileError(f"{where}: <transmission> moves joint {joint!r}, which the robot does not have.")
    moved = scene.joints.get(joint)
    if moved is None or moved.pair.n_v != 1:
        return False  # a joint that is fixed, or follows another
    reduction = _reduction(source, transmission, actuators[0], ends[0])
    limit = joints[joint].find("limit")
    effort = 0.0 if limit is None else value(source, limit, "effort", 0.0)
    with placed(source, transmission):
        scene.input(actuators[0].get("name", ""), {joint: reduction}, abs(effort / reduction) if effort > 0.0 else None)
    return True


def _reduction(source: Source, *elements: Element) -> float:
    """Reduction n of the transmission, of its actuator, or of its joint; 1 if there is none."""
    given = next((found for found in (element.find(REDUCTION) for element in elements) if found is not None), None)
    if given is None:
        return 1.0
    found = numbers(given.text, 1)
    if found is None or not found[0]:
        raise FileError(f"{source.place(given)}: <{REDUCTION}>: expected a number other than 0, got {given.text!r}.")
    return found[0]
