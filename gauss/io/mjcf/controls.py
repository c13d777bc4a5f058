"""Inputs of a scene as actuators of MuJoCo, and outputs as its sensors."""

from xml.etree.ElementTree import Comment

import numpy as np

from gauss.errors import FileError
from gauss.scene import Input, Output

FRAMES = {
    "position": "framepos",
    "rotation": "framequat",
    "x_axis": "framexaxis",
    "y_axis": "frameyaxis",
    "z_axis": "framezaxis",
    "velocity": "framelinvel",
    "angular_velocity": "frameangvel",
    "proper_acceleration": "framelinacc",
    "angular_acceleration": "frameangacc",
}
SUBTREES = {"center_of_mass": "subtreecom", "center_of_mass_velocity": "subtreelinvel", "angular_momentum": "subtreeangmom"}
JOINTS = {"coordinate": ("jointpos", "ballquat"), "rate": ("jointvel", "ballangvel")}  # of one freedom, of a ball
OWN = {"gyroscope": "gyro", "accelerometer": "accelerometer", "velocimeter": "velocimeter"}  # in the axes of the site


def write_controls(document):
    """Write inputs and outputs; outputs that MuJoCo has no sensor of are named in a comment.

    FileError if MuJoCo has no counterpart of an input; the message names it.
    """
    for given in document.scene.inputs.values():
        _write_input(document, given)
    for output in document.scene.outputs.values():
        try:
            _write_output(document, output)
        except FileError:
            what = f" output {output.name!r}, the {output.kind} of {output.of!r}, has no sensor in MuJoCo "
            document.section("sensor").append(Comment(what.replace("--", "- -")))


def _write_input(document, given: Input):
    what, options = f"input {given.name!r}", {"name": given.name, "gainprm": 1.0}
    if given.effort is not None or any(callable(part) for force in given.forces for part in (force.force, force.moment)):
        raise FileError(f"{what}: its effort is a Python function, which a file cannot hold; leave the input out.")
    if given.limits is not None:
        options |= {"ctrllimited": "true", "ctrlrange": list(given.bounds)}
    acts_on = given.acts_on
    if len(given.forces) + bool(acts_on) != 1:
        raise FileError(f"{what}: it acts on several bodies, where MuJoCo has one site for an actuator; divide it.")
    if given.forces:
        _at_site(document, given, options)
    elif len(acts_on) == 1:
        (joint, factor), *_ = acts_on.items()
        _at_joint(document, what, joint, factor, options)
    else:
        tendon = document.add(document.section("tendon"), "fixed", "tendon", name=given.name)
        for joint, factor in acts_on.items():
            document.add(tendon, "joint", "", joint=document.coordinate(joint, what), coef=factor)
        document.add(document.section("actuator"), "general", tendon=given.name, **options)


def _at_site(document, given: Input, options: dict):
    force = given.forces[0]
    at = document.scene.bodies[force.body].com if force.at is None else force.at
    target = {"site": document.site(f"{given.name}: {force.body}", force.body, at)}
    if force.axes == "world":
        target["refsite"] = document.world_site()
    wrench = np.concatenate([force.force, force.moment])
    document.add(document.section("actuator"), "general", gear=wrench, **target, **options)


def _at_joint(document, what: str, joint: str, factor: float, options: dict):
    """Actuator of one joint, or of one rate of a joint of several freedoms."""
    placed, rate = document.system.coordinate(joint)
    steps = document.steps(placed.name, what)
    if any(step.gear is None for step in steps):
        raise FileError(f"{what}: MuJoCo has other rates for joint {placed.name!r}; load the body by a force instead.")
    gears = {step.name: factor * step.gear[:, rate or 0] for step in steps}
    acted = {name: gear for name, gear in gears.items() if gear.any()}
    if len(acted) != 1:
        raise FileError(f"{what}: {joint!r} is no rate of one joint in MuJoCo; act on another joint.")
    name, gear = next(iter(acted.items()))
    document.add(document.section("actuator"), "general", joint=name, gear=gear, **options)


def _write_output(document, output: Output):
    what, sensors = f"output {output.name!r}", document.section("sensor")
    if output.kind in FRAMES or output.kind in OWN:
        site = _site_of(document, f"{what} at", output.of, output.at)
        if output.kind in OWN:
            document.add(sensors, OWN[output.kind], "sensor", name=output.name, site=site)
            return
        options = {"objtype": "site", "objname": site}
        if output.relative_to:
            options |= {"reftype": "site", "refname": _site_of(document, f"{what} from", output.relative_to)}
        document.add(sensors, FRAMES[output.kind], "sensor", name=output.name, **options)
    elif output.kind in SUBTREES:
        if len(document.limbs) < len(document.scene.joints):
            raise FileError(f"{what}: what hangs on a body is another in MuJoCo, which cuts loops elsewhere.")
        body = document.bodies[output.of].get("name", "world")
        document.add(sensors, SUBTREES[output.kind], "sensor", name=output.name, body=body)
    elif output.kind in JOINTS:
        of_one, of_ball = JOINTS[output.kind]
        if document.scene.joints[output.of].kind == "ball":
            document.add(sensors, of_ball, "sensor", name=output.name, joint=_ball(document, output.of, what))
        else:
            document.add(sensors, of_one, "sensor", name=output.name, joint=document.coordinate(output.of, what))
    else:
        raise FileError(f"{what}: MuJoCo has no sensor of it.")


def _site_of(document, called: str, place: str, at=(0.0, 0.0, 0.0)) -> str:
    """Name of the site of a frame, or of one that is made at a point of a body or frame."""
    marked = place in document.scene.frames and not any(at)
    return place if marked else document.site(f"{called} {place}", place, at)


def _ball(document, joint: str, what: str) -> str:
    """Name of a ball joint that has the same coordinates and rates in MuJoCo, which has the axes of the outer body."""
    step = document.steps(joint, what)[0]
    if step.gear is None or not np.array_equal(step.gear, np.eye(3)):
        raise FileError(f"{what}: MuJoCo has other coordinates and rates for joint {joint!r}.")
    return step.name
