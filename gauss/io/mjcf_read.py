"""Scenes of MJCF files, read through MuJoCo's own compiler: bodies, joints, equalities, actuators, inertia from geometry.

What moves a mechanism and has no counterpart is refused by name; what does not move it by itself is named in a warning:
contacts of geoms, and limits, which are kept for the assembly of a start only.
"""

import warnings
from pathlib import Path

import mujoco
import numpy as np

from gauss import rotations
from gauss.errors import FileError, NotImportedWarning, SceneError
from gauss.io.mjcf_guard import guarded
from gauss.scene import GROUND, Body, Scene

KINDS = {
    mujoco.mjtJoint.mjJNT_HINGE: "revolute",
    mujoco.mjtJoint.mjJNT_SLIDE: "prismatic",
    mujoco.mjtJoint.mjJNT_BALL: "ball",
    mujoco.mjtJoint.mjJNT_FREE: "free",
}
SCALAR = ("revolute", "prismatic")
CONNECT, WELD, JOINT = (int(getattr(mujoco.mjtEq, f"mjEQ_{name}")) for name in ("CONNECT", "WELD", "JOINT"))
BODY = int(mujoco.mjtObj.mjOBJ_BODY)
ON_JOINT, STATELESS = int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtDyn.mjDYN_NONE)
NO_BIAS, AFFINE = int(mujoco.mjtBias.mjBIAS_NONE), int(mujoco.mjtBias.mjBIAS_AFFINE)
SAME = 1e-9  # m and rad: poses of a weld that are those of the file


def read_mjcf(path) -> Scene:
    """Scene of a MJCF file.

    A body of several joints hangs on bodies without mass in between. Coordinates count from the pose of the file, so that
    those of a joint with ``ref`` are smaller by it. An actuator is a drive, named like it, of the effort that it has
    without control; armature is a rotor on the ground that turns with its joint.

    Parameters
    ----------
    path : str or Path
        The file; files that it names must lie in its folder.

    Raises
    ------
    FileError
        If it cannot be parsed, or holds what moves the mechanism and is not modelled; all of that is named.

    Warns
    -----
    NotImportedWarning
        If geoms may touch, or joints are limited: contacts and stops are not read.
    """
    path = Path(path)
    guarded(path)
    try:
        model = mujoco.MjModel.from_xml_path(str(path))
    except (ValueError, RuntimeError) as error:
        raise FileError(f"{path}: MuJoCo refuses it: {error}") from error
    reader = _Reader(model)
    refused = reader.refused()
    if refused:
        raise FileError(f"{path}: not modelled: {'; '.join(refused)}. Remove them from the file, or model them in gauss.")
    try:
        scene = reader.scene(path.stem)
    except SceneError as error:
        raise FileError(f"{path}: {error}") from error
    left = reader.left_out()
    if left:
        warnings.warn(f"{path}: not read: {'; '.join(left)}.", NotImportedWarning, stacklevel=2)
    return scene


