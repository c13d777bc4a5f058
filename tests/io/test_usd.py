"""USD files that the tests write: accelerations of the same scene written by hand, loops, drives, units."""

import numpy as np
import pytest

import gauss
from gauss.errors import FileError, NotImportedWarning
from gauss.io.mjcf.tree import joint_frame
from gauss.rotations import to_quaternion
from gauss.system import random_state
from tests.support.files import linear

pxr = pytest.importorskip("pxr")
from pxr import Gf, UsdPhysics  # noqa: E402

from tests.support.usd import SCENE_G, UsdWriter, chain  # noqa: E402

SAME = 1e-6  # relative: USD holds numbers of joints and masses in single precision


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
    writer = UsdWriter(tmp_path, length, mass)
    chain(writer, scale=scale)
    assert _accelerations(writer.load()) == pytest.approx(_accelerations(_by_hand()), rel=SAME)


def test_a_scene_starts_where_the_file_has_its_bodies(tmp_path):
    writer = UsdWriter(tmp_path)
    chain(writer, angle=0.7)
    system = gauss.compile_scene(writer.load())
    state = system.initial_state()
    assert state.q[system.joint("h").q] == pytest.approx([0.7], rel=SAME)
    assert state.q[system.joint("s").q] == pytest.approx([0.0], abs=SAME)
    assert _accelerations(writer.load()) == pytest.approx(_accelerations(_by_hand()), rel=SAME)


def test_limits_and_drives_are_read_in_degrees(tmp_path):
    writer = UsdWriter(tmp_path)
    slide = chain(writer)
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
    writer = UsdWriter(tmp_path)
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
    writer = UsdWriter(tmp_path)
    writer.body("a", 1.0, (0.1, 0.1, 0.1), (0, 0, 0), (0, 0, 0))
    joint = writer.joint(UsdPhysics.Joint, "j", "", "a")
    for freedom in ("transX", "transY", "transZ", "rotX", "rotY", "rotZ"):
        if freedom not in D6[kind]:
            limit = UsdPhysics.LimitAPI.Apply(joint.GetPrim(), freedom)
            limit.CreateLowAttr(1.0)
            limit.CreateHighAttr(-1.0)
    assert writer.load().joints["j"].kind == kind


def test_a_body_without_joints_floats_and_colliders_are_named(tmp_path):
    writer = UsdWriter(tmp_path)
    prim = writer.body("a", 1.0, (0.1, 0.1, 0.1), (0, 0, 0), (1, 2, 3))
    UsdPhysics.CollisionAPI.Apply(prim.GetPrim())
    with pytest.warns(NotImportedWarning, match="contacts of a"):
        scene = writer.load()
    assert scene.joints["a floats"].kind == "free"


def test_limits_of_cones_and_of_several_freedoms_are_named(tmp_path):
    """A cone of 40°, a plane within 1 m; cones that do not limit, and the range of a hinge, which is read, are not."""
    writer = UsdWriter(tmp_path)
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


def test_locks_of_no_width_are_locks(tmp_path):
    """Limits that are both zero leave no freedom; those at another value have no counterpart."""
    writer = UsdWriter(tmp_path)
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
    writer = UsdWriter(tmp_path, *((1.0, 1.0) if seed % 2 else (0.01, 0.001)))
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
