"""Starts of a scene in the joints of its URDF file.

URDF has neither screws nor ball joints: the file closes them by loops that the scene has not, and the assembly of a start
would change joints that the scene leaves at their reference. So all joints of such a file are given the state of the scene.
"""

from collections.abc import Iterator

import numpy as np

from gauss.dynamics.kinematics import Kinematics, kinematics
from gauss.io.mjcf.tree import Limb
from gauss.rotations import to_quaternion
from gauss.scene import GROUND, Start
from gauss.system import System
from gauss.system.frames import relative


def whole_start(system: System, limbs: list[Limb], floating: dict[str, str]) -> Iterator[Start]:
    """Starts of all joints of a file.

    Parameters
    ----------
    system : System
        The scene, compiled.
    limbs : list of Limb
        Bodies of the tree.
    floating : dict of str to str
        Names of the joints of bodies that float in the file.
    """
    motion, kept = kinematics(system, system.initial_state()), set(system.scene.starts)
    for one in limbs:
        if one.body in floating:
            kept.add(one.joint.name)
            if floating[one.body] != one.joint.name:
                yield _start(floating[one.body], *_floating(motion, one))
        else:
            kept.discard(one.joint.name)
            yield from _of_chain(motion, one)
    yield from _of_joints(motion, kept)


def _of_chain(motion: Kinematics, one: Limb) -> Iterator[Start]:
    for step in one.steps:
        yield _start(step.name, step.position(motion), step.rate(motion))


def _of_joints(motion: Kinematics, names: set[str]) -> Iterator[Start]:
    """Starts of joints that are in the file as they are in the scene."""
    for joint in motion.system.joints:
        if joint.pair.n_v and joint.name in names:
            yield _start(joint.name, motion.state.q[joint.q], motion.state.v[joint.v])


def _floating(motion: Kinematics, one: Limb) -> tuple[np.ndarray, np.ndarray]:
    """Coordinates (7,) and rates (6,) of a body that floats, from its place on another in the reference configuration."""
    R0, p0 = relative(motion.system.scene, one.on, one.body)
    R, p, v, w = _motion_of(motion, one.body)
    R_on, p_on, v_on, w_on = _motion_of(motion, one.on)
    place, axes = R0.T @ (R_on.T @ (p - p_on) - p0), (R_on @ R0).T
    rate = np.concatenate([axes @ (v - v_on - np.cross(w_on, p - p_on)), R.T @ (w - w_on)])  # turning in its own axes
    return np.concatenate([place, to_quaternion(axes @ R)]), rate


def _motion_of(motion: Kinematics, body: str):
    """Rotation, place, velocity and angular velocity of a body frame in the world."""
    if body == GROUND:
        return np.eye(3), np.zeros(3), np.zeros(3), np.zeros(3)
    return motion.rotation(body), motion.position(body), motion.velocity(body), motion.angular_velocity(body)


def _start(name: str, position, rate) -> Start:
    parts = [np.atleast_1d(part).astype(float).tolist() for part in (position, rate)]
    position, rate = (tuple(part) if len(part) > 1 else part[0] for part in parts)
    return Start(name, position, rate)
