"""Scenes of USD files: rigid bodies, joints, drives and limits of UsdPhysics, with their loops.

The joints of the tree place the bodies: a coordinate is zero where the frames of its joint coincide, as in the file, and the
scene starts where the file shows its bodies. Joints that the file excludes from its articulation, and those that close loops
besides, are loops. Colliders are not read.
"""

import warnings
from math import degrees, inf
from pathlib import Path

import numpy as np

from gauss import math
from gauss.errors import FileError, NotImportedWarning, SceneError, extra
from gauss.io.numbers import LIMITS, check_option
from gauss.io.usd.bodies import add_body, colliding, rigid_bodies
from gauss.io.usd.guard import opened_stage
from gauss.io.usd.joints import UsdJoint, freedom_range, is_locked, joints_of
from gauss.io.usd.poses import GROUND_POSE, FramePose, StageUnits, checked, number
from gauss.io.usd.unread import physics_scenes, refuse_unread, unread
from gauss.rotations import to_quaternion
from gauss.scene import GROUND, Scene

with extra("usd"):
    from pxr import Tf, Usd, UsdGeom, UsdPhysics

# What bindings raise where an attribute holds a value of another type than UsdPhysics gives it, or a transform is none.
NOT_OF_SCHEMA = (Tf.ErrorException, TypeError, ValueError, KeyError)
FITS = 1e-4  # m, rad: to which bodies stand where their joint holds them; files have single precision
WEIGHT = 9.80665  # m/s², of a stage that says nothing


def read_usd(path, limits: str = "start", root_folder=None) -> Scene:
    """Scene of a USD file.

    FileError if it cannot be read, or holds what moves the mechanism and is not modelled; the message names it.

    Parameters
    ----------
    path : str or Path
        The file: .usda, .usdc or .usd; layers that it names must lie in its folder, or in ``root_folder``.
    limits : str
        "start": limits of joints are kept where a start is assembled; "stops": joints run against them, too.
    root_folder : str or Path, optional
        Folder in which layers may lie, beside that of the file.

    Warns
    -----
    NotImportedWarning
        Of colliders, limits of ball joints and planes, velocities at the start, forces that break joints, and attributes of
        other programs on bodies and joints, which are not read.
    """
    path = Path(path)
    check_option(path, "limits", limits, LIMITS)
    stage = opened_stage(path, root_folder)
    try:
        scene, not_read = _scene(stage, path.stem), unread(stage, rigid_bodies(stage).values())
        if limits == "stops":
            for name in [joint.name for joint in scene.joints.values() if joint.limits is not None]:
                scene.stop(name)
    except (FileError, SceneError) as error:
        raise FileError(f"{path}: {error}") from error
    except NOT_OF_SCHEMA as error:
        raise FileError(f"{path}: USD refuses it, or a value is not of the type of its schema: {error}") from error
    for left in not_read:
        warnings.warn(f"{path}: not read: {left}.", NotImportedWarning, stacklevel=2)
    return scene


def _scene(stage: Usd.Stage, name: str) -> Scene:
    units, bodies = StageUnits(stage), rigid_bodies(stage)
    if not bodies:
        raise FileError("no prim is a rigid body; apply RigidBodyAPI to those that move.")
    refuse_unread(stage, bodies.values())
    scene = Scene(name, gravity=_gravity(stage, units))
    joints = [joint for joint in joints_of(stage, bodies, units) if joint.kind != "free"]
    placed, tree = _placed(bodies, joints, units)
    with_colliders = colliding(stage, bodies)
    for body, pose in placed.items():
        if body != GROUND:
            add_body(scene, body, bodies[body], pose, units, body in with_colliders)
    for joint in joints:
        _add_joint(scene, joint, joint.name in tree)
        if joint.name in tree:
            _start(scene, joint, bodies, units)
        _add_drive(scene, joint, units)
    for body in _floating(bodies, joints, tree):
        scene.free(f"{body} floats", GROUND, body, at=tuple(placed[body].p))
    return scene


