"""The key frame "start" of a MuJoCo model as the start of a scene."""

import numpy as np

from gauss import rotations
from gauss.io.mjcf.names import SCALAR, Named
from gauss.scene import Scene

START = "start"


def add_start(scene: Scene, named: Named):
    """Start every joint where the key frame of this name has it, if there is one."""
    model = named.model
    key = next((i for i in range(model.nkey) if model.key(i).name == START), None)
    if key is None:
        return
    qpos, qvel, at_rest = model.key_qpos[key], model.key_qvel[key], model.qpos0
    for j, name in enumerate(named.joints):
        place, dof = model.jnt_qposadr[j], model.jnt_dofadr[j]
        if named.kinds[j] in SCALAR:
            scene.start(name, float(qpos[place] - at_rest[place]), float(qvel[dof]))
            continue
        free = named.kinds[j] == "free"
        moved = qpos[place : place + 3] - at_rest[place : place + 3] if free else np.zeros(0)
        Q, omega = qpos[place + 3 * free :][:4], qvel[dof + 3 * free :][:3]
        if free:  # MuJoCo turns from the axes of the world, and has ω along those of the body
            Q_0 = at_rest[place + 3 : place + 7]
            Q = rotations.multiply(Q, Q_0 * [1.0, -1.0, -1.0, -1.0])
            omega = rotations.from_quaternion(Q_0) @ omega
        along = qvel[dof : dof + 3 * free]
        scene.start(name, tuple(np.concatenate([moved, Q])), tuple(np.concatenate([along, omega])))
