"""A key frame of a MuJoCo model as the start of a scene: that which is asked for, else one called "start"."""

import numpy as np

from gauss import rotations
from gauss.errors import FileError, did_you_mean
from gauss.io.mjcf.actuators import actuators, state_name
from gauss.io.mjcf.names import SCALAR, Named
from gauss.scene import Scene

START = "start"


def key_of(named: Named, keyframe: str | int | None) -> int | None:
    """Number of the key frame of a name, or that is called "start"; None if none is asked for and there is none.

    FileError if there is no key frame of this name or number.
    """
    model = named.model
    names = [model.key(i).name for i in range(model.nkey)]
    wanted = START if keyframe is None else keyframe
    if wanted in names:
        return names.index(wanted)
    if isinstance(wanted, int) and 0 <= wanted < model.nkey:
        return wanted
    if keyframe is None:
        return None
    raise FileError(
        f"{named.source.path}: keyframe: no key frame {keyframe!r} among {len(names)}. {did_you_mean(str(keyframe), names)}"
    )


def add_start(scene: Scene, named: Named, keyframe: str | int | None = None):
    """Start every joint, and every activation, where a key frame has it, if there is one."""
    model, key = named.model, key_of(named, keyframe)
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
    for i in actuators(model):
        if state_name(model, i) in scene.states:
            scene.start(state_name(model, i), rate=float(model.key_act[key][int(model.actuator_actadr[i])]))
