"""Contacts, stops, ropes and joint friction as MuJoCo's pairs of geoms, limits and friction losses.

MuJoCo models all of them as soft; they are written as stiff as the time step of the file permits. It has no restitution.
"""

from functools import singledispatch
from xml.etree.ElementTree import Element

import numpy as np

from gauss import rotations
from gauss.errors import FileError
from gauss.io.mjcf.elements import line, reference_place
from gauss.scene import (
    GROUND,
    Box,
    Capsule,
    Cone,
    Contact,
    ConvexMesh,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    HeightField,
    JointFriction,
    Points,
    Rope,
    Sphere,
    Stop,
)
from gauss.scene.curved_shapes import ConvexCollider
from gauss.scene.values import unit

FAR = 1e9  # rad or m: limit of a joint on the side without a stop
DAMPING = 10  # times critical: critically damped springs rebound with a tenth of the speed when they push one way only
SHOWN = 1.0  # m, half the edge of the square that a viewer shows of a plane


def write_contacts(document):
    """Write unilateral constraints and joint friction.

    FileError if MuJoCo has no counterpart of one; the message names it.
    """
    scene = document.scene
    for element in scene.contacts.values():
        if element.restitution:
            raise FileError(
                f"{element.what}: MuJoCo has no restitution; set it to 0, or leave it out of the scene that is exported."
            )
        write(element, document)
    for element in scene.set_valued.values():
        write(element, document)


@singledispatch
def write(element, document):
    """Write one element; what is not registered here has no counterpart."""
    raise FileError(f"{element.what}: MuJoCo has no counterpart of it; leave it out of the scene that is exported.")


@write.register
def _(stop: Stop, document):
    lowest, highest = (far if value is None else value for value, far in ((stop.lowest, -FAR), (stop.highest, FAR)))
    joint = _joint(document, stop.joint, stop.what)
    if joint.get("limited"):
        raise FileError(f"{stop.what}: MuJoCo has one pair of stops for a joint; give the lowest and the highest together.")
    _set(joint, {"limited": "true", "range": [lowest, highest]} | _stiff(document, "limit"))


@write.register
def _(rope: Rope, document):
    ends = (reference_place(document, *end) for end in ((rope.body, rope.at), (rope.other, rope.other_at)))
    length = float(np.linalg.norm(np.subtract(*ends))) if rope.length is None else rope.length
    line(document, rope, {"limited": "true", "range": [0.0, length]} | _stiff(document, "limit"))


@write.register
def _(contact: Contact, document):
    shapes = (document.scene.shapes[name] for name in (contact.shape, contact.other))
    first, second = (_geoms(shape, document) for shape in shapes)
    rough = {"condim": "3", "friction": [contact.friction] * 2 + [0.0] * 3}
    friction: dict = rough if contact.friction else {"condim": "1"}
    for one in first:
        for other in second:
            name = contact.name if len(first) * len(second) == 1 else f"{contact.name}: {one}, {other}"
            pair = {"name": name, "geom1": one, "geom2": other} | friction | _stiff(document)
            document.add(document.section("contact"), "pair", **pair)


@write.register
def _(friction: JointFriction, document):
    if callable(friction.limit):
        raise FileError(f"{friction.what}: its limit is a Python function, which a file cannot hold; give a number.")
    joint = _joint(document, friction.joint, friction.what)
    _set(joint, {"frictionloss": float(joint.get("frictionloss", 0.0)) + friction.limit})


