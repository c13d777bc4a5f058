"""USD files that are wrong, or hold what is not read: refused or named."""

import warnings

import numpy as np
import pytest

import gauss
from gauss.errors import FileError, NotImportedWarning

pytest.importorskip("pxr")
from pxr import Gf, Sdf, UsdGeom, UsdPhysics  # noqa: E402

from tests.support.usd import UsdWriter, chain  # noqa: E402

DRIVE = "drive:angular:physics:"


def _without_mass(writer):
    UsdPhysics.MassAPI.Get(writer.stage, "/robot/a").GetMassAttr().Set(0.0)


def _kinematic(writer):
    UsdPhysics.RigidBodyAPI.Get(writer.stage, "/robot/a").CreateKinematicEnabledAttr(True)


def _elsewhere(writer):
    (writer.path.parent.parent / "other.usda").write_text("#usda 1.0\n")
    writer.stage.GetPrimAtPath("/robot").GetReferences().AddReference("../other.usda")


def _armature(writer):
    prim = writer.stage.GetPrimAtPath("/robot/h")
    prim.CreateAttribute("physxJoint:armature", Sdf.ValueTypeNames.Float).Set(0.1)


def _apart(writer):
    UsdGeom.Xform.Get(writer.stage, "/robot/b").GetPrim().GetAttribute("xformOp:translate").Set(Gf.Vec3d(1, 0.2, 0))


def _acceleration_drive(writer):
    drive = UsdPhysics.DriveAPI.Apply(writer.stage.GetPrimAtPath("/robot/h"), "angular")
    drive.CreateTypeAttr("acceleration")


def _two_freedoms(writer):
    joint = writer.joint(UsdPhysics.Joint, "j", "a", "b")
    for freedom in ("transX", "transY", "transZ", "rotX"):
        limit = UsdPhysics.LimitAPI.Apply(joint.GetPrim(), freedom)
        limit.CreateLowAttr(1.0)
        limit.CreateHighAttr(-1.0)


def _huge(writer):
    UsdGeom.Xform.Get(writer.stage, "/robot/a").GetPrim().GetAttribute("xformOp:translate").Set(Gf.Vec3d(1e300, 0, 0))


def _onto_itself(writer):
    writer.joint(UsdPhysics.FixedJoint, "j", "a", "a")


def _prim(name: str):
    """Make a function of the writer from one of the prim of this name, or of the stage."""
    return lambda spoil: lambda writer: spoil(writer.stage.GetPrimAtPath(name) if name else writer.stage)


def _given(name: str, attribute: str, value, kind=None):
    """A writer gives an attribute; of a type of its own where UsdPhysics does not define it."""

    def spoil(prim):
        known = prim.GetAttribute(attribute)
        (known or prim.CreateAttribute(attribute, kind or Sdf.ValueTypeNames.Float)).Set(value)

    return _prim(name)(spoil)


def _sampled(name: str, attribute: str, value):
    """A writer gives an attribute one value at one time, and none without."""

    def spoil(prim):
        found = prim.GetAttribute(attribute) or prim.CreateAttribute(attribute, Sdf.ValueTypeNames.Float)
        found.Clear()
        found.Set(value, 0.0)

    return _prim(name)(spoil)


def _of_plugin(schema: str):
    """A writer applies a schema of a plugin that is not there."""

    def spoil(prim):
        applied = Sdf.TokenListOp()
        applied.prependedItems = ["PhysicsRigidBodyAPI", "PhysicsMassAPI", schema]
        prim.SetMetadata("apiSchemas", applied)

    return spoil


def _typed(kind: str, relation: str = ""):
    """A writer adds a prim of a type that no plugin defines."""

    def spoil(stage):
        prim = stage.DefinePrim("/robot/extra", kind)
        if relation:
            prim.CreateRelationship(relation).SetTargets([Sdf.Path("/robot/a")])

    return spoil


