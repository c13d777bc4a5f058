"""USD files that tests write; only tests that have ``usd-core`` import this."""

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics

import gauss

SCENE_G = 9.81


class UsdWriter:
    """Stage of a test, in metres and kilograms unless it says otherwise."""

    def __init__(self, folder, length=1.0, mass=1.0):
        self.path, self.length = folder / "robot.usda", length
        self.stage = Usd.Stage.CreateNew(str(self.path))
        UsdGeom.SetStageUpAxis(self.stage, UsdGeom.Tokens.z)
        UsdGeom.SetStageMetersPerUnit(self.stage, length)
        UsdPhysics.SetStageKilogramsPerUnit(self.stage, mass)
        physics = UsdPhysics.Scene.Define(self.stage, "/physics")
        physics.CreateGravityMagnitudeAttr(SCENE_G / length)
        UsdGeom.Xform.Define(self.stage, "/robot")

    def body(self, name, mass, inertia, com, at, turned=(1.0, 0.0, 0.0, 0.0), scale=1.0):
        prim = UsdGeom.Xform.Define(self.stage, f"/robot/{name}")
        prim.AddTranslateOp().Set(Gf.Vec3d(*(x / self.length for x in at)))
        prim.AddOrientOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Quatd(*turned))
        prim.AddScaleOp().Set(Gf.Vec3f(scale, scale, scale))
        UsdPhysics.RigidBodyAPI.Apply(prim.GetPrim())
        api = UsdPhysics.MassAPI.Apply(prim.GetPrim())
        units = UsdPhysics.GetStageKilogramsPerUnit(self.stage)
        api.CreateMassAttr(mass / units)
        api.CreateDiagonalInertiaAttr(Gf.Vec3f(*(x / units / self.length**2 for x in inertia)))
        api.CreateCenterOfMassAttr(Gf.Vec3f(*(x / self.length / scale for x in com)))
        return prim

    def joint(self, schema, name, one, other, at_one=(0, 0, 0), at_other=(0, 0, 0), axis=None, scales=(1.0, 1.0)):
        joint = schema.Define(self.stage, f"/robot/{name}")
        for relation, body in ((joint.CreateBody0Rel(), one), (joint.CreateBody1Rel(), other)):
            if body:
                relation.SetTargets([Sdf.Path(f"/robot/{body}")])
        joint.CreateLocalPos0Attr(Gf.Vec3f(*(x / self.length / scales[0] for x in at_one)))
        joint.CreateLocalPos1Attr(Gf.Vec3f(*(x / self.length / scales[1] for x in at_other)))
        if axis:
            joint.CreateAxisAttr(axis)
        return joint

    def load(self, **options):
        self.stage.Save()
        return gauss.load(self.path, **options)


def chain(writer, angle=0.0, scale=1.0):
    """Two links on a hinge and a slide."""
    half = np.cos(angle / 2), np.sin(angle / 2)
    place = (np.cos(angle), 0.0, -np.sin(angle))
    writer.body("a", 2.0, (0.1, 0.2, 0.3), (0.3, 0.1, 0.0), (0, 0, 0), (half[0], 0, half[1], 0), scale)
    writer.body("b", 1.5, (0.2, 0.1, 0.2), (0.0, 0.2, 0.1), place, (half[0], 0, half[1], 0))
    writer.joint(UsdPhysics.RevoluteJoint, "h", "", "a", axis="Y", scales=(1.0, scale))
    return writer.joint(UsdPhysics.PrismaticJoint, "s", "a", "b", (1.0, 0, 0), axis="X", scales=(scale, 1.0))
