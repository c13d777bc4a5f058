"""Ten public robots and every shipped scene through all formats: the same accelerations in gauss, Pinocchio and MuJoCo."""

import numpy as np
import pinocchio as pin
import pytest

import gauss
from gauss.errors import FileError
from gauss.io.catalog import families, shipped
from gauss.io.mjcf.write import to_mjcf
from gauss.io.urdf.robots import robot
from tests.support.files import linear, quietly
from tests.support.in_mujoco import GIVES_WAY, SOFT, differences, mujoco_run

SAME = 1e-9  # relative: exact engines, whose files hold all digits
FIXED = ["panda", "ur5", "kinova", "z1", "tiago"]
FREE = ["talos", "anymal", "hyq", "solo12", "go2"]
# What MuJoCo has no counterpart of.
REFUSED = {
    "box_on_plane_4": "MuJoCo has no points",
    "double_pendulum_stops": "MuJoCo has no restitution",
    "newtons_cradle": "MuJoCo has no restitution",
    "painleve_rod": "MuJoCo has no points",
    "planetary_gears": "gear 'sun mesh 1': MuJoCo has no counterpart",
    "rolling_disk": "'contact': MuJoCo has no counterpart",
}
# One-sided constraints and friction are soft in MuJoCo: motions are compared, and how long they are.
MOVING = {
    "block_on_incline": (0.3, {"integrator": "time_stepping", "step": 1e-2}),
    "box_on_plane_8": (0.2, {}),
    "friction_oscillator": (0.2, {}),
    "rolling_ball": (0.2, {"integrator": "time_stepping", "step": 1e-2}),
    "slack_rope": (0.2, {}),
}
CREEPS = 2 * GIVES_WAY  # MuJoCo's friction gives way while it slides: a block on an incline goes 3 % farther
EXACT = [name for name in [*shipped(), *families()] if name not in REFUSED and name not in MOVING]


def assert_alike(one, two):
    expected, found = linear(one), linear(two)
    assert expected.keys() <= found.keys()  # chains of hinges and slides have links without mass between them
    size = max(1.0, max(np.abs(a).max() for a in expected.values()))
    for name, a in expected.items():
        assert found[name] == pytest.approx(a, rel=SAME, abs=SAME * size)


@pytest.fixture(scope="module", params=[*FIXED, *FREE])
def public(request):
    """Name of a public robot, how its base is held, and its scene in a random state."""
    name, root = request.param, "free" if request.param in FREE else "fixed"
    scene = gauss.load(f"robot:{name}", root=root, mimic=False)
    rng = np.random.default_rng(0)
    for joint in scene.joints.values():
        if joint.pair.n_v == 1:
            scene.start(joint.name, float(rng.uniform(-0.5, 0.5)), float(rng.normal()))
    return name, root, scene


@pytest.mark.slow
@pytest.mark.peer
def test_robots_in_pinocchio(public):
    name, root, scene = public
    system = gauss.compile_scene(scene)
    state = system.initial_state()
    solution = gauss.solve(gauss.assemble(system, state))
    model = pin.buildModelFromUrdf(str(robot(name)), *((pin.JointModelFreeFlyer(),) if root == "free" else ()))
    q, v = pin.neutral(model), np.zeros(model.nv)
    for joint in system.joints:
        theirs = model.joints[model.getJointId(joint.name)]
        if joint.pair.n_v == 1:
            x = state.q[joint.q.start]
            q[theirs.idx_q : theirs.idx_q + theirs.nq] = x if theirs.nq == 1 else (np.cos(x), np.sin(x))
            v[theirs.idx_v] = state.v[joint.v.start]
    data = model.createData()
    pin.forwardKinematics(model, data, q, v, pin.aba(model, data, q, v, np.zeros(model.nv)))
    largest = np.abs(solution.a).max()
    for index, a in enumerate(solution.a.reshape(-1, 6)[:, 3:], start=1):
        lever = pin.SE3(np.eye(3), model.inertias[index].lever)
        motion, rate = (lever.actInv(part[index]) for part in (data.a, data.v))
        expected = data.oMi[index].rotation @ (motion.linear + np.cross(rate.angular, rate.linear))
        assert a == pytest.approx(expected, rel=SAME, abs=SAME * largest)


@pytest.mark.slow
@pytest.mark.peer
def test_robots_in_mujoco_and_back(public, tmp_path):
    poses, accelerations = differences(public[2], state=())
    assert poses < SAME and accelerations < SAME
    assert_alike(public[2], quietly(gauss.save(public[2], tmp_path / "robot.xml")))


@pytest.mark.slow
def test_robots_as_urdf_and_back(public, tmp_path):
    assert_alike(public[2], quietly(gauss.save(public[2], tmp_path / "robot.urdf")))


@pytest.mark.slow
@pytest.mark.peer
@pytest.mark.parametrize("name", EXACT)
def test_scenes_in_mujoco_and_back(name, tmp_path):
    scene = gauss.load(name)
    poses, accelerations = differences(scene, state=())
    assert poses < SAME and accelerations < SOFT
    assert_alike(scene, quietly(gauss.save(scene, tmp_path / "scene.xml")))


@pytest.mark.slow
@pytest.mark.peer
@pytest.mark.parametrize("name", MOVING)
def test_scenes_that_touch_move_about_alike_in_mujoco(name):
    duration, options = MOVING[name]
    scene = gauss.load(name)
    motion, data = gauss.simulate(scene, duration, **options), mujoco_run(scene, duration)
    for body in scene.bodies:
        own = motion.body(body)
        travelled = max(0.05, np.linalg.norm(own.com[-1] - own.com[0]))
        assert data.body(body).xipos == pytest.approx(own.com[-1], abs=CREEPS * travelled)


@pytest.mark.parametrize("name", REFUSED)
def test_scenes_that_mujoco_cannot_hold_are_refused_by_name(name):
    with pytest.raises(FileError, match=REFUSED[name]):
        to_mjcf(gauss.load(name))
