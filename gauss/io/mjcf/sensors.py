"""Sensors of a MuJoCo model as outputs of a scene: of joints, and of points of bodies in axes of the world or their own."""

from collections.abc import Iterator

import mujoco
import numpy as np

from gauss import rotations
from gauss.errors import listed
from gauss.io.mjcf.names import Named
from gauss.scene import GROUND, Frame, Scene

OF_JOINTS = {"JOINTPOS": "coordinate", "JOINTVEL": "rate", "BALLQUAT": "coordinate", "BALLANGVEL": "rate"}
OF_POINTS = {
    "FRAMEPOS": "position",
    "FRAMEQUAT": "rotation",
    "FRAMELINVEL": "velocity",
    "FRAMEANGVEL": "angular_velocity",
    "ACCELEROMETER": "accelerometer",
    "GYRO": "gyroscope",
}
AXES = ("rotation", "accelerometer", "gyroscope")  # outputs that depend on the axes of what is measured
PLACES = {  # what MuJoCo measures a point of, and where a model has the body, the point and the axes of it
    "BODY": (None, "body_ipos", "body_iquat"),
    "XBODY": (None, None, None),
    "GEOM": ("geom_bodyid", "geom_pos", "geom_quat"),
    "SITE": ("site_bodyid", "site_pos", "site_quat"),
}
SAME = 1e-12  # of an entry of a rotation: axes that are those of the body


def add_sensors(scene: Scene, named: Named) -> list[str]:
    """Add an output for each sensor that has a counterpart; what the others measure, with their names."""
    left: dict[str, list[str]] = {}
    for i in range(named.model.nsensor):
        name, kind = named.name("sensor", i), _enumerator(mujoco.mjtSensor, "mjSENS_", named.model.sensor_type[i])
        against = next(_against(named.model, i, kind), "")
        if against:
            left.setdefault(against, []).append(name)
        elif kind in OF_JOINTS:
            scene.output(name, OF_JOINTS[kind], named.joints[int(named.model.sensor_objid[i])])
        else:
            _add_of_point(scene, named, i, name, OF_POINTS[kind])
    return [f"sensors of {what}: {listed(names)}" for what, names in left.items()]


def _against(model, i: int, kind: str) -> Iterator[str]:
    """Why a sensor has no counterpart."""
    if kind not in OF_JOINTS and kind not in OF_POINTS:
        yield f"the kind {kind.lower()}, which outputs of scenes do not have"
    if kind in OF_POINTS and _enumerator(mujoco.mjtObj, "mjOBJ_", model.sensor_objtype[i]) not in PLACES:
        yield f"the kind {kind.lower()} of a camera"
    if model.sensor_refid[i] >= 0:
        yield f"the kind {kind.lower()} relative to another frame"
    if model.sensor_cutoff[i] > 0.0:
        yield f"the kind {kind.lower()} with a cutoff"
    if any(np.any(getattr(model, field, np.zeros(i + 1))[i]) for field in ("sensor_delay", "sensor_interval")):
        yield f"the kind {kind.lower()} with a delay or interval"


def _enumerator(kinds, prefix: str, number) -> str:
    """Name of an enumerator of MuJoCo, without its prefix."""
    return kinds(int(number)).name.removeprefix(prefix)


def _add_of_point(scene: Scene, named: Named, i: int, name: str, kind: str):
    """Output of a point of a body; of a frame of the name of the site or geom where its axes are others."""
    model, number = named.model, int(named.model.sensor_objid[i])
    what = _enumerator(mujoco.mjtObj, "mjOBJ_", model.sensor_objtype[i])
    carrier, point, axes = PLACES[what]
    body = named.bodies[number if carrier is None else int(getattr(model, carrier)[number])]
    at = np.zeros(3) if point is None else getattr(model, point)[number]
    R = np.eye(3) if axes is None else rotations.clean(rotations.from_quaternion(np.array(getattr(model, axes)[number])))
    if kind not in AXES or abs(R - np.eye(3)).max() <= SAME:
        scene.output(name, kind, body, tuple(at))
        return
    called = f"inertial frame of {body}" if what == "BODY" else named.name(what.lower(), number)
    scene.output(name, kind, _frame(scene, called, what.lower(), body, tuple(at), tuple(R.ravel())))


def _frame(scene: Scene, called: str, what: str, body: str, at: tuple, R: tuple) -> str:
    """Name of a frame at a pose on a body: of the one that is there, or of a new one of a name that nothing has."""
    for tried in (called, *(f"{what} {called}" + "'" * k for k in range(len(scene.frames) + 2))):
        frame = Frame(tried, body, at, R)
        if scene.frames.get(tried) == frame:
            return tried
        if tried not in scene.frames and tried not in scene.bodies and tried != GROUND:
            return scene.add(frame).name
    raise AssertionError("one name of so many is free")
