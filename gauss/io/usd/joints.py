"""Joints of a USD stage: kind, axis, frames on both bodies, limits; D6 joints by the freedoms that they leave."""

from dataclasses import dataclass
from math import inf, radians

from gauss.errors import FileError, extra
from gauss.io.numbers import UNIT_VECTORS
from gauss.io.usd.bodies import body_of, moving_prims
from gauss.io.usd.poses import GROUND_POSE, FramePose, StageUnits, number
from gauss.scene import GROUND

with extra("usd"):
    from pxr import Usd, UsdPhysics

Axis = tuple[float, float, float]
FREEDOMS: tuple[str, ...] = tuple(f"{kind}{axis}" for kind in ("trans", "rot") for axis in UNIT_VECTORS)
PAIRS_OF: dict[tuple[str, ...], tuple[str, Axis]] = {  # kind and axis by the freedoms that a D6 joint leaves
    (): ("fixed", UNIT_VECTORS["Z"]),
    FREEDOMS: ("free", UNIT_VECTORS["Z"]),
    FREEDOMS[3:]: ("ball", UNIT_VECTORS["Z"]),
    **{(f"rot{name}",): ("revolute", axis) for name, axis in UNIT_VECTORS.items()},
    **{(f"trans{name}",): ("prismatic", axis) for name, axis in UNIT_VECTORS.items()},
    **{(f"trans{name}", f"rot{name}"): ("cylindrical", axis) for name, axis in UNIT_VECTORS.items()},
    ("transX", "transY", "rotZ"): ("planar", UNIT_VECTORS["Z"]),
    ("transX", "transZ", "rotY"): ("planar", UNIT_VECTORS["Y"]),
    ("transY", "transZ", "rotX"): ("planar", UNIT_VECTORS["X"]),
}


@dataclass(frozen=True)
class UsdJoint:
    """Joint between two bodies."""

    prim: Usd.Prim  # where the file has it
    name: str  # name, kind: name and kind, as of :class:`gauss.scene.Joint`; "free" holds nothing
    kind: str
    parent: str
    child: str
    parent_frame: FramePose
    child_frame: FramePose
    axis: Axis  # axis in these frames
    limits: tuple[float, float] | None  # least and largest coordinate [rad, m]
    is_loop: bool  # whether the file leaves it out of the tree
    drive: str = ""  # name of its drive in the file; empty where it can have none


def joints_of(stage: Usd.Stage, bodies: dict[str, Usd.Prim], units: StageUnits) -> list[UsdJoint]:
    """All joints that are switched on, by names of their own."""
    prims = [prim for prim in moving_prims(stage) if prim.IsA(UsdPhysics.Joint)]
    on = [prim for prim in prims if UsdPhysics.Joint(prim).GetJointEnabledAttr().Get()]
    names = [prim.GetName() for prim in on]
    taken = {name for name in names if names.count(name) > 1} | set(bodies)
    return [
        _joint(prim, str(prim.GetPath())[1:] if name in taken else name, bodies, units)
        for prim, name in zip(on, names, strict=True)
    ]


def _joint(prim: Usd.Prim, name: str, bodies: dict[str, Usd.Prim], units: StageUnits) -> UsdJoint:
    joint, kind_of = UsdPhysics.Joint(prim), _kind(prim, units)
    ends = []
    for bound, at, turned in (
        (joint.GetBody0Rel(), joint.GetLocalPos0Attr(), joint.GetLocalRot0Attr()),
        (joint.GetBody1Rel(), joint.GetLocalPos1Attr(), joint.GetLocalRot1Attr()),
    ):
        ends.append(_end(prim, bound.GetTargets(), at.Get(), turned.Get(), bodies, units))
    (parent, first), (child, second) = ends
    if parent == child:
        raise FileError(f"{prim.GetPath()}: joint {name!r} binds {parent!r} to itself.")
    kind, axis, limits, drive = kind_of
    is_loop = bool(joint.GetExcludeFromArticulationAttr().Get())
    return UsdJoint(prim, name, kind, parent, child, first, second, axis, limits, is_loop, drive)


def _end(joint: Usd.Prim, targets, at, turned, bodies: dict[str, Usd.Prim], units: StageUnits) -> tuple[str, FramePose]:
    """Body of one side of a joint, and the frame of the joint in it."""
    if len(targets) > 1:
        raise FileError(f"{joint.GetPath()}: a joint binds one body on each side, got {len(targets)}.")
    target = joint.GetStage().GetPrimAtPath(targets[0]) if targets else None
    if targets and not target:
        raise FileError(f"{joint.GetPath()}: it binds {targets[0]}, which does not exist.")
    prim = target or joint.GetStage().GetPseudoRoot()
    local, body = units.local(prim, at, turned), body_of(prim, bodies)
    placed = units.pose(bodies[body]) if body != GROUND else GROUND_POSE
    return body, placed.inverse @ units.pose(prim) @ local


