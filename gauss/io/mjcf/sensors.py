"""Sensors of a MuJoCo model as outputs of a scene: of joints, of points of bodies, of bodies with all that hangs on them."""

from collections.abc import Iterator

import mujoco
import numpy as np

from gauss import rotations
from gauss.errors import listed
from gauss.io.mjcf.names import Named
from gauss.io.mjcf.passive import armature_of
from gauss.io.mjcf.transmissions import JOINT, JOINT_IN_PARENT, transmission
from gauss.scene import GROUND, Frame, Scene

OF_JOINTS = {"JOINTPOS": "coordinate", "JOINTVEL": "rate", "BALLQUAT": "coordinate", "BALLANGVEL": "rate"}
OF_ACTUATORS = {"ACTUATORPOS": "coordinate", "ACTUATORVEL": "rate"}  # of a joint that they act on without a gear
OF_POINTS = {
    "FRAMEPOS": "position",
    "FRAMEQUAT": "rotation",
    "FRAMEXAXIS": "x_axis",
    "FRAMEYAXIS": "y_axis",
    "FRAMEZAXIS": "z_axis",
    "FRAMELINVEL": "velocity",
    "FRAMEANGVEL": "angular_velocity",
    "FRAMELINACC": "proper_acceleration",
    "FRAMEANGACC": "angular_acceleration",
    "ACCELEROMETER": "accelerometer",
    "GYRO": "gyroscope",
    "VELOCIMETER": "velocimeter",
}
OF_SUBTREES = {
    "SUBTREECOM": "center_of_mass",
    "SUBTREELINVEL": "center_of_mass_velocity",
    "SUBTREEANGMOM": "angular_momentum",
}
WITHOUT_AXES = (  # outputs that do not depend on the axes of what is measured
    "position",
    "velocity",
    "angular_velocity",
    "proper_acceleration",
    "angular_acceleration",
)
PLACES = {  # what MuJoCo measures a point of, and where a model has the body, the point and the axes of it
    "BODY": (None, "body_ipos", "body_iquat"),
    "XBODY": (None, None, None),
    "GEOM": ("geom_bodyid", "geom_pos", "geom_quat"),
    "SITE": ("site_bodyid", "site_pos", "site_quat"),
}
EQUAL_AXES = 1e-12  # of an entry of a rotation: axes that are those of the body


def add_sensors(scene: Scene, named: Named) -> list[str]:
    """Add an output for each sensor that has a counterpart; what the others measure, with their names."""
    left: dict[str, list[str]] = {}
    for i in range(named.model.nsensor):
        name, kind = named.name("sensor", i), _enumerator(mujoco.mjtSensor, "mjSENS_", named.model.sensor_type[i])
        against = next(_against(scene, named, i, kind), "")
        number = int(named.model.sensor_objid[i])
        if against:
            left.setdefault(f"the kind {kind.lower()}{against}", []).append(name)
        elif kind in OF_JOINTS:
            scene.output(name, OF_JOINTS[kind], named.joints[number])
        elif kind in OF_ACTUATORS:
            scene.output(name, OF_ACTUATORS[kind], named.joints[int(named.model.actuator_trnid[number, 0])])
        elif kind in OF_SUBTREES:
            scene.output(name, OF_SUBTREES[kind], named.bodies[number])
        else:
            _add_of_point(scene, named, i, name, OF_POINTS[kind])
    return [f"sensors of {what}: {listed(names)}" for what, names in left.items()]


def _against(scene: Scene, named: Named, i: int, kind: str) -> Iterator[str]:
    """Why a sensor has no counterpart."""
    model = named.model
    if kind not in OF_JOINTS | OF_ACTUATORS | OF_POINTS | OF_SUBTREES:
        yield ", which outputs of scenes do not have"
    elif kind in OF_ACTUATORS and not _acts_on_joint(named, int(model.sensor_objid[i])):
        yield " of a tendon, a site or a gear"
    elif kind in OF_SUBTREES:
        yield from _against_subtree(scene, named, int(model.sensor_objid[i]))
    elif "CAMERA" in _seen(model, i):
        yield " of a camera" if _seen(model, i)[0] == "CAMERA" else " relative to a camera"
    if model.sensor_cutoff[i] > 0.0:
        yield " with a cutoff"
    if any(np.any(getattr(model, field, np.zeros(i + 1))[i]) for field in ("sensor_delay", "sensor_interval")):
        yield " with a delay or interval"


