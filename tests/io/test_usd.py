"""USD files that the tests write: accelerations of the same scene written by hand, loops, drives, units, refusals."""

import numpy as np
import pytest

import gauss
from gauss.errors import FileError, NotImportedWarning
from gauss.system import random_state

pxr = pytest.importorskip("pxr")
from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics  # noqa: E402

SAME = 1e-6  # relative: USD holds numbers of joints and masses in single precision
SCENE_G = 9.81


class _Writer:
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


def _chain(writer, angle=0.0, scale=1.0):
    """Two links on a hinge and a slide."""
    half = np.cos(angle / 2), np.sin(angle / 2)
    place = (np.cos(angle), 0.0, -np.sin(angle))
    writer.body("a", 2.0, (0.1, 0.2, 0.3), (0.3, 0.1, 0.0), (0, 0, 0), (half[0], 0, half[1], 0), scale)
    writer.body("b", 1.5, (0.2, 0.1, 0.2), (0.0, 0.2, 0.1), place, (half[0], 0, half[1], 0))
    writer.joint(UsdPhysics.RevoluteJoint, "h", "", "a", axis="Y", scales=(1.0, scale))
    return writer.joint(UsdPhysics.PrismaticJoint, "s", "a", "b", (1.0, 0, 0), axis="X", scales=(scale, 1.0))


def _by_hand() -> gauss.Scene:
    scene = gauss.Scene("hand", gravity=(0.0, 0.0, -SCENE_G))
    scene.body("a", 2.0, (0.1, 0.2, 0.3), (0.3, 0.1, 0.0))
    scene.body("b", 1.5, (0.2, 0.1, 0.2), (0.0, 0.2, 0.1), position=(1, 0, 0))
    scene.revolute("h", "ground", "a", axis=(0, 1, 0))
    scene.prismatic("s", "a", "b", at=(1, 0, 0), axis=(1, 0, 0))
    return scene


def _accelerations(scene, seed=0):
    system = gauss.compile_scene(scene)
    state = random_state(system, np.random.default_rng(seed))
    found = gauss.solve(gauss.assemble(system, state)).qdd
    return np.concatenate([found[system.joint(name).v] for name in ("h", "s")])


@pytest.mark.parametrize("length, mass", [(1.0, 1.0), (0.01, 0.001)], ids=["SI", "centimetres and grams"])
@pytest.mark.parametrize("scale", [1.0, 2.5])
def test_a_chain_accelerates_as_one_written_by_hand(tmp_path, length, mass, scale):
    writer = _Writer(tmp_path, length, mass)
    _chain(writer, scale=scale)
    assert _accelerations(writer.load()) == pytest.approx(_accelerations(_by_hand()), rel=SAME)


def test_a_scene_starts_where_the_file_has_its_bodies(tmp_path):
    writer = _Writer(tmp_path)
    _chain(writer, angle=0.7)
    system = gauss.compile_scene(writer.load())
    state = system.initial_state()
    assert state.q[system.joint("h").q] == pytest.approx([0.7], rel=SAME)
    assert state.q[system.joint("s").q] == pytest.approx([0.0], abs=SAME)
    assert _accelerations(writer.load()) == pytest.approx(_accelerations(_by_hand()), rel=SAME)


def test_limits_and_drives_are_read_in_degrees(tmp_path):
    writer = _Writer(tmp_path)
    slide = _chain(writer)
    slide.CreateLowerLimitAttr(-0.25)
    slide.CreateUpperLimitAttr(0.5)
    hinge = UsdPhysics.RevoluteJoint.Get(writer.stage, "/robot/h")
    hinge.CreateLowerLimitAttr(-90.0)
    hinge.CreateUpperLimitAttr(45.0)
    drive = UsdPhysics.DriveAPI.Apply(hinge.GetPrim(), "angular")
    drive.CreateStiffnessAttr(2.0)
    drive.CreateDampingAttr(0.5)
    drive.CreateTargetPositionAttr(30.0)
    scene = writer.load(limits="stops")
    assert scene.joints["h"].limits == pytest.approx((-np.pi / 2, np.pi / 4), rel=SAME) and len(scene.contacts) == 2
    assert scene.joints["s"].limits == pytest.approx((-0.25, 0.5), rel=SAME)
    hand = _by_hand()
    turns = np.degrees(1.0)
    hand.joint_spring("k", "h", stiffness=2.0 * turns, damping=0.5 * turns, rest=np.radians(30.0))
    scene.contacts.clear()
    assert _accelerations(scene) == pytest.approx(_accelerations(hand), rel=SAME)


def _four_bar(writer, excluded=True):
    """Four-bar that lies in the plane of x and z, with its last hinge apart from the tree."""
    for name, at in (("crank", (0, 0, 0)), ("coupler", (0, 0, 0.5)), ("rocker", (1, 0, 0))):
        writer.body(name, 1.0, (0.1, 0.1, 0.1), (0.1, 0, 0.2), at)
    writer.joint(UsdPhysics.RevoluteJoint, "A", "", "crank", axis="Y")
    writer.joint(UsdPhysics.RevoluteJoint, "B", "crank", "coupler", (0, 0, 0.5), axis="Y")
    writer.joint(UsdPhysics.RevoluteJoint, "D", "", "rocker", (1, 0, 0), axis="Y")
    last = writer.joint(UsdPhysics.RevoluteJoint, "C", "coupler", "rocker", (1, 0, 0.25), (0, 0, 0.75), axis="Y")
    last.CreateExcludeFromArticulationAttr(excluded)


