"""Constraints and loads of a scene as MuJoCo's equalities, tendons, actuators and springs of joints."""

from functools import singledispatch

import numpy as np

from gauss.errors import FileError
from gauss.scene import GROUND, Coincident, Coupling, Distance, Drive, Force, JointSpring, LinearCoupling, Prescribed, Spring
from gauss.scene.values import rotation_matrix
from gauss.system.frames import relative

CANCELLED = 1e-9  # of the larger stiffness: what is left of two that cancel is rounding


def write_elements(document):
    """Write couplings, relations and loads; FileError if MuJoCo has no counterpart of one; the message names it."""
    scene = document.scene
    constraints = scene.couplings | scene.relations
    for element in (*constraints.values(), *scene.loads.values()):
        write(element, document)


@singledispatch
def write(element, document):
    """Write one element; what is not registered here has no counterpart."""
    what = getattr(element, "what", f"{type(element).__name__.lower()} {element.name!r}")
    raise FileError(f"{what}: MuJoCo has no counterpart of this constraint; leave it out of the scene that is exported.")


@write.register
def _(coupling: Coupling, document):
    what = f"coupling {coupling.name!r}"
    driven, driver = (document.coordinate(joint, what) for joint in (coupling.driven, coupling.driver))
    polynomial = [coupling.offset, coupling.ratio, 0.0, 0.0, 0.0]
    _equality(document, "joint", name=coupling.name, joint1=driven, joint2=driver, polycoef=polynomial)


@write.register
def _(coupling: LinearCoupling, document):
    tendon = document.add(document.section("tendon"), "fixed", "tendon", name=coupling.name)
    for joint, coefficient in zip(coupling.coupled, coupling.coefficients, strict=True):
        document.add(tendon, "joint", "", joint=document.coordinate(joint, coupling.what), coef=coefficient)
    _equality(document, "tendon", name=coupling.name, tendon1=coupling.name, polycoef=[coupling.constant, 0, 0, 0, 0])


@write.register
def _(relation: Coincident, document):
    one, two = _ends(document, relation)
    _equality(document, "connect", name=relation.name, site1=one, site2=two)


@write.register
def _(relation: Distance, document):
    reference = np.linalg.norm(
        reference_place(document, relation.body, relation.at) - reference_place(document, relation.other, relation.other_at)
    )
    length = reference if relation.length is None else _constant(relation.length, relation.what)
    line(document, relation, {})
    _equality(document, "tendon", name=relation.name, tendon1=relation.name, polycoef=[length - reference, 0, 0, 0, 0])


@write.register
def _(relation: Prescribed, document):
    what = f"drive {relation.name!r}"
    if relation.position is None:
        raise FileError(f"{what}: a prescribed speed has no counterpart in MuJoCo; drive the joint by a torque or force.")
    value = _constant(relation.position, what)
    joint = document.coordinate(relation.joint, what)
    _equality(document, "joint", name=relation.name, joint1=joint, polycoef=[value, 0, 0, 0, 0])


@write.register
def _(drive: Drive, document):
    what = f"drive {drive.name!r}"
    efforts, steps = np.atleast_1d(_constant(drive.effort, what)), document.steps(drive.joint, what)
    efforts = efforts if drive.limit is None else np.clip(efforts, -drive.limit, drive.limit)
    if any(step.gear is None for step in steps):
        raise FileError(f"{what}: MuJoCo has other rates for joint {drive.joint!r}; load the body by a force instead.")
    for number, rate in enumerate(document.system.joint(drive.joint).pair.rates):
        name = f"{drive.name}.{rate}" if rate else drive.name
        for step in steps:
            gear = step.gear[:, number]
            if gear.any():
                _motor(document, name=name, joint=step.name, gear=gear, effort=efforts[number])


@write.register
def _(spring: JointSpring, document):
    name = document.coordinate(spring.joint, f"joint spring {spring.name!r}")
    joint = next(element for element in document.root.iter("joint") if element.get("name") == name)
    stiffness, damping, rest = (float(joint.get(key, 0.0)) for key in ("stiffness", "damping", "springref"))
    total, torque = stiffness + spring.stiffness, stiffness * rest + spring.stiffness * spring.rest
    if torque and abs(total) <= CANCELLED * max(abs(stiffness), abs(spring.stiffness)):
        raise FileError(
            f"joint spring {spring.name!r}: the springs of joint {spring.joint!r} cancel but for a constant load, which "
            "springs of MuJoCo cannot give; write one spring, and a drive with that load."
        )
    rest = torque / total if total else rest  # springs side by side
    for key, value in (("stiffness", total), ("damping", damping + spring.damping), ("springref", rest)):
        joint.set(key, repr(float(value)))


@write.register
def _(spring: Spring, document):
    constants = {"stiffness": spring.stiffness, "damping": spring.damping, "springlength": spring.length}
    line(document, spring, constants)


@write.register
def _(force: Force, document):
    what = f"force {force.name!r}"
    wrench = np.concatenate([_constant(force.force, what), _constant(force.moment, what)])
    if force.body == GROUND:
        return
    at = document.scene.bodies[force.body].com if force.at is None else force.at
    target = {"site": document.site(f"{force.name}: {force.body}", force.body, at)}
    if force.axes == "world":
        target["refsite"] = document.world_site()
    _motor(document, name=force.name, gear=wrench, effort=1.0, **target)


def _constant(value, what: str):
    if callable(value):
        raise FileError(f"{what}: its law is a Python function, which a file cannot hold; give a number.")
    return value


def _equality(document, tag: str, **attributes):
    document.add(document.section("equality"), tag, "equality", **attributes)


def _motor(document, effort: float, **attributes):
    """Actuator of a constant effort, to which the control adds."""
    bias = {"gainprm": 1.0, "biastype": "affine", "biasprm": [effort, 0.0, 0.0]}
    document.add(document.section("actuator"), "general", **attributes, **bias)


def _ends(document, element) -> tuple[str, str]:
    ends = ((element.body, element.at), (element.other, element.other_at))
    return tuple(document.site(f"{element.name}: {place}", place, at) for place, at in ends)


def line(document, element, constants: dict):
    """Straight tendon between the two points of an element."""
    sites = _ends(document, element)
    tendon = document.add(document.section("tendon"), "spatial", name=element.name, **constants)
    for site in sites:
        document.add(tendon, "site", "", site=site)


def reference_place(document, place: str, at) -> np.ndarray:
    """Point of a body or frame in the world at the reference configuration."""
    frame = document.scene.frames.get(place)
    if frame is not None:
        place, at = frame.body, rotation_matrix(frame.rotation) @ np.asarray(at) + frame.position
    R, p = relative(document.scene, GROUND, place)
    return p + R @ np.asarray(at)