def _geoms(shape, document) -> list[str]:
    """Geoms of a shape, written when they are first needed; their names."""
    if isinstance(shape, Points):
        if not shape.radius:
            raise FileError(f"{shape.what}: MuJoCo has no points; give them a radius, or use a box.")
        names = [f"{shape.name} {k + 1}" for k in range(len(shape.corners))]
        ball = {"type": "sphere", "size": shape.radius}
        return [_geom(document, shape, name, at, ball) for name, at in zip(names, shape.corners, strict=True)]
    if isinstance(shape, HalfSpace) and document.on_body(shape.body, np.zeros(3), np.eye(3))[0] != GROUND:
        raise FileError(f"{shape.what}: planes of MuJoCo do not move; use a box.")
    axes = np.eye(3)
    if isinstance(shape, HeightField):
        at = np.array(shape.at) + shape.axes @ (0.0, 0.0, np.min(shape.heights))
        return [_geom(document, shape, shape.name, at, _field(document, shape), shape.axes)]
    if isinstance(shape, ConvexCollider):
        return [_geom(document, shape, shape.name, shape.at, _convex(document, shape), shape.axes)]
    if isinstance(shape, Sphere):
        geom = {"type": "sphere", "size": shape.radius}
    elif isinstance(shape, Capsule):
        geom, axes = {"type": "capsule", "size": [shape.radius, 0.5 * shape.length]}, rotations.along(unit(shape.axis))
    elif isinstance(shape, Box):
        geom, axes = {"type": "box", "size": 0.5 * np.array(shape.size)}, shape.axes
    else:
        geom, axes = {"type": "plane", "size": [SHOWN, SHOWN, SHOWN]}, rotations.along(unit(shape.normal))
    return [_geom(document, shape, shape.name, shape.at, geom, axes)]


def _field(document, shape: HeightField) -> dict:
    """Type and asset of a geom; MuJoCo takes elevations from the greatest y down, from 0 to 1 whatever their numbers."""
    heights = np.array(shape.heights)
    if ("hfield", shape.name) not in document.taken:
        grid = {"nrow": str(heights.shape[0]), "ncol": str(heights.shape[1]), "elevation": heights[::-1].ravel()}
        rise = float(np.ptp(heights)) or shape.depth  # which is to be > 0, also where the field is flat
        size = [0.5 * shape.size[0], 0.5 * shape.size[1], rise, shape.depth]
        document.add(document.section("asset"), "hfield", name=shape.name, **grid, size=size)
    return {"type": "hfield", "hfield": shape.name}


def _convex(document, shape: ConvexCollider) -> dict:
    """Type and size of a geom; the vertices of a mesh are an asset."""
    if isinstance(shape, Ellipsoid):
        return {"type": "ellipsoid", "size": shape.radii}
    if isinstance(shape, Cylinder):
        return {"type": "cylinder", "size": [shape.radius, 0.5 * shape.length]}
    if isinstance(shape, ConvexMesh):
        if ("mesh", shape.name) not in document.taken:
            document.add(document.section("asset"), "mesh", name=shape.name, vertex=np.ravel(shape.vertices))
        return {"type": "mesh", "mesh": shape.name}
    assert isinstance(shape, Cone)
    raise FileError(f"{shape.what}: MuJoCo has no cones; use a mesh.")


def _geom(document, shape, name: str, at, attributes: dict, axes=None) -> str:
    if ("geom", name) not in document.taken:
        body, position, R = document.on_body(shape.body, np.asarray(at), np.eye(3) if axes is None else axes)
        pose = {"pos": position, "quat": rotations.to_quaternion(R)}
        document.add(document.bodies[body], "geom", name=name, contype="0", conaffinity="0", **attributes, **pose)
    return name


def _joint(document, name: str, what: str) -> Element:
    wanted = document.coordinate(name, what)
    return next(element for element in document.root.iter("joint") if element.get("name") == wanted)


def _set(element: Element, attributes: dict):
    for key, value in attributes.items():
        element.set(key, value if isinstance(value, str) else " ".join(repr(float(x)) for x in np.atleast_1d(value)))


def _stiff(document, what: str = "") -> dict[str, str]:
    """Stiffness of equalities, for limits or pairs, damped so that nothing rebounds."""
    stiff = document.root.find("default/equality")
    time_constant = stiff.get("solref").split()[0]
    return {f"solref{what}": f"{time_constant} {DAMPING}", f"solimp{what}": stiff.get("solimp")}