class _Reader:
    """One compiled model while it becomes a scene."""

    def __init__(self, model: mujoco.MjModel):
        self.model = model
        self.bodies = {0: GROUND} | {i: self._name("body", i) for i in range(1, model.nbody)}
        self.joints = [self._name("joint", i) for i in range(model.njnt)]
        self.kinds = [KINDS[mujoco.mjtJoint(kind)] for kind in model.jnt_type]

    def _name(self, kind: str, number: int) -> str:
        name = getattr(self.model, kind)(number).name or f"{kind} {number}"
        return f"{kind} {name}" if name == GROUND else name

    def refused(self) -> list[str]:
        """Everything that moves the mechanism and has no counterpart."""
        model, option = self.model, self.model.opt
        found = [f"tendon {self._name('tendon', i)!r}" for i in range(model.ntendon)]
        found += [f"flexible body {i}" for i in range(model.nflex)]
        if option.density or option.viscosity:
            found.append("a medium (option density, viscosity)")
        found += [f"gravcomp of body {self.bodies[i]!r}" for i in np.flatnonzero(model.body_gravcomp)]
        for i, kind in enumerate(self.kinds):
            first = model.jnt_dofadr[i]
            if kind not in SCALAR:
                for what in ("dof_damping", "dof_armature", "dof_frictionloss"):
                    if getattr(model, what)[first]:
                        found.append(f"{what.removeprefix('dof_')} of {kind} joint {self.joints[i]!r}")
                found += [f"stiffness of {kind} joint {self.joints[i]!r}"] if model.jnt_stiffness[i] else []
        found += [f"equality {self._name('equality', i)!r}: {why}" for i in range(model.neq) if (why := self._against(i))]
        found += [f"actuator {self._name('actuator', i)!r}: {why}" for i in range(model.nu) if (why := self._foreign(i))]
        return found

    def _against(self, i: int) -> str:
        """Why an equality has no counterpart; empty if it has one."""
        model = self.model
        kind, data = int(model.eq_type[i]), model.eq_data[i]
        if kind not in (CONNECT, WELD, JOINT):
            return "only connect, weld and joint are read"
        if kind == JOINT:
            scalar = all(self.kinds[j] in SCALAR for j in (model.eq_obj1id[i], model.eq_obj2id[i]) if j >= 0)
            return "" if scalar and not data[2:5].any() else "the polynomial is not linear, or a joint has several freedoms"
        if int(model.eq_objtype[i]) != BODY:
            return "it binds sites; name bodies"
        return "" if kind == CONNECT or self._is_closed(i) else "the welded pose is not that of the file"

    def _is_closed(self, i: int) -> bool:
        """Whether a weld holds what the file shows."""
        data = mujoco.MjData(self.model)
        mujoco.mj_kinematics(self.model, data)
        mujoco.mj_comPos(self.model, data)
        mujoco.mj_makeConstraint(self.model, data)
        rows = (data.efc_type == int(mujoco.mjtConstraint.mjCNSTR_EQUALITY)) & (data.efc_id == i)
        return bool(abs(data.efc_pos[rows]).max(initial=0.0) < SAME)

    def _foreign(self, i: int) -> str:
        """Why an actuator has no counterpart; empty if it has one."""
        model = self.model
        if int(model.actuator_trntype[i]) != ON_JOINT or self.kinds[model.actuator_trnid[i, 0]] not in SCALAR:
            return "only actuators of hinges and slides are read"
        if int(model.actuator_dyntype[i]) != STATELESS:
            return "it has states of its own"
        return "" if int(model.actuator_biastype[i]) in (NO_BIAS, AFFINE) else "its force is not affine"

    def left_out(self) -> list[str]:
        """Everything that does not move the mechanism by itself and is not read."""
        model = self.model
        touching = [self._name("geom", i) for i in np.flatnonzero(model.geom_contype | model.geom_conaffinity)]
        limited = [self.joints[i] for i in np.flatnonzero(model.jnt_limited)]
        parts = [("contacts of geoms", touching), ("limits, kept for the assembly of a start only, of joints", limited)]
        return [f"{what} {', '.join(names[:8])}{', …' if len(names) > 8 else ''}" for what, names in parts if names]

    def scene(self, name: str) -> Scene:
        """Scene of the model."""
        scene = Scene(name, gravity=tuple(self.model.opt.gravity))
        for i in range(1, self.model.nbody):
            self._body(scene, i)
        for i in range(self.model.neq):
            if self.model.eq_active0[i]:
                self._equality(scene, i)
        for i in range(self.model.nu):
            self._actuator(scene, i)
        return scene

    def _body(self, scene: Scene, i: int):
        """A body with its joints; those before the last move bodies without mass."""
        model, name = self.model, self.bodies[i]
        parent = on = self.bodies[int(model.body_parentid[i])]
        pose = {"position": tuple(model.body_pos[i]), "rotation": _matrix(model.body_quat[i])}
        joints = range(model.body_jntadr[i], model.body_jntadr[i] + model.body_jntnum[i])
        for number, j in enumerate(joints):
            last = number == len(joints) - 1
            child = name if last else f"{name} before {self.joints[j + 1]}"
            if not last:
                scene.add(Body(child, 0.0, on=on, **pose))
            else:
                scene.add(self._with_mass(i, on, pose))
            on, pose = child, {}
            self._joint(scene, j, parent, child)
            parent = child
        if not len(joints):
            scene.add(self._with_mass(i, on, pose))
            scene.fixed(f"{name} is fixed", parent, name, frame=name)

    def _with_mass(self, i: int, on: str, pose: dict) -> Body:
        model = self.model
        mass, com = float(model.body_mass[i]), tuple(model.body_ipos[i])
        axes = _matrix(model.body_iquat[i])
        inertia = tuple(model.body_inertia[i]) if mass else (0.0, 0.0, 0.0)
        return Body(self.bodies[i], mass, inertia, com, inertia_axes=axes, on=on, **pose)

    def _joint(self, scene: Scene, j: int, parent: str, child: str):
        model, name, kind = self.model, self.joints[j], self.kinds[j]
        if kind == "free":
            scene.free(name, parent, child, at=tuple(model.body_pos[model.jnt_bodyid[j]]))
            return
        options = {"at": tuple(model.jnt_pos[j]), "frame": child}
        if kind == "ball":
            scene.joint(name, kind, parent, child, **options)
            return
        if model.jnt_limited[j]:
            options["limits"] = tuple(model.jnt_range[j] - model.qpos0[model.jnt_qposadr[j]])
        scene.joint(name, kind, parent, child, axis=tuple(model.jnt_axis[j]), **options)
        dof, place = model.jnt_dofadr[j], model.jnt_qposadr[j]
        stiffness, damping = float(model.jnt_stiffness[j]), float(model.dof_damping[dof])
        if stiffness or damping:
            rest = float(model.qpos_spring[place] - model.qpos0[place])
            scene.joint_spring(f"spring of {name}", name, stiffness=stiffness, damping=damping, rest=rest)
        if model.dof_frictionloss[dof]:
            scene.joint_friction(name, float(model.dof_frictionloss[dof]))
        if model.dof_armature[dof]:
            self._armature(scene, name, float(model.dof_armature[dof]))

    def _armature(self, scene: Scene, joint: str, inertia: float):
        """A rotor on the ground that turns by 1 rad for each rad or m of the joint: it adds its inertia only."""
        rotor = f"rotor of {joint}"
        scene.body(rotor, 1.0, (inertia,) * 3)
        scene.revolute(f"shaft of {joint}", GROUND, rotor)
        scene.couple(f"armature of {joint}", f"shaft of {joint}", joint, 1.0)

    def _equality(self, scene: Scene, i: int):
        model, name = self.model, self._name("equality", i)
        if name in self.joints:  # MuJoCo tells their names apart
            name = f"equality {name}"
        kind, data = int(model.eq_type[i]), model.eq_data[i]
        one, other = int(model.eq_obj1id[i]), int(model.eq_obj2id[i])
        if kind == JOINT and other < 0:
            law = "angle" if self.kinds[one] == "revolute" else "displacement"
            scene.drive(self.joints[one], name=name, **{law: float(data[0])})
        elif kind == JOINT:
            scene.couple(name, self.joints[one], self.joints[other], float(data[1]), float(data[0]))
        elif kind == CONNECT:
            scene.ball(name, self.bodies[one], self.bodies[other], at=tuple(data[:3]), frame=self.bodies[one])
        else:
            scene.fixed(name, self.bodies[one], self.bodies[other], frame=self.bodies[one])

    def _actuator(self, scene: Scene, i: int):
        """Effort without control: constant, along the coordinate, along the rate."""
        model, name = self.model, self._name("actuator", i)
        joint, gear = int(model.actuator_trnid[i, 0]), float(model.actuator_gear[i, 0])
        bias = model.actuator_biasprm[i, :3] * (int(model.actuator_biastype[i]) == AFFINE)
        effort, stiffness, damping = gear * bias[0], -(gear**2) * bias[1], -(gear**2) * bias[2]
        at_rest = float(model.qpos0[model.jnt_qposadr[joint]])
        law = "torque" if self.kinds[joint] == "revolute" else "force"
        scene.drive(self.joints[joint], name=name, **{law: float(effort)})
        if stiffness or damping:
            terms = {"stiffness": float(stiffness), "damping": float(damping), "rest": -at_rest}
            scene.joint_spring(f"feedback of {name}", self.joints[joint], **terms)


def _matrix(quaternion) -> np.ndarray:
    return rotations.clean(rotations.from_quaternion(np.array(quaternion)))