def _drive(name: str, kind: str, **values):
    """A writer adds a drive."""

    def spoil(prim):
        drive = UsdPhysics.DriveAPI.Apply(prim, kind)
        for key, value in ({"Stiffness": 1.0} | values).items():
            getattr(drive, f"Create{key}Attr")(value)

    return _prim(name)(spoil)


def _collider_without_centre(writer):
    sphere = UsdGeom.Sphere.Define(writer.stage, "/robot/a/hull")
    UsdPhysics.CollisionAPI.Apply(sphere.GetPrim())
    UsdPhysics.MassAPI.Get(writer.stage, "/robot/a").GetCenterOfMassAttr().Clear()


def _second_scene(stage):
    UsdPhysics.Scene.Define(stage, "/moon").CreateGravityMagnitudeAttr(1.62)


SCALES = (Gf.Vec3f(-1, 1, 1), Gf.Vec3f(0, 1, 1), Gf.Vec3f(float("nan"), 1, 1))
SCALE, ORIENT = "xformOp:scale", "xformOp:orient"
SILENT = {  # what would move otherwise than is read, without a word
    "a pose at one time": (_sampled("/robot/b", "xformOp:translate", Gf.Vec3d(1, 0, 0)), "translate changes with time"),
    "a target at one time": (
        lambda writer: [_drive("/robot/h", "angular")(writer), _sampled("/robot/h", DRIVE + "targetPosition", 30.0)(writer)],
        "targetPosition changes with time",
    ),
    "gravity at one time": (_sampled("/physics", "physics:gravityMagnitude", 3.0), "gravityMagnitude changes with time"),
    "a mirrored body": (_given("/robot/a", SCALE, SCALES[0]), "mirrors or shears"),
    "a flat body": (_given("/robot/a", SCALE, SCALES[1]), "scale"),
    "a scale that is none": (_given("/robot/a", SCALE, SCALES[2]), "scale"),
    "a long quaternion": (_given("/robot/a", ORIENT, Gf.Quatd(2, 0, 1, 0)), "length 1"),
    "a mimic joint of PhysX": (_prim("/robot/a")(_of_plugin("PhysxMimicJointAPI:rotZ")), "PhysxMimicJointAPI:rotZ"),
    "a tendon of PhysX": (_prim("/robot/a")(_of_plugin("PhysxTendonAxisAPI:x")), "PhysxTendonAxisAPI:x"),
    "a gear of PhysX": (_prim("")(_typed("PhysxPhysicsGearJoint", "physics:body0")), "PhysxPhysicsGearJoint"),
    "a joint of another name": (_prim("")(_typed("Binding", "physics:body1")), "Binding"),
    "an actuator of MuJoCo": (_prim("")(_typed("MjcActuator")), "MjcActuator"),
    "no gravity": (_given("/robot/a", "physxRigidBody:disableGravity", True, Sdf.ValueTypeNames.Bool), "disableGravity"),
    "a held axis": (_given("/robot/a", "physxRigidBody:lockedPosAxis", 3, Sdf.ValueTypeNames.Int), "lockedPosAxis"),
    "damping of MuJoCo": (_given("/robot/h", "mjc:damping", 3.0), "mjc:damping"),
    "a drive across the hinge": (_drive("/robot/h", "rotX"), "drive 'rotX'"),
    "a drive of another kind": (_drive("/robot/h", "linear"), "drive 'linear'"),
    "a drive that is none": (_drive("/robot/h", "angular", Damping=float("nan")), "expected a number"),
    "a force below zero": (_drive("/robot/h", "angular", MaxForce=-1.0), "largest force"),
    "a centre of colliders": (_collider_without_centre, "centerOfMass"),
    "two gravities": (_prim("")(_second_scene), "different gravity"),
    "gravity that is none": (_given("/physics", "physics:gravityMagnitude", float("nan")), "expected a number"),
    "no metres": (lambda writer: UsdGeom.SetStageMetersPerUnit(writer.stage, 0.0), "metersPerUnit"),
    "metres below zero": (lambda writer: UsdGeom.SetStageMetersPerUnit(writer.stage, -1.0), "metersPerUnit"),
    "no kilograms": (lambda writer: UsdPhysics.SetStageKilogramsPerUnit(writer.stage, 0.0), "kilogramsPerUnit"),
    "a force that is none": (_given("/robot/h", "physics:breakForce", float("nan")), "breakForce"),
}
MISTAKES = {
    **SILENT,
    "no mass": (_without_mass, "body 'a'.*MassAPI"),
    "a kinematic body": (_kinematic, "kinematic"),
    "a layer elsewhere": (_elsewhere, "root_folder"),
    "armature": (_armature, "physxJoint:armature"),
    "bodies apart from their joint": (_apart, "joint 's' do not stand"),
    "a drive of accelerations": (_acceleration_drive, "accelerations"),
    "two rotations": (_two_freedoms, "rotY, rotZ is not modelled"),
    "a huge number": (_huge, "finite numbers"),
    "a joint of one body": (_onto_itself, "to itself"),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_mistakes_are_told(tmp_path, name):
    writer, (spoil, words) = UsdWriter(tmp_path), MISTAKES[name]
    chain(writer)
    spoil(writer)
    with pytest.raises(FileError, match=words):
        writer.load()


def test_a_value_of_another_type_is_refused(tmp_path):
    writer = UsdWriter(tmp_path)
    chain(writer)
    writer.stage.Save()
    changed = tmp_path / "words.usda"
    changed.write_text(writer.path.read_text().replace("float physics:mass = 2", 'string[] physics:mass = ["heavy"]'))
    with pytest.raises(FileError, match="type of its schema"):
        gauss.load(changed)


@pytest.mark.parametrize("text", ["", "#usda 1.0\n(", "PXR-USDC" + "\0" * 100, "#usda 1.0\n"])
def test_files_that_hold_nothing_are_refused(tmp_path, text):
    path = tmp_path / "robot.usd"
    path.write_text(text)
    with pytest.raises(FileError):
        gauss.load(path)


NAMED = {  # what is not read, and may change the motion
    "velocities": (_given("/robot/a", "physics:angularVelocity", Gf.Vec3f(0, 30, 0)), "velocities at the start of a"),
    "sleep": (_given("/robot/b", "physics:startsAsleep", True), "sleep at the start of b"),
    "joints that break": (_given("/robot/h", "physics:breakForce", 3.0), "forces that break h"),
    "other programs": (_given("/robot/a", "physxRigidBody:angularDamping", 0.05), "physxRigidBody:angularDamping of a"),
}


@pytest.mark.parametrize("name", NAMED)
def test_what_may_change_the_motion_is_named(tmp_path, name):
    writer, (add, words) = UsdWriter(tmp_path), NAMED[name]
    chain(writer)
    add(writer)
    with pytest.warns(NotImportedWarning, match=words):
        writer.load()


def test_units_of_a_layer_that_the_stage_does_not_have_are_named(tmp_path):
    """USD composes numbers as they are: those of a layer in centimetres count as metres of the stage."""
    writer = UsdWriter(tmp_path)
    writer.body("a", 2.0, (0.1, 0.1, 0.1), (0, 0, 0), (0, 0, 0))
    writer.stage.Save()
    for unit, said in ((0.01, 1), (1.0, 0)):
        other = Sdf.Layer.CreateNew(str(tmp_path / f"in_{unit}.usda"))
        other.pseudoRoot.SetInfo("metersPerUnit", unit)
        other.Save()
        writer.stage.GetRootLayer().subLayerPaths = [f"./in_{unit}.usda"]
        with warnings.catch_warnings(record=True) as heard:
            warnings.simplefilter("always")
            writer.load()
        assert [f"in_{unit}.usda" in str(w.message) for w in heard] == [True] * said


def test_a_centre_of_mass_that_the_schema_takes_for_none_is_none(tmp_path):
    writer = UsdWriter(tmp_path)
    writer.body("a", 2.0, (0.1, 0.1, 0.1), (-np.inf,) * 3, (0, 0, 0))
    assert writer.load().bodies["a"].com == (0.0, 0.0, 0.0)
