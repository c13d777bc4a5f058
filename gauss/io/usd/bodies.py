"""Rigid bodies of a USD stage: mass, centre of mass and moments of inertia as MassAPI gives them."""

import numpy as np

from gauss.errors import FileError, extra
from gauss.io.usd.poses import FramePose, StageUnits, checked, matrix, number
from gauss.scene import GROUND, Scene

with extra("usd"):
    from pxr import Usd, UsdPhysics


def rigid_bodies(stage: Usd.Stage) -> dict[str, Usd.Prim]:
    """Prims of rigid bodies by name: their own where it is the only one, else their path."""
    found = [prim for prim in moving_prims(stage) if prim.HasAPI(UsdPhysics.RigidBodyAPI) and _is_enabled(prim)]
    names = [prim.GetName() for prim in found]
    return {
        name if names.count(name) == 1 and name != GROUND else str(prim.GetPath())[1:]: prim
        for name, prim in zip(names, found, strict=True)
    }


def moving_prims(stage: Usd.Stage):
    """All prims, those of instances, too."""
    return Usd.PrimRange.Stage(stage, Usd.TraverseInstanceProxies())


def _is_enabled(prim: Usd.Prim) -> bool:
    body = UsdPhysics.RigidBodyAPI(prim)
    if body.GetKinematicEnabledAttr().Get():
        raise FileError(f"{prim.GetPath()}: a kinematic body moves as another program says; take its RigidBodyAPI away.")
    return bool(body.GetRigidBodyEnabledAttr().Get())


def body_of(prim: Usd.Prim, bodies: dict[str, Usd.Prim]) -> str:
    """Body that a prim belongs to: its own, or that of the nearest prim above it; the ground where there is none."""
    names = {body.GetPath(): name for name, body in bodies.items()}
    while prim and not prim.IsPseudoRoot():
        if prim.GetPath() in names:
            return names[prim.GetPath()]
        prim = prim.GetParent()
    return GROUND


def colliding(stage: Usd.Stage, bodies: dict[str, Usd.Prim]) -> set[str]:
    """Bodies with colliders."""
    return {body_of(prim, bodies) for prim in moving_prims(stage) if prim.HasAPI(UsdPhysics.CollisionAPI)}


def add_body(scene: Scene, name: str, prim: Usd.Prim, pose: FramePose, units: StageUnits, has_colliders: bool):
    """Body at a pose of the reference configuration."""
    api = UsdPhysics.MassAPI(prim)
    mass = number(prim, api.GetMassAttr())
    moments = np.array(api.GetDiagonalInertiaAttr().Get() or (0, 0, 0), dtype=float)
    if not prim.HasAPI(UsdPhysics.MassAPI) or mass <= 0.0 or not moments.any():
        raise FileError(
            f"{prim.GetPath()}: body {name!r}: physics:mass and physics:diagonalInertia are read, masses of colliders are "
            "not; write both with MassAPI."
        )
    own, given = units.pose(prim), api.GetCenterOfMassAttr()
    is_given = given.HasAuthoredValue() and not np.isneginf(given.Get()).all()  # the schema's word for none
    if not is_given and has_colliders:
        raise FileError(
            f"{prim.GetPath()}: body {name!r}: without physics:centerOfMass it is that of the colliders, whose masses are "
            "not read; write it with MassAPI."
        )
    com = own.R.T @ (units.point(prim, given.Get()) - own.p) if is_given else np.zeros(3)
    moments = checked(prim, moments) * units.mass * units.length**2
    options = {"inertia_axes": matrix(prim, api.GetPrincipalAxesAttr().Get()), "position": pose.p, "rotation": pose.R}
    scene.body(name, mass * units.mass, tuple(moments), tuple(com), **options)
