"""USD files that the tests write: accelerations of the same scene written by hand, loops, drives, units, refusals."""

import warnings

import numpy as np
import pytest

import gauss
from gauss.errors import FileError, NotImportedWarning
from gauss.io.mjcf.tree import joint_frame
from gauss.rotations import to_quaternion
from gauss.system import random_state
from tests.support.files import linear

pxr = pytest.importorskip("pxr")
from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics  # noqa: E402

SAME = 1e-6  # relative: USD holds numbers of joints and masses in single precision
SCENE_G = 9.81
DRIVE = "drive:angular:physics:"


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


NAMED = {  # what is not read, and may change the motion
    "velocities": (_given("/robot/a", "physics:angularVelocity", Gf.Vec3f(0, 30, 0)), "velocities at the start of a"),
    "sleep": (_given("/robot/b", "physics:startsAsleep", True), "sleep at the start of b"),
    "joints that break": (_given("/robot/h", "physics:breakForce", 3.0), "forces that break h"),
    "other programs": (_given("/robot/a", "physxRigidBody:angularDamping", 0.05), "physxRigidBody:angularDamping of a"),
}


@pytest.mark.parametrize("name", NAMED)
def test_what_may_change_the_motion_is_named(tmp_path, name):
    writer, (add, words) = _Writer(tmp_path), NAMED[name]
    _chain(writer)
    add(writer)
    with pytest.warns(NotImportedWarning, match=words):
        writer.load()


def test_locks_of_no_width_are_locks(tmp_path):
    """Limits that are both zero leave no freedom; those at another value have no counterpart."""
    writer = _Writer(tmp_path)
    writer.body("a", 1.0, (0.1, 0.1, 0.1), (0, 0, 0), (0, 0, 0))
    joint = writer.joint(UsdPhysics.Joint, "j", "", "a")
    limits = [UsdPhysics.LimitAPI.Apply(joint.GetPrim(), freedom) for freedom in D6["ball"] + ("transX", "transY")]
    for limit in limits:
        limit.CreateLowAttr(0.0)
        limit.CreateHighAttr(0.0)
    assert writer.load().joints["j"].kind == "prismatic"
    limits[0].CreateLowAttr(20.0)
    limits[0].CreateHighAttr(20.0)
    writer.stage.Save()
    with pytest.raises(FileError, match="held at 20"):
        gauss.load(writer.path)


KINDS = {  # kind of a joint, and how USD has it
    "revolute": UsdPhysics.RevoluteJoint,
    "prismatic": UsdPhysics.PrismaticJoint,
    "ball": UsdPhysics.SphericalJoint,
    "fixed": UsdPhysics.FixedJoint,
    "cylindrical": UsdPhysics.Joint,
}
TREES = 12


def _random_tree(rng) -> gauss.Scene:
    """Six bodies in skew poses on joints of all kinds, some of them named from the child to the parent."""
    scene = gauss.Scene("random", gravity=(0.0, 0.0, -SCENE_G))
    names = ["ground"]
    for name in "abcdef":
        x, y, z = rng.uniform(0.05, 0.5, 3)
        scene.body(
            name,
            rng.uniform(0.5, 2.0),
            (y + z, x + z, x + y),
            rng.normal(size=3),
            inertia_axes=rng.normal(size=3),
            position=rng.normal(size=3),
            rotation=rng.normal(size=3),
        )
        kind, other = rng.choice([*KINDS]), rng.choice(names)
        ends = (other, name) if rng.random() < 0.5 else (name, other)
        axis = {} if kind in ("ball", "fixed") else {"axis": rng.normal(size=3)}
        scene.joint(f"on {name}", kind, *ends, at=rng.normal(size=3), **axis)
        names.append(name)
    return scene


def _written(writer, system, state):
    """Bodies of a tree in the poses of a state, and its joints by their frames in both bodies."""
    motion = gauss.Kinematics(system, state)
    for body in system.scene.bodies.values():
        R, (J, axes) = motion.rotation(body.name), body.principal()
        turned = to_quaternion(R)
        prim = writer.body(body.name, body.mass, J, body.com, motion.position(body.name), turned)
        api = UsdPhysics.MassAPI.Get(writer.stage, prim.GetPath())
        api.CreatePrincipalAxesAttr(Gf.Quatf(*map(float, to_quaternion(axes))))
    for joint in system.scene.joints.values():
        placed = {end: joint_frame(system, joint, end) if end != "ground" else None for end in (joint.parent, joint.child)}
        if "ground" in placed:
            k = system.joint(joint.name)
            pose = (k.R_parent, k.p_parent) if joint.parent == "ground" else (k.R_child, k.p_child)
            placed["ground"] = pose
        name = joint.name.replace(" ", "_")
        found = writer.joint(
            KINDS[joint.kind],
            name,
            *("" if end == "ground" else end for end in placed),
            *(tuple(float(x) for x in p) for _, p in placed.values()),
            axis="Z" if joint.kind in ("revolute", "prismatic") else None,
        )
        for attribute, (R, _) in zip((found.CreateLocalRot0Attr, found.CreateLocalRot1Attr), placed.values(), strict=True):
            attribute(Gf.Quatf(*map(float, 3.0 * to_quaternion(R))))  # of any length
        if joint.kind == "cylindrical":
            for freedom in ("transX", "transY", "rotX", "rotY"):
                limit = UsdPhysics.LimitAPI.Apply(found.GetPrim(), freedom)
                limit.CreateLowAttr(1.0)
                limit.CreateHighAttr(-1.0)


@pytest.mark.parametrize("seed", range(TREES))
def test_random_trees_accelerate_as_those_they_were_written_from(tmp_path, seed):
    """Frames, starts, directions, units: the file holds poses in the world only."""
    rng = np.random.default_rng(seed)
    writer = _Writer(tmp_path, *((1.0, 1.0) if seed % 2 else (0.01, 0.001)))
    system = gauss.compile_scene(_random_tree(rng))
    state = random_state(system, rng, spread=0.5)
    still = gauss.State(0.0, state.q, 0.0 * state.v)
    _written(writer, system, still)
    wanted = gauss.solve(gauss.assemble(system, still)).a.reshape(-1, 6)[:, 3:]
    expected = dict(zip(system.structure.bodies, wanted, strict=True))
    found = linear(writer.load())
    size = max(np.abs(one).max() for one in expected.values())
    assert found.keys() == expected.keys()
    for body, acceleration in expected.items():
        assert found[body] == pytest.approx(acceleration, abs=10.0 * SAME * size)


def test_units_of_a_layer_that_the_stage_does_not_have_are_named(tmp_path):
    """USD composes numbers as they are: those of a layer in centimetres count as metres of the stage."""
    writer = _Writer(tmp_path)
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
    writer = _Writer(tmp_path)
    writer.body("a", 2.0, (0.1, 0.1, 0.1), (-np.inf,) * 3, (0, 0, 0))
    assert writer.load().bodies["a"].com == (0.0, 0.0, 0.0)
