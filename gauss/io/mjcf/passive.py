"""Passive forces of a MuJoCo model: springs, dampers and armature of ball and free joints, and gravity compensation.

    Q = −k log(Q₀⁻¹ Q) − d ω,   log (w, s) = 2 atan2(|s|, |w|) sgn(w) s / |s|

log is the vector of the rotation from the relaxed quaternion (MuJoCo's mju_subQuat); ω is in the axes of the body.
"""

from typing import Any

import numpy as np

from gauss import math, rotations
from gauss.io.mjcf.names import SCALAR, Named
from gauss.scene import GROUND, Body, Scene

TINY = 1e-30  # square of the sine of half an angle, below which its root is not taken: the angle is zero but for rounding


def add_passive(scene: Scene, named: Named, j: int):
    """Spring, damper and dry friction of a ball or free joint."""
    model, name, kind = named.model, named.joints[j], named.kinds[j]
    dof, place = model.jnt_dofadr[j], model.jnt_qposadr[j]
    if model.dof_frictionloss[dof] and kind not in SCALAR:
        for rate in scene.joints[name].pair.rates:
            scene.joint_friction(f"{name}.{rate}", float(model.dof_frictionloss[dof]))
    stiffness, damping = float(model.jnt_stiffness[j]), float(model.dof_damping[dof])
    if kind in SCALAR or not (stiffness or damping):
        return
    k = 3 * (kind == "free")
    rest, at_rest = model.qpos_spring[place:].copy(), model.qpos0[place:].copy()
    R_0 = rotations.from_quaternion(at_rest[3:7]) if k else np.eye(3)  # axes of the rates of a free joint, in the body
    relaxed, moved = rest[k : k + 4] * [1.0, -1.0, -1.0, -1.0], rest[:k] - at_rest[:k]

    def effort(t, motion):
        force = -damping * motion.rate(name)
        if not stiffness:
            return force
        q = motion.coordinate(name)
        Q = rotations.multiply(q[k:], at_rest[3:7]) if k else q
        turned = R_0 @ rotation_vector(rotations.multiply(relaxed, Q))
        return force - stiffness * np.concatenate([q[:k] - moved, turned])

    scene.drive(name, name=f"spring of {name}", torque=effort)


def rotation_vector(Q: np.ndarray) -> np.ndarray:
    """Axis times angle (3,) [rad], at most π, of a unit quaternion (w, x, y, z)."""
    w, along = Q[0], Q[1:]
    sine = np.sqrt(math.maximum(along @ along, TINY))
    return math.where(w < 0.0, -1.0, 1.0) * (2.0 * np.arctan2(sine, math.abs(w)) / sine) * along


def armature_of(named: Named, i: int) -> float:
    """Armature of the only joint of a body, if that is free, or a ball on the ground: it is inertia of the body then."""
    model, j = named.model, int(named.model.body_jntadr[i])
    if model.body_jntnum[i] != 1 or named.kinds[j] in SCALAR:
        return 0.0
    on_ground = model.body_weldid[model.body_parentid[i]] == 0
    return float(model.dof_armature[model.jnt_dofadr[j]]) if on_ground else 0.0


def with_armature(named: Named, body: Body, i: int) -> Body:
    """Body with the armature a of its free or ball joint: ½ a (|ṗ|² + |ω|²) of the velocity ṗ of its origin."""
    a = armature_of(named, i)
    if not a:
        return body
    J, R = body.principal()
    J = R @ np.diag(J) @ R.T + a * np.eye(3)
    com, mass = np.array(body.com), body.mass
    if named.kinds[int(named.model.body_jntadr[i])] == "free":
        reduced = mass * a / (mass + a)
        J += reduced * (com @ com * np.eye(3) - np.outer(com, com))
        com, mass = mass / (mass + a) * com, mass + a
    moments = (J[0, 0], J[1, 1], J[2, 2], J[0, 1], J[0, 2], J[1, 2])
    pose: dict[str, Any] = {"position": body.position, "rotation": body.rotation, "on": body.on}
    return Body(body.name, mass, tuple(map(float, moments)), tuple(com), **pose)


def add_ball_armature(scene: Scene, named: Named, j: int):
    """A rotor on the ground that turns with the angular velocity of a ball joint, of whose rates the armature is inertia."""
    model, name = named.model, named.joints[j]
    inertia = float(model.dof_armature[model.jnt_dofadr[j]])
    if not inertia or armature_of(named, int(model.jnt_bodyid[j])):
        return
    rotor, shaft = f"rotor of {name}", f"shaft of {name}"
    scene.body(rotor, 1.0, (inertia,) * 3)
    scene.ball(shaft, GROUND, rotor)
    scene.constrain(f"armature of {name}", velocity=lambda at: at.rate(shaft) - at.rate(name))


def add_compensation(scene: Scene, named: Named, i: int):
    """Forces against gravity: that which a body asks for, and that on the armature of a free joint, which has no weight."""
    model, name, gravity = named.model, named.bodies[i], np.array(scene.gravity)
    share, free = float(model.body_gravcomp[i]), model.body_jntnum[i] == 1 and named.kinds[model.body_jntadr[i]] == "free"
    if share and gravity.any():
        force = -share * float(model.body_mass[i]) * gravity
        scene.force(f"gravcomp of {name}", name, tuple(force), at=tuple(model.body_ipos[i]))
    if free and armature_of(named, i) and gravity.any():
        scene.force(
            f"no weight of the armature of {name}", name, tuple(-armature_of(named, i) * gravity), at=(0.0, 0.0, 0.0)
        )
