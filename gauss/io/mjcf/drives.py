"""Actuators of a MuJoCo model, without control: constant efforts, and springs and dampers of what they regulate."""

import numpy as np

from gauss.io.mjcf.actuators import force_law, gear
from gauss.io.mjcf.names import Named
from gauss.io.mjcf.refused import TRANSMISSION
from gauss.io.mjcf.tendons import pull, terms
from gauss.rotations import from_quaternion
from gauss.scene import Scene


def add_actuator(scene: Scene, named: Named, i: int):
    """Loads of one actuator: its force is b₀ + b₁ l + b₂ l̇, with l the coordinate or length of the tendon times the gear."""
    model, name, first = named.model, named.name("actuator", i), int(named.model.actuator_trnid[i, 0])
    b = force_law(model, i).copy()
    limit = model.actuator_forcerange[i] if model.actuator_forcelimited[i] else None
    if limit is not None and not b[1:].any():
        b[0] = np.clip(b[0], *limit)
    on = int(model.actuator_trntype[i])
    if on == TRANSMISSION["SITE"]:
        _push(scene, named, i, name, float(b[0]))
        return
    ratio = float(gear(model, i)[0])
    constant, per_length, per_rate = ratio * b[0], ratio**2 * b[1], ratio**2 * b[2]
    if on == TRANSMISSION["TENDON"]:
        constant += per_length * model.tendon_length0[first]
        pull(scene, name, terms(named, first), float(constant), float(per_length), float(per_rate))
        return
    joint, at_rest = named.joints[first], float(model.qpos0[model.jnt_qposadr[first]])
    law = "torque" if named.kinds[first] == "revolute" else "force"
    if limit is None or not b[1:].any():
        scene.drive(joint, name=name, **{law: float(constant)})
        if b[1:].any():
            feedback = {"stiffness": -float(per_length), "damping": -float(per_rate), "rest": -at_rest}
            scene.joint_spring(f"feedback of {name}", joint, **feedback)
        return

    def effort(t, motion):
        return constant + per_length * (motion.coordinate(joint) + at_rest) + per_rate * motion.rate(joint)

    scene.drive(joint, name=name, **{law: effort}, limit=abs(ratio) * float(limit[1]))


def _push(scene: Scene, named: Named, i: int, name: str, effort: float):
    """Force and moment at a site, along its axes, or along those of a site of the ground."""
    model = named.model
    site, other = (int(k) for k in model.actuator_trnid[i])
    body = named.bodies[int(model.site_bodyid[site])]
    R = from_quaternion(model.site_quat[site if other < 0 else other])
    force, moment = (tuple(effort * R @ part) for part in np.split(gear(model, i), 2))
    axes = "body" if other < 0 else "world"
    scene.force(name, body, force, moment, at=tuple(model.site_pos[site]), axes=axes)