def _kind(prim: Usd.Prim, units: StageUnits) -> tuple:
    """Kind, axis, limits and name of the drive."""
    if prim.IsA(UsdPhysics.FixedJoint):
        return "fixed", UNIT_VECTORS["Z"], None, ""
    if prim.IsA(UsdPhysics.SphericalJoint):
        return "ball", UNIT_VECTORS["Z"], None, ""
    for schema, kind, drive in (
        (UsdPhysics.RevoluteJoint, "revolute", "angular"),
        (UsdPhysics.PrismaticJoint, "prismatic", "linear"),
    ):
        if prim.IsA(schema):
            joint = schema(prim)
            low, high = number(prim, joint.GetLowerLimitAttr(), inf), number(prim, joint.GetUpperLimitAttr(), inf)
            return kind, UNIT_VECTORS[joint.GetAxisAttr().Get()], limits_of(prim, low, high, kind, units), drive
    if prim.GetTypeName() != "PhysicsJoint":
        raise FileError(f"{prim.GetPath()}: a joint of type {prim.GetTypeName()} is not modelled.")
    return _by_freedoms(prim, units)


def _by_freedoms(prim: Usd.Prim, units: StageUnits) -> tuple:
    """Kind of a D6 joint: a freedom whose lower limit is above the upper one, or where both are zero, is locked."""
    ranges = {freedom: freedom_range(prim, freedom) for freedom in FREEDOMS}
    for freedom, (low, high) in ranges.items():
        if low == high != 0.0:
            raise FileError(f"{prim.GetPath()}: {freedom} is held at {low}; turn or move a frame instead.")
    free = tuple(freedom for freedom, limits in ranges.items() if not is_locked(*limits))
    if free not in PAIRS_OF:
        raise FileError(f"{prim.GetPath()}: a D6 joint with the freedoms {', '.join(free)} is not modelled.")
    kind, axis = PAIRS_OF[free]
    if len(free) > 1 or not free:
        return kind, axis, None, ""
    return kind, axis, limits_of(prim, *ranges[free[0]], kind, units), free[0]


def freedom_range(prim: Usd.Prim, freedom: str) -> tuple[float, float]:
    """Lower and upper limit of a freedom of a joint, in units of the file; infinite without.

    FileError if one is not a number.
    """
    if not prim.HasAPI(UsdPhysics.LimitAPI, freedom):
        return -inf, inf
    limit = UsdPhysics.LimitAPI(prim, freedom)
    return number(prim, limit.GetLowAttr(), inf), number(prim, limit.GetHighAttr(), inf)


def is_locked(low: float, high: float) -> bool:
    """Whether limits lock a freedom: the lower one is above the upper one, or both are equal."""
    return not low < high


def unread_limits(prim: Usd.Prim) -> list[str]:
    """Names of the limits of a joint that are not read: cones of ball joints, ranges of several freedoms."""
    if prim.IsA(UsdPhysics.SphericalJoint):
        joint = UsdPhysics.SphericalJoint(prim)
        cones = joint.GetConeAngle0LimitAttr(), joint.GetConeAngle1LimitAttr()
        return [str(cone.GetName()) for cone in cones if 0.0 <= float(cone.Get()) < inf]  # negative: not limited
    return _unread_ranges(prim) if prim.GetTypeName() == "PhysicsJoint" else []


def _unread_ranges(prim: Usd.Prim) -> list[str]:
    """Names of the ranges of a D6 joint of several freedoms; that of a single freedom is read."""
    free = {name: limits for name in FREEDOMS if not is_locked(*(limits := freedom_range(prim, name)))}
    return [f"limit:{name}" for name, limits in free.items() if limits != (-inf, inf)] if len(free) > 1 else []


def limits_of(prim: Usd.Prim, low: float, high: float, kind: str, units: StageUnits) -> tuple[float, float] | None:
    """Limits of a joint of one freedom in rad or m; None where neither end is limited."""
    if low == -inf and high == inf:
        return None
    if not low < high:
        raise FileError(f"{prim.GetPath()}: expected the lower limit below the upper one, got {low} and {high}.")
    scale = radians(1.0) if kind == "revolute" else units.length
    return low * scale, high * scale
