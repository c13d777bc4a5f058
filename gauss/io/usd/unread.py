"""What a USD stage holds besides what is read: refused where it moves the mechanism, else named.

USD shows types and schemas that no plugin registers, as those of PhysX, Newton and MuJoCo, by their names only.
"""

from collections.abc import Iterable
from math import inf

import numpy as np

from gauss.errors import FileError, extra, listed
from gauss.io.usd.bodies import moving_prims
from gauss.io.usd.joints import unread_limits
from gauss.io.usd.poses import number

with extra("usd"):
    from pxr import Usd, UsdGeom, UsdPhysics

READ = ("physics:", "drive:", "limit:", "xformOp")  # namespaces of the attributes of bodies and joints
HARMLESS = ("primvars:", "userProperties:", "ui:", "material:", "visibility")
MOVING_TYPES = ("Joint", "Tendon", "Gear", "Mimic", "Equality", "Actuator")  # words in types that plugins define
MOVING_APIS = ("Mimic", "Tendon", "Gear", "RackAndPinion", "Equality", "Actuator")
MOVING = {  # attributes that are refused where they are not zero
    f"{space}:{name}"
    for space, names in {
        "physxJoint": ("armature", "jointFriction"),
        "physxRigidBody": ("disableGravity", "lockedPosAxis", "lockedRotAxis"),
        "newton": ("armature", "friction"),
        "mjc": ("armature", "damping", "frictionloss", "stiffness", "gravcomp"),
    }.items()
    for name in names
}


def refuse_unread(stage: Usd.Stage, bodies: Iterable[Usd.Prim]):
    """Refuse what moves the mechanism and has no counterpart in UsdPhysics, and numbers that change with time.

    FileError naming the prim, and what it holds.
    """
    for prim in moving_prims(stage):
        if not prim.IsA(UsdPhysics.Joint) and _may_move(prim):
            raise FileError(f"{prim.GetPath()}: a prim of type {prim.GetTypeName()} is not modelled.")
    for prim in (*bodies, *enabled_joints(stage), *physics_scenes(stage)):
        if bad := _moving(prim):
            raise FileError(f"{prim.GetPath()}: {', '.join(bad)} is not modelled.")
        for name in _sampled(prim):
            raise FileError(f"{prim.GetPath()}: {name} changes with time; write one value without time.")


def unread(stage: Usd.Stage, bodies: Iterable[Usd.Prim]) -> list[str]:
    """What is not read and may change the motion, in words."""
    bodies, joints = list(bodies), enabled_joints(stage)
    words = [f"{what} {listed(names)}" for what, names in _of_physics(stage, bodies, joints).items() if names]
    words += _of_layers(stage)
    foreign: dict[str, list[str]] = {}
    for prim in (*bodies, *joints, *physics_scenes(stage)):
        for name in filter(_is_foreign, map(str, prim.GetAuthoredPropertyNames())):
            foreign.setdefault(name, []).append(prim.GetName())
    return words + [f"{name} of {listed(names)}" for name, names in sorted(foreign.items())]


def _of_physics(stage: Usd.Stage, bodies: list[Usd.Prim], joints: list[Usd.Prim]) -> dict[str, list[str]]:
    """Names of the prims whose values of UsdPhysics are not read, by what these are."""
    contacts = [prim.GetName() for prim in moving_prims(stage) if prim.HasAPI(UsdPhysics.CollisionAPI)]
    limits = [f"{prim.GetName()} ({', '.join(names)})" for prim in joints if (names := unread_limits(prim))]
    moving = [prim.GetName() for prim in bodies if _has_velocity(prim)]
    asleep = [prim.GetName() for prim in bodies if UsdPhysics.RigidBodyAPI(prim).GetStartsAsleepAttr().Get()]
    broken = [prim.GetName() for prim in joints if _breaks(prim)]
    return {
        "contacts of": contacts,
        "limits of": limits,
        "velocities at the start of": moving,
        "sleep at the start of": asleep,
        "forces that break": broken,
    }


def _of_layers(stage: Usd.Stage) -> list[str]:
    """Units and axes of layers that are others than those of the stage, which USD does not convert."""
    own = {
        "metersPerUnit": UsdGeom.GetStageMetersPerUnit(stage),
        "kilogramsPerUnit": UsdPhysics.GetStageKilogramsPerUnit(stage),
        "upAxis": UsdGeom.GetStageUpAxis(stage),
    }
    words = []
    for layer in stage.GetUsedLayers():
        given = {name: layer.pseudoRoot.GetInfo(name) for name in own if layer.pseudoRoot.HasInfo(name)}
        other = [f"{name} {value}, {own[name]} in the stage" for name, value in given.items() if value != own[name]]
        if other:
            words.append(f"units of layer {layer.GetDisplayName()!r} ({'; '.join(other)}: its numbers count as the stage's)")
    return sorted(words)


def _moving(prim: Usd.Prim) -> list[str]:
    """Schemas and attributes of a prim that are refused."""
    applied = map(str, prim.GetPrimTypeInfo().GetAppliedAPISchemas())  # those without a plugin, too
    found = [name for name in applied if any(word in name for word in MOVING_APIS)]
    return found + [name for name in sorted(MOVING) if prim.HasAttribute(name) and np.any(prim.GetAttribute(name).Get())]


def _sampled(prim: Usd.Prim) -> list[str]:
    """Attributes of a prim that are read and have values at times."""
    authored = prim.GetAuthoredAttributes()
    return [one.GetName() for one in authored if one.GetName().startswith(READ) and one.GetNumTimeSamples()]


def _is_foreign(name: str) -> bool:
    """Whether a property is of another program."""
    return ":" in name and not name.startswith((*READ, *HARMLESS))


def enabled_joints(stage: Usd.Stage) -> list[Usd.Prim]:
    """Joints that are switched on."""
    prims = [prim for prim in moving_prims(stage) if prim.IsA(UsdPhysics.Joint)]
    return [prim for prim in prims if UsdPhysics.Joint(prim).GetJointEnabledAttr().Get()]


def physics_scenes(stage: Usd.Stage) -> list[Usd.Prim]:
    """Prims that give gravity."""
    return [prim for prim in moving_prims(stage) if prim.IsA(UsdPhysics.Scene)]


def _may_move(prim: Usd.Prim) -> bool:
    """Whether a prim is of a type that no plugin defines, which may be a joint, or binds bodies as one does."""
    if any(prim.GetRelationship(f"physics:body{side}") for side in "01"):
        return True
    unknown = prim.GetTypeName() and not prim.GetPrimTypeInfo().GetSchemaTypeName()
    return bool(unknown) and any(word in str(prim.GetTypeName()) for word in MOVING_TYPES)


def _has_velocity(prim: Usd.Prim) -> bool:
    api = UsdPhysics.RigidBodyAPI(prim)
    return bool(np.any(api.GetVelocityAttr().Get()) or np.any(api.GetAngularVelocityAttr().Get()))


def _breaks(prim: Usd.Prim) -> bool:
    joint = UsdPhysics.Joint(prim)
    return min(number(prim, one, inf) for one in (joint.GetBreakForceAttr(), joint.GetBreakTorqueAttr())) < inf
