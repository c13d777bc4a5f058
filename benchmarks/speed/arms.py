"""The mechanisms of the contests, in gauss, Pinocchio and MuJoCo."""

from dataclasses import dataclass, replace

import mujoco
import numpy as np
import pinocchio as pin

import gauss
from gauss.analysis.crosscheck.pinocchio_ import twin
from gauss.io.mjcf.write import to_mjcf
from gauss.system import System, random_state

FINGERS = ("panda_finger_joint1", "panda_finger_joint2")


@dataclass(frozen=True)
class Arm:
    """A mechanism in gauss and in Pinocchio, with the same coordinates in the same order."""

    name: str
    system: System
    model: pin.Model


def panda() -> Arm:
    """Franka Panda with its fingers fixed: 7 joints."""
    free = gauss.load("robot:panda", mimic=False)
    scene = gauss.Scene(free.name, free.gravity)
    for body in free.bodies.values():
        scene.add(body)
    for joint in free.joints.values():
        fixed = {"kind": "fixed", "axis": (0.0, 0.0, 1.0)} if joint.name in FINGERS else {}
        scene.add(replace(joint, **fixed))
    return _arm("Panda (7 joints)", scene)


def talos() -> Arm:
    """Upper and lower body of the humanoid Talos on a fixed base: 32 joints."""
    return _arm("Talos (32 joints)", gauss.load("robot:talos"))


def chain(n: int) -> Arm:
    """Chain of bodies on hinges with random axes."""
    return _arm(f"chain of {n} links", gauss.load("spatial_chain", n=n))


def _arm(name: str, scene: gauss.Scene) -> Arm:
    system = gauss.compile_scene(scene)
    return Arm(name, system, twin(system).reduced)


def random_states(arm: Arm, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Coordinates, rates and efforts, one column for each state."""
    rng = np.random.default_rng(0)
    states = [random_state(arm.system, rng) for _ in range(count)]
    effort = rng.standard_normal((arm.system.n_v, count))
    return np.array([s.q for s in states]).T.copy(), np.array([s.v for s in states]).T.copy(), effort


def in_mujoco(arm: Arm, step: float) -> mujoco.MjModel:
    """MuJoCo's model of an arm without loops or loads, at its fastest: RK4, nothing computed that is not needed."""
    spec = mujoco.MjSpec.from_string(to_mjcf(arm.system.scene))
    spec.compiler.fusestatic = True
    model = spec.compile()
    model.opt.timestep, model.opt.integrator = step, mujoco.mjtIntegrator.mjINT_RK4
    for name, bit in mujoco.mjtDisableBit.__members__.items():
        if name.startswith("mjDSBL_") and name != "mjDSBL_GRAVITY":
            model.opt.disableflags |= int(bit)
    return model


def energy(arm: Arm, q, v) -> float:
    """Mechanical energy [J], by Pinocchio, whoever moved the arm."""
    data = arm.model.createData()
    return pin.computeMechanicalEnergy(arm.model, data, np.ascontiguousarray(q), np.ascontiguousarray(v))