@pytest.mark.parametrize("excluded", [True, False])
def test_a_joint_beside_the_articulation_closes_a_loop(tmp_path, excluded):
    writer = _Writer(tmp_path)
    _four_bar(writer, excluded)
    hand = gauss.Scene("hand", gravity=(0.0, 0.0, -SCENE_G))
    for name, at in (("crank", (0, 0, 0)), ("coupler", (0, 0, 0.5)), ("rocker", (1, 0, 0))):
        hand.body(name, 1.0, (0.1, 0.1, 0.1), (0.1, 0, 0.2), position=at)
    for name, one, other, at in (
        ("A", "ground", "crank", (0, 0, 0)),
        ("B", "crank", "coupler", (0, 0, 0.5)),
        ("D", "ground", "rocker", (1, 0, 0)),
        ("C", "coupler", "rocker", (1, 0, 0.75)),
    ):
        hand.revolute(name, one, other, at=at, axis=(0, 1, 0))
    moved = [gauss.simulate(scene, 0.4) for scene in (writer.load(), hand)]
    found, expected = (one.q[-1, one.system.joint("A").q] for one in moved)
    assert found == pytest.approx(expected, rel=1e-5)


D6 = {  # freedoms that are left, and the kind
    "fixed": (),
    "revolute": ("rotY",),
    "prismatic": ("transZ",),
    "ball": ("rotX", "rotY", "rotZ"),
    "cylindrical": ("transX", "rotX"),
    "planar": ("transX", "transY", "rotZ"),
}


@pytest.mark.parametrize("kind", D6)
def test_joints_of_six_freedoms_are_read_by_those_they_leave(tmp_path, kind):
    writer = _Writer(tmp_path)
    writer.body("a", 1.0, (0.1, 0.1, 0.1), (0, 0, 0), (0, 0, 0))
    joint = writer.joint(UsdPhysics.Joint, "j", "", "a")
    for freedom in ("transX", "transY", "transZ", "rotX", "rotY", "rotZ"):
        if freedom not in D6[kind]:
            limit = UsdPhysics.LimitAPI.Apply(joint.GetPrim(), freedom)
            limit.CreateLowAttr(1.0)
            limit.CreateHighAttr(-1.0)
    assert writer.load().joints["j"].kind == kind


def test_a_body_without_joints_floats_and_colliders_are_named(tmp_path):
    writer = _Writer(tmp_path)
    prim = writer.body("a", 1.0, (0.1, 0.1, 0.1), (0, 0, 0), (1, 2, 3))
    UsdPhysics.CollisionAPI.Apply(prim.GetPrim())
    with pytest.warns(NotImportedWarning, match="contacts of a"):
        scene = writer.load()
    assert scene.joints["a floats"].kind == "free"


def test_limits_of_cones_and_of_several_freedoms_are_named(tmp_path):
    """A cone of 40°, a plane within 1 m; cones that do not limit, and the range of a hinge, which is read, are not."""
    writer = _Writer(tmp_path)
    for name in "abcd":
        writer.body(name, 1.0, (0.1, 0.1, 0.1), (0, 0, 0), (0, 0, 0))
    cone = writer.joint(UsdPhysics.SphericalJoint, "cone", "", "a")
    cone.CreateConeAngle0LimitAttr(40.0)
    cone.CreateConeAngle1LimitAttr(-1.0)
    writer.joint(UsdPhysics.SphericalJoint, "wide", "", "b")
    for name, body in (("plane", "c"), ("hinge", "d")):
        joint = writer.joint(UsdPhysics.Joint, name, "", body)
        for freedom in ("transX", "transY", "transZ", "rotX", "rotY", "rotZ"):
            if freedom not in (D6["planar"] if name == "plane" else D6["revolute"]):
                limit = UsdPhysics.LimitAPI.Apply(joint.GetPrim(), freedom)
                limit.CreateLowAttr(1.0)
                limit.CreateHighAttr(-1.0)
    for joint, freedom in (("plane", "transX"), ("hinge", "rotY")):
        limit = UsdPhysics.LimitAPI.Apply(writer.stage.GetPrimAtPath(f"/robot/{joint}"), freedom)
        limit.CreateLowAttr(-1.0)
        limit.CreateHighAttr(1.0)
    with pytest.warns(NotImportedWarning) as caught:
        writer.load()
    (message,) = (str(one.message) for one in caught)
    named = ("cone (physics:coneAngle0Limit)", "plane (limit:transX)")
    assert all(part in message for part in named) and not any(part in message for part in ("wide", "hinge"))


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


MISTAKES = {
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
    writer, (spoil, words) = _Writer(tmp_path), MISTAKES[name]
    _chain(writer)
    spoil(writer)
    with pytest.raises(FileError, match=words):
        writer.load()


def test_a_value_of_another_type_is_refused(tmp_path):
    writer = _Writer(tmp_path)
    _chain(writer)
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
