"""Sensors by every reader of outputs, against closed forms: a turntable, a compound pendulum, a body on a stop."""

import numpy as np
import pytest

import gauss
from gauss.rotations import from_rpy

pytestmark = pytest.mark.slow

ROUNDING = 1e-9  # relative, of a few steps; forces of joints come from certified multipliers
AT_REST = 1e-6  # of a contact problem, relative
STEP, STEPS, G = 1e-3, 40, 9.81
MOUNTED = (0.3, -0.2, 0.5)  # roll, pitch, yaw of a sensor [rad]


def turntable():
    """An arm that turns freely about a vertical axis: ω is constant, a = −ω² r."""
    scene = gauss.Scene("turntable", gravity=(0.0, 0.0, -G))
    scene.revolute("J", "ground", scene.body("arm", 2.0, (0.1, 0.2, 0.3), com=(0.4, 0.0, 0.0)), axis=(0, 0, 1))
    scene.frame("imu", "arm", (0.7, 0.2, 0.1), MOUNTED)
    scene.output("turning", "gyroscope", "imu")
    scene.output("felt", "accelerometer", "imu", at=(0.05, 0.0, 0.0))
    scene.output("accelerated", "acceleration", "arm", at=(0.5, 0.0, 0.0))
    scene.output("moved", "velocimeter", "imu")
    scene.output("forward", "y_axis", "arm")
    scene.output("mean", "center_of_mass", "arm")
    scene.output("mean speed", "center_of_mass_velocity", "ground")
    scene.output("spin", "angular_momentum", "arm")
    scene.output("still", "position", "arm", at=(1.0, 2.0, 3.0), relative_to="imu")
    scene.output("past", "velocity", "ground", at=(1.0, 0.0, 0.0), relative_to="arm")
    scene.output("free of weight", "proper_acceleration", "ground")
    scene.output("steady", "angular_acceleration", "arm")

    def expected(q, v):
        R, (omega,) = from_rpy(*MOUNTED), v
        place = np.array([0.7, 0.2, 0.1]) + R @ [0.05, 0.0, 0.0]
        inward = -(omega**2) * np.array([place[0], place[1], 0.0])
        outer = -(omega**2) * 0.5 * np.array([np.cos(q[0]), np.sin(q[0]), 0.0])
        c, s, mount = np.cos(q[0]), np.sin(q[0]), np.array([0.7, 0.2, 0.1])
        return {
            "turning": R.T @ [0.0, 0.0, omega],
            "felt": R.T @ (inward + [0.0, 0.0, G]),
            "accelerated": outer,
            "moved": R.T @ (omega * np.array([-mount[1], mount[0], 0.0])),
            "forward": [-s, c, 0.0],
            "mean": [0.4 * c, 0.4 * s, 0.0],
            "mean speed": 0.4 * omega * np.array([-s, c, 0.0]),
            "spin": [0.0, 0.0, 0.3 * omega],
            "still": R.T @ (np.array([1.0, 2.0, 3.0]) - mount),
            "past": -omega * np.array([s, c, 0.0]),
            "free of weight": [0.0, 0.0, G],
            "steady": np.zeros(3),
        }

    return scene, [0.3], [4.0], expected


def pendulum():
    """θ̈ = −m g d sin θ / J about the joint; the joint bears m (a − g) and no moment."""
    mass, d, inertia = 1.7, 0.6, 0.2
    scene = gauss.Scene("pendulum", gravity=(0.0, -G, 0.0))
    rod = scene.body("rod", mass, (0.1, 0.3, inertia), com=(0.0, -d, 0.0))
    scene.revolute("J", "ground", rod, axis=(0, 0, 1))
    scene.output("borne", "joint_force", "J")
    scene.output("moment", "joint_moment", "J")
    scene.output("felt", "accelerometer", "rod", at=(0.0, -d, 0.0))

    def expected(q, v):
        (theta,), (rate,) = q, v
        c, s = np.cos(theta), np.sin(theta)
        turning = -mass * G * d * s / (inertia + mass * d**2)
        a = d * turning * np.array([c, s, 0.0]) + d * rate**2 * np.array([-s, c, 0.0])
        felt = a + [0.0, G, 0.0]
        R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        return {"borne": mass * felt, "moment": np.zeros(3), "felt": R.T @ felt}

    return scene, [1.1], [2.0], expected


CASES = {"turntable": turntable, "pendulum": pendulum}


def by_simulator(system, q, v):
    sim = gauss.Simulator(system, STEP)
    sim.reset(gauss.State(0.0, q, v))
    sim.step(n=STEPS)
    return sim.state.q, sim.state.v, sim.outputs


def by_batch(system, q, v):
    many = gauss.SimulatorBatch(system, STEP, batch=3)
    many.reset(q=np.tile(q, (3, 1)), v=np.array([0.0, 1.0, -1.0])[:, None] * v)
    many.step(n=STEPS)
    return many.q[1], many.v[1], {name: values[1] for name, values in many.outputs.items()}


def by_motion(system, q, v):
    motion = gauss.simulate(system, STEP * STEPS, state=gauss.State(0.0, q, v), rtol=1e-10, progress=False)
    return motion.q[-1], motion.v[-1], {name: motion.output(name)[-1] for name in system.scene.outputs}


def by_rollout(system, q, v):
    found = gauss.rollout(system, np.tile(q, (5, 1)), np.tile(v, (5, 1)), steps=STEPS, step=STEP, every=STEPS)
    return found.q[3, -1], found.v[3, -1], {name: found.output(name)[3, -1] for name in system.scene.outputs}


READERS = [by_simulator, by_batch, by_motion, by_rollout]


@pytest.mark.parametrize("read", READERS)
@pytest.mark.parametrize("case", CASES)
def test_sensors_read_what_closed_forms_say(case, read):
    scene, q, v, expected = CASES[case]()
    system = gauss.compile_scene(scene)
    *reached, outputs = read(system, np.array(q), np.array(v))
    for name, value in expected(*reached).items():
        np.testing.assert_allclose(outputs[name], value, rtol=ROUNDING, atol=ROUNDING * G)


@pytest.mark.parametrize("read", [by_simulator, by_batch])
def test_a_stop_bears_the_weight_along_its_joint(read):
    mass, angle = 3.0, 0.4
    scene = gauss.Scene("slide", gravity=(0.0, 0.0, -G))
    axis = (np.cos(angle), 0.0, np.sin(angle))
    scene.prismatic("J", "ground", scene.body("box", mass, (0.1, 0.1, 0.1)), axis=axis)
    scene.stop("J", lowest=-0.01, name="S")
    scene.output("N", "contact_force", "S")
    *_, outputs = read(gauss.compile_scene(scene), np.array([-0.01]), np.zeros(1))
    assert outputs["N"].sum() == pytest.approx(mass * G * np.sin(angle), rel=AT_REST)