def _placed(bodies: dict, joints: list[UsdJoint], units: StageUnits) -> tuple[dict[str, FramePose], set[str]]:
    """Poses of bodies where all coordinates are zero, those of floating parts as in the file; joints of the tree."""
    placed, tree = {GROUND: GROUND_POSE}, set[str]()
    inner = [joint for joint in joints if not joint.is_loop]
    while len(placed) <= len(bodies):
        reached = next((joint for joint in inner if (joint.parent in placed) != (joint.child in placed)), None)
        if reached is None:
            root = next(body for body in bodies if body not in placed)
            placed[root] = units.pose(bodies[root])
            continue
        tree.add(reached.name)
        across = reached.parent_frame @ reached.child_frame.inverse
        if reached.parent in placed:
            placed[reached.child] = placed[reached.parent] @ across
        else:
            placed[reached.parent] = placed[reached.child] @ across.inverse
    return placed, tree


def _floating(bodies: dict, joints: list[UsdJoint], tree: set[str]) -> list[str]:
    """First body of each part that no joint of the tree binds to the ground."""
    found, seen = [], {GROUND}
    edges = [{joint.parent, joint.child} for joint in joints if joint.name in tree]
    for body in [GROUND, *bodies]:
        if body in seen and body != GROUND:
            continue
        if body != GROUND:
            found.append(body)
        waiting = [body]
        while waiting:
            here = waiting.pop()
            seen.add(here)
            waiting += [other for edge in edges if here in edge for other in edge - seen]
    return found


def _add_joint(scene: Scene, joint: UsdJoint, in_tree: bool):
    frame, other = joint.parent_frame, joint.child_frame
    options: dict = {"limits": joint.limits} if joint.limits is not None else {}
    if in_tree:
        base = "world" if joint.parent == GROUND else joint.parent
        if joint.kind == "ball":
            options["rotation"] = frame.R
        axis = tuple(frame.R @ joint.axis)
        scene.joint(joint.name, joint.kind, joint.parent, joint.child, at=tuple(frame.p), axis=axis, frame=base, **options)
        return
    names = []
    for side, body, pose in (("first", joint.parent, frame), ("second", joint.child, other)):
        names.append(scene.frame(f"{joint.name} {side}", body, pose.p, pose.R).name)
    scene.joint(
        joint.name, joint.kind, joint.parent, joint.child, axis=joint.axis, frame=names[0], child_frame=names[1], **options
    )


def _start(scene: Scene, joint: UsdJoint, bodies: dict, units: StageUnits):
    """Coordinate of a joint where the file has its bodies; FileError if its bodies do not stand where it holds them."""
    ends = [units.pose(bodies[body]) if body != GROUND else GROUND_POSE for body in (joint.parent, joint.child)]
    between = (ends[0] @ joint.parent_frame).inverse @ (ends[1] @ joint.child_frame)
    axis, left = np.array(joint.axis), np.concatenate([between.p, 0.5 * _vector(between.R)])
    if joint.kind == "revolute":
        angle = float(np.arctan2(axis @ _vector(between.R), np.trace(between.R) - 1.0))
        scene.start(joint.name, angle)
        left = np.concatenate([between.p, np.cross(axis, _vector(between.R)), between.R @ axis - axis])
    elif joint.kind == "prismatic":
        scene.start(joint.name, float(axis @ between.p))
        left = np.concatenate([np.cross(axis, between.p), _vector(between.R)])
    elif joint.kind == "ball":
        scene.start(joint.name, tuple(to_quaternion(between.R)))
        left = between.p
    elif joint.kind == "cylindrical":
        angle = float(np.arctan2(axis @ _vector(between.R), np.trace(between.R) - 1.0))
        scene.start(joint.name, (angle, float(axis @ between.p)))
        left = np.concatenate([np.cross(axis, between.p), np.cross(axis, _vector(between.R)), between.R @ axis - axis])
    if abs(left).max(initial=0.0) > FITS:
        raise FileError(f"{joint.prim.GetPath()}: the bodies of joint {joint.name!r} do not stand where it holds them.")


