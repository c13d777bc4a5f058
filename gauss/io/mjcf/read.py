"""Scenes of MJCF files, read through MuJoCo's own compiler.

Bodies, joints, equalities, actuators, tendons, inertia from geometry. What moves a mechanism and has no
counterpart is refused by name, file and line. What does not move it by itself is read where it is asked for, else named in a
warning: contacts of geoms, and limits, which are always kept for the assembly of a start.
"""

import warnings
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from gauss import rotations
from gauss.errors import FileError, NotImportedWarning, SceneError
from gauss.io.guard import checked_root
from gauss.io.mjcf.actuators import actuators, adheres, is_switched_off
from gauss.io.mjcf.drives import add_actuator
from gauss.io.mjcf.guard import guarded
from gauss.io.mjcf.medium import add_medium
from gauss.io.mjcf.names import SITE, Named
from gauss.io.mjcf.passive import add_ball_armature, add_compensation, add_passive, with_armature
from gauss.io.mjcf.refused import CONNECT, JOINT, TENDON, WELD, is_closed, left_out, refused
from gauss.io.mjcf.sensors import add_sensors
from gauss.io.mjcf.start import add_start
from gauss.io.mjcf.switches import without_what_is_off
from gauss.io.mjcf.tendons import add_tendon, couple_tendons, hold_tendon, tendon_path
from gauss.io.mjcf.touching import add_contacts, add_stops
from gauss.io.numbers import LIMITS, bounds, check_option
from gauss.scene import GROUND, Body, Scene
from gauss.scene.profiles import Polynomial


def read_mjcf(
    path, limits: str = "start", contacts: bool = False, root_folder=None, keyframe: str | int | None = None
) -> Scene:
    """Scene of a MJCF file.

    A body of several joints hangs on bodies without mass in between. Coordinates count from the pose of the file, so that
    those of a joint with ``ref`` are smaller by it. An actuator is an input, named like it, of its control; the force that
    it has when nobody controls it, under control 0 or the end of its ``ctrlrange`` that is nearest, is a load. Armature is
    a rotor on the ground that turns with its joint. A fixed tendon pulls its joints; one between two sites is a spring, a
    rope, or a distance, one over several sites and around spheres and cylinders pulls the bodies of all. An activation of an
    actuator is a state of the scene. A key frame called "start", or another that is
    asked for, is where the scene starts. A sensor is an output, named like it, where outputs have its kind: of positions and
    speeds of joints (positions count like coordinates), of poses, velocities and accelerations of points, also relative to
    another frame (a ``framequat`` is a rotation matrix), of centres of mass and momenta of subtrees, accelerometers,
    velocimeters and gyroscopes; values do not depend on ``noise``.

    FileError if it cannot be parsed, or holds what moves the mechanism and is not modelled; all of that is named.

    Parameters
    ----------
    path : str or Path
        The file; files that it names must lie in its folder, or in ``root_folder``.
    limits : str
        "start": limits of joints are kept where a start is assembled; "stops": joints run against them, too.
    contacts : bool
        Whether planes, spheres, capsules, boxes, cylinders, ellipsoids, hulls of meshes and height fields become shapes, and
        contacts where they may touch; see :mod:`gauss.io.mjcf.touching`.
    root_folder : str or Path, optional
        Folder in which meshes and included files may lie, beside that of the file.
    keyframe : str, optional
        Name of the key frame that the scene starts from, or its number from 0.

    Warns
    -----
    NotImportedWarning
        Of contacts and stops that are not read, of geoms and sensors that have no counterpart, of key frames that are not
        the start, of equalities and actuators that are switched off.
    """
    path = Path(path)
    check_option(path, "limits", limits, LIMITS)
    source = guarded(path, checked_root(path, root_folder))
    try:
        model = without_what_is_off(mujoco.MjModel.from_xml_path(str(path)))
    except (ValueError, RuntimeError) as error:
        raise FileError(f"{path}: MuJoCo refuses it: {error}") from error
    named = Named(model, source)
    against = refused(named, contacts)
    if against:
        raise FileError(f"{path}: not modelled: {'; '.join(against)}. Remove them from the file, or model them in gauss.")
    try:
        scene = _MjcfReader(named).scene(path.stem, keyframe, limits == "stops")
        if limits == "stops":
            add_stops(scene, named)
        unlike = add_contacts(scene, named) if contacts else []
        unmeasured = add_sensors(scene, named)
    except SceneError as error:
        raise FileError(f"{path}: {error}") from error
    left = left_out(named, limits == "stops", contacts, keyframe) + unlike + unmeasured
    if left:
        warnings.warn(f"{path}: not read: {'; '.join(left)}.", NotImportedWarning, stacklevel=2)
    return scene