def _acts_on_joint(named: Named, number: int) -> bool:
    """Whether an actuator is as long as the coordinate of a joint of one freedom."""
    acted = transmission(named, number) if named.model.actuator_trntype[number] in (JOINT, JOINT_IN_PARENT) else None
    return acted is not None and acted.length is not None and [*acted.acts_on.values()] == [1.0]


def _against_subtree(scene: Scene, named: Named, body: int) -> Iterator[str]:
    """Why what hangs on a body has other masses than in MuJoCo: loops, and armature that is inertia of a body."""
    if len(scene.joints) > len(scene.bodies):
        yield " beside loops"
    bodies = [i for i in range(1, named.model.nbody) if _hangs_on(named.model, i, body)]
    if any(armature_of(named, i) for i in bodies) or (not body and named.model.dof_armature.any()):
        yield " beside armature"
    if not named.model.body_mass[bodies].any():
        yield " without mass"


def _hangs_on(model, body: int, other: int) -> bool:
    """Whether a body is another one, or hangs on it."""
    while body not in (other, 0):
        body = int(model.body_parentid[body])
    return body == other


def _enumerator(kinds, prefix: str, number) -> str:
    """Name of an enumerator of MuJoCo, without its prefix."""
    return kinds(int(number)).name.removeprefix(prefix)


def _seen(model, i: int) -> list[str]:
    """Kinds of the places that a sensor measures, and measures them from."""
    kinds = [model.sensor_objtype[i], *([model.sensor_reftype[i]] if model.sensor_refid[i] >= 0 else [])]
    return [_enumerator(mujoco.mjtObj, "mjOBJ_", kind) for kind in kinds]


def _add_of_point(scene: Scene, named: Named, i: int, name: str, kind: str):
    """Output of a point of a body; of a frame of the name of the site or geom where its axes are others."""
    what, *base = _seen(named.model, i)
    body, at, R = _place(named, what, int(named.model.sensor_objid[i]))
    seen_from = _framed(scene, named, base[0], int(named.model.sensor_refid[i])) if base else ""
    if kind in WITHOUT_AXES or abs(R - np.eye(3)).max() <= EQUAL_AXES:
        scene.output(name, kind, body, tuple(at), seen_from)
        return
    scene.output(name, kind, _framed(scene, named, what, int(named.model.sensor_objid[i])), relative_to=seen_from)


def _place(named: Named, what: str, number: int) -> tuple[str, np.ndarray, np.ndarray]:
    """Body, point and axes of a place."""
    model, (carrier, point, axes) = named.model, PLACES[what]
    body = named.bodies[number if carrier is None else int(getattr(model, carrier)[number])]
    at = np.zeros(3) if point is None else np.array(getattr(model, point)[number])
    R = np.eye(3) if axes is None else rotations.clean(rotations.from_quaternion(np.array(getattr(model, axes)[number])))
    return body, at, R


def _framed(scene: Scene, named: Named, what: str, number: int) -> str:
    """Name of a frame at a place: of its body where it is that of the body, else of the site or geom."""
    body, at, R = _place(named, what, number)
    if not at.any() and abs(R - np.eye(3)).max() <= EQUAL_AXES:
        return body
    called = f"inertial frame of {body}" if what == "BODY" else named.name(what.lower(), number)
    return _frame(scene, called, what.lower(), body, tuple(at), tuple(R.ravel()))


def _frame(scene: Scene, called: str, what: str, body: str, at: tuple, R: tuple) -> str:
    """Name of a frame at a pose on a body: of the one that is there, or of a new one of a name that nothing has."""
    for tried in (called, *(f"{what} {called}" + "'" * k for k in range(len(scene.frames) + 2))):
        frame = Frame(tried, body, at, R)
        if scene.frames.get(tried) == frame:
            return tried
        if tried not in scene.frames and tried not in scene.bodies and tried != GROUND:
            return scene.add(frame).name
    raise AssertionError("one name of so many is free")
