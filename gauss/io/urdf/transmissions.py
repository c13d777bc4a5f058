"""Transmissions of a URDF file as inputs: the torque u of a motor acts on its joint as the reduction n times u.

The format is that of ros_control (wiki.ros.org/urdf/XML/Transmission); the PR2 has the reduction beside the actuator.
"""

from xml.etree.ElementTree import Element

from gauss.errors import FileError
from gauss.io.guard import Source
from gauss.io.numbers import numbers
from gauss.io.urdf.guard import placed
from gauss.io.urdf.numbers import value
from gauss.scene import Scene

SIMPLE = "SimpleTransmission"  # what its type ends with
REDUCTION = "mechanicalReduction"


def add_motors(scene: Scene, source: Source) -> list[str]:
    """Add an input for each simple transmission, named like its actuator; names of the others.

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