class _MjcfReader:
    """One compiled model while it becomes a scene."""

    def __init__(self, named: Named):
        self.named, self.model = named, named.model
        self.bodies, self.joints, self.kinds = named.bodies, named.joints, named.kinds

    def scene(self, name: str, keyframe: str | int | None, stops: bool) -> Scene:
        """Scene of the model."""
        scene = Scene(name, gravity=tuple(self.model.opt.gravity))
        for i in range(1, self.model.nbody):
            self._body(scene, i)
            add_compensation(scene, self.named, i)
            add_medium(scene, self.named, i)
        for i in range(self.model.ntendon):
            add_tendon(scene, self.named, i, stops)
        for i in range(self.model.neq):
            if self.model.eq_active0[i]:
                self._equality(scene, i)
        for i in actuators(self.model):
            if not is_switched_off(self.model, i) and not adheres(self.model, i):
                add_actuator(scene, self.named, i)
        add_start(scene, self.named, keyframe)
        return scene

    def _body(self, scene: Scene, i: int):
        """A body with its joints; those before the last move bodies without mass."""
        model, name = self.model, self.bodies[i]
        parent = on = self.bodies[int(model.body_parentid[i])]
        pose: dict[str, Any] = {"position": tuple(model.body_pos[i]), "rotation": _matrix(model.body_quat[i])}
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
        body = Body(self.bodies[i], mass, inertia, com, **{"inertia_axes": axes, "on": on, **pose})
        return with_armature(self.named, body, i)

    def _joint(self, scene: Scene, j: int, parent: str, child: str):
        model, name, kind = self.model, self.joints[j], self.kinds[j]
        if kind == "free":
            scene.free(name, parent, child, at=tuple(model.body_pos[model.jnt_bodyid[j]]))
            add_passive(scene, self.named, j)
            return
        options: dict[str, Any] = {"at": tuple(model.jnt_pos[j]), "frame": child}
        if kind == "ball":
            scene.joint(name, kind, parent, child, **options)
            add_passive(scene, self.named, j)
            add_ball_armature(scene, self.named, j)
            return
        if model.jnt_limited[j]:
            options["limits"] = bounds(*(model.jnt_range[j] - model.qpos0[model.jnt_qposadr[j]]).tolist())
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
        model, name = self.model, self.named.name("equality", i)
        if name in self.joints or name in scene.loads or name in scene.contacts:  # MuJoCo tells their names apart
            name = f"equality {name}"
        kind, data = int(model.eq_type[i]), model.eq_data[i]
        one, other = int(model.eq_obj1id[i]), int(model.eq_obj2id[i])
        if kind == JOINT:
            self._of_joints(scene, name, one, other, data)
        elif kind == TENDON:
            self._of_tendons(scene, name, one, other, data)
        elif kind == WELD and (not data[10] or not is_closed(self.named, i)):
            self._weld(scene, name, i, one, other, data)
        elif int(model.eq_objtype[i]) == SITE:
            self._of_sites(scene, name, kind, one, other)
        elif kind == CONNECT:
            scene.ball(name, self.bodies[one], self.bodies[other], at=tuple(data[:3]), frame=self.bodies[one])
        else:
            scene.fixed(name, self.bodies[one], self.bodies[other], frame=self.bodies[one])

    def _of_joints(self, scene: Scene, name: str, one: int, other: int, data):
        """A joint that stands still, or follows another by a polynomial."""
        if other < 0:
            law = "angle" if self.kinds[one] == "revolute" else "displacement"
            scene.drive(self.joints[one], name=name, **{law: float(data[0])})
        elif data[2:5].any():
            scene.cam(name, self.joints[other], self.joints[one], Polynomial(tuple(data[:5])))
        else:
            scene.couple(name, self.joints[one], self.joints[other], float(data[1]), float(data[0]))

    def _of_tendons(self, scene: Scene, name: str, one: int, other: int, data):
        """A tendon that keeps its length, or is as long as another; lengths count from the pose of the file."""
        path = tendon_path(self.named, one)
        if other < 0:
            hold_tendon(scene, name, path, float(data[0]))
        else:
            couple_tendons(scene, name, path, tendon_path(self.named, other), data[:5].tolist())

    def _weld(self, scene: Scene, name: str, i: int, one: int, other: int, data):
        """A weld at another pose than that of the file, or of points alone: p₁ = p₂, R₁ R = R₂."""
        if int(self.model.eq_objtype[i]) == SITE:
            ends = [(self.bodies[int(self.model.site_bodyid[s])], *_site_pose(self.model, s)) for s in (one, other)]
            data = np.array([*np.zeros(6), 1.0, 0.0, 0.0, 0.0, data[10]])
        else:
            ends = [(self.bodies[body], np.zeros(3), np.eye(3)) for body in (one, other)]
        (first, p_1, R_1), (second, p_2, R_2) = ends
        at, other_at = p_1 + R_1 @ data[3:6], p_2 + R_2 @ data[:3]
        if not data[10]:  # no torque
            scene.coincident(name, first, second, tuple(at), tuple(other_at))
            return
        axes = R_1 @ _matrix(data[6:10]) @ R_2.T

        def residual(view):
            turned = (view.rotation(first) @ axes).T @ view.rotation(second)
            sines = turned[2, 1] - turned[1, 2], turned[0, 2] - turned[2, 0], turned[1, 0] - turned[0, 1]
            scale = 0.5 * (
                1.0 + turned[0, 0] + turned[1, 1] + turned[2, 2]
            )  # 1 + cos: not zero for half a turn, as a sine is
            return [*(view.position(second, other_at) - view.position(first, at)), *(sine / scale for sine in sines)]

        scene.constrain(name, residual)

    def _of_sites(self, scene: Scene, name: str, kind: int, one: int, other: int):
        bodies = [self.bodies[int(self.model.site_bodyid[site])] for site in (one, other)]
        points = [tuple(self.model.site_pos[site]) for site in (one, other)]
        if kind == CONNECT:
            scene.coincident(name, *bodies, *points)
        else:
            scene.fixed(name, bodies[0], bodies[1], points[0], frame=bodies[0])


def _site_pose(model, site: int) -> tuple[np.ndarray, np.ndarray]:
    """Point and axes of a site in its body."""
    return np.array(model.site_pos[site]), _matrix(model.site_quat[site])


def _matrix(quaternion) -> np.ndarray:
    return rotations.clean(rotations.from_quaternion(np.array(quaternion)))