def _vector(R: np.ndarray) -> np.ndarray:
    """Axis of a rotation times twice the sine of its angle (3,)."""
    return np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])


def _add_drive(scene: Scene, joint: UsdJoint, units: StageUnits):
    """Force k (target − q) + d (target rate − q̇) of a drive, within its largest force."""
    _refuse_other_drives(joint)
    if not joint.drive or not joint.prim.HasAPI(UsdPhysics.DriveAPI, joint.drive):
        return
    drive, turns = UsdPhysics.DriveAPI(joint.prim, joint.drive), joint.kind == "revolute"
    if drive.GetTypeAttr().Get() != "force":
        raise FileError(f"{joint.prim.GetPath()}: its drive gives accelerations; only drives of type 'force' are modelled.")
    unit = 1.0 / degrees(1.0) if turns else units.length  # of coordinates
    force = units.mass * units.length * (units.length if turns else 1.0)  # of forces, for units of mass, length and second
    stiffness, damping, target, rate = (
        number(joint.prim, attribute)
        for attribute in (
            drive.GetStiffnessAttr(),
            drive.GetDampingAttr(),
            drive.GetTargetPositionAttr(),
            drive.GetTargetVelocityAttr(),
        )
    )
    largest = number(joint.prim, drive.GetMaxForceAttr(), inf)
    if largest < 0.0:
        raise FileError(f"{joint.prim.GetPath()}: its drive has a largest force of {largest}; expected one above zero.")
    k, d, q, v, most, name = (
        stiffness * force / unit,
        damping * force / unit,
        target * unit,
        rate * unit,
        largest * force,
        joint.name,
    )
    if not (k or d):
        return

    def effort(t, motion):
        found = k * (q - motion.coordinate(name)) + d * (v - motion.rate(name))
        return found if most == inf else math.clip(found, -most, most)

    scene.drive(name, torque=effort, name=f"drive of {name}")


def _refuse_other_drives(joint: UsdJoint):
    """Refuse drives along freedoms that are not read; those along locked ones do nothing."""
    applied = [str(name).partition(":") for name in joint.prim.GetAppliedSchemas()]
    for name in [name for schema, _, name in applied if schema == "PhysicsDriveAPI"]:
        drive = UsdPhysics.DriveAPI(joint.prim, name)
        acts = any(number(joint.prim, one) for one in (drive.GetStiffnessAttr(), drive.GetDampingAttr()))
        if name != joint.drive and acts and not is_locked(*freedom_range(joint.prim, name)):
            raise FileError(f"{joint.prim.GetPath()}: a drive {name!r} of a {joint.kind} joint is not modelled.")


def _gravity(stage: Usd.Stage, units: StageUnits) -> tuple[float, float, float]:
    """Gravity of the physics scene [m/s²]; down, where it says nothing."""
    up = {"X": (1.0, 0.0, 0.0), "Y": (0.0, 1.0, 0.0), "Z": (0.0, 0.0, 1.0)}[UsdGeom.GetStageUpAxis(stage)]
    direction = -np.array(up)
    found = [_gravity_of(prim, direction, units) for prim in physics_scenes(stage)]
    if any(not np.array_equal(one, found[0]) for one in found):
        raise FileError(f"{len(found)} physics scenes with different gravity; leave one of them.")
    x, y, z = map(float, found[0] if found else WEIGHT * direction)
    return x, y, z


def _gravity_of(prim: Usd.Prim, down: np.ndarray, units: StageUnits) -> np.ndarray:
    """Gravity (3,) of one physics scene [m/s²]."""
    api = UsdPhysics.Scene(prim)
    given = checked(prim, np.array(api.GetGravityDirectionAttr().Get(), dtype=float))
    size = number(prim, api.GetGravityMagnitudeAttr(), inf)
    if size == inf:
        raise FileError(f"{prim.GetPath()}: gravity is not finite.")
    return (given / np.linalg.norm(given) if given.any() else down) * (WEIGHT if size < 0.0 else size * units.length)
