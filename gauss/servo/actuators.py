"""Actuators of a servo: reactions of the second kind (Béghin) act through them only.

Each actuator has one or more efforts; ``push`` adds one unit of one effort to the applied forces. These are the directions
W, as wrenches on the bodies and as generalised forces.
"""

from dataclasses import dataclass
from functools import singledispatch

import numpy as np

from gauss.arguments import name_list
from gauss.dynamics.kinematics import Kinematics
from gauss.dynamics.loads import Applied
from gauss.errors import SceneError, did_you_mean
from gauss.scene import GROUND, values
from gauss.system import System


@dataclass(frozen=True)
class Motor:
    """Generalised force along one coordinate: a motor, a winch, a linear drive.

    Parameters
    ----------
    name : str
        Name of the actuator.
    coordinate : str
        Name of the coordinate, as in ``System.coordinates``; of a joint of one freedom it is the name of the joint.
    """

    kind = "motor"
    name: str
    coordinate: str

    def __post_init__(self):
        values.text(self.coordinate, f"motor {values.text(self.name, 'name of an actuator')!r}: coordinate")


@dataclass(frozen=True)
class Thruster:
    """Force along a given direction at a point of a body, or moment about it.

    Parameters
    ----------
    name, body : str
        Name of the actuator and of the body that it acts on.
    force, moment : array_like, shape (3,)
        Force [N] and moment [N m] of one unit of effort.
    at : array_like, shape (3,)
        Point of application in the body frame [m].
    axes : str
        "world", or "body" for directions that turn with the body.

    Examples
    --------
    >>> from gauss import servo
    >>> servo.Thruster("jet", "hull", force=(10.0, 0.0, 0.0), axes="body").force
    (10.0, 0.0, 0.0)
    """

    kind = "thruster"
    name: str
    body: str
    force: tuple = (0.0, 0.0, 0.0)
    moment: tuple = (0.0, 0.0, 0.0)
    at: tuple = (0.0, 0.0, 0.0)
    axes: str = "world"

    def __post_init__(self):
        what = f"thruster {values.text(self.name, 'name of an actuator')!r}"
        for key, unit in (("force", "N"), ("moment", "N m"), ("at", "m")):
            object.__setattr__(self, key, values.vector(getattr(self, key), f"{what}: {key}", unit))
        if not any(self.force) and not any(self.moment):
            raise SceneError(f"{what}: neither force nor moment has a direction; it would do nothing.")
        if self.axes not in ("world", "body"):
            raise SceneError(f"{what}: axes must be 'world' or 'body', got {self.axes!r}.")


@dataclass(frozen=True)
class Cable:
    """Cable between points of two bodies: an effort that is a tension.

    Parameters
    ----------
    name, body, other : str
        Name of the actuator and of the two bodies; "ground" is allowed.
    at, other_at : array_like, shape (3,)
        Ends in the frames of the two bodies [m].
    slack : float
        Least tension [N]; below it the cable is slack.

    Examples
    --------
    >>> from gauss import servo
    >>> servo.Cable("rope", "trolley", "load")
    Cable(name='rope', body='trolley', other='load', at=(0.0, 0.0, 0.0), other_at=(0.0, 0.0, 0.0), slack=0.0)
    """

    kind = "cable"
    name: str
    body: str
    other: str
    at: tuple = (0.0, 0.0, 0.0)
    other_at: tuple = (0.0, 0.0, 0.0)
    slack: float = 0.0

    def __post_init__(self):
        what = f"cable {values.text(self.name, 'name of an actuator')!r}"
        object.__setattr__(self, "at", values.vector(self.at, f"{what}: at", "m"))
        object.__setattr__(self, "other_at", values.vector(self.other_at, f"{what}: other_at", "m"))
        object.__setattr__(self, "slack", values.number(self.slack, f"{what}: slack", "N", non_negative=True))
        if self.body == self.other:
            raise SceneError(f"{what}: both ends are on {self.body!r}; it would do nothing.")


@dataclass(frozen=True)
class AuxiliarySupport:
    """Action of an auxiliary system: forces along every freedom of the joints that place it.

    Neither its inertia nor the forces given on it influence the motion of the rest (drop-out theorem), as long as as many
    relations are held as these joints have freedoms.

    Parameters
    ----------
    name : str
        Name of the actuator.
    joints : sequence of str
        Joints that place the auxiliary system.

    Examples
    --------
    >>> from gauss import servo
    >>> servo.AuxiliarySupport("support", ("rail",))
    AuxiliarySupport(name='support', joints=('rail',))
    """

    kind = "support"
    name: str
    joints: tuple[str, ...]

    def __post_init__(self):
        what = f"support {values.text(self.name, 'name of an actuator')!r}"
        joints = name_list(self.joints, f"{what}: joints", "names of joints")
        if not joints:
            raise SceneError(f"{what}: needs at least one joint.")
        object.__setattr__(self, "joints", tuple(values.text(joint, f"{what}: joint") for joint in joints))


Actuator = Motor | Thruster | Cable | AuxiliarySupport


@singledispatch
def efforts(actuator, system: System) -> tuple[str, ...]:
    """Names of the efforts of an actuator, checked against the system; open to further kinds."""
    raise SceneError(f"expected a Motor, Thruster, Cable or AuxiliarySupport, got {actuator!r}.")


@singledispatch
def push(actuator, number: int, motion: Kinematics, applied: Applied):
    """Add one unit of one effort of an actuator to the applied forces; open to further kinds."""
    raise SceneError(f"expected a Motor, Thruster, Cable or AuxiliarySupport, got {actuator!r}.")


@efforts.register
def _(actuator: Motor, system: System):
    if actuator.coordinate not in system.coordinates:
        known_names = did_you_mean(actuator.coordinate, system.coordinates)
        raise SceneError(f"motor {actuator.name!r}: no coordinate {actuator.coordinate!r}. {known_names}")
    return (actuator.name,)


@push.register
def _(actuator: Motor, number: int, motion: Kinematics, applied: Applied):
    applied.P[motion.system.coordinates.index(actuator.coordinate)] += 1.0


@efforts.register
def _(actuator: Thruster, system: System):
    _require_body(system, f"thruster {actuator.name!r}", actuator.body)
    return (actuator.name,)


@push.register
def _(actuator: Thruster, number: int, motion: Kinematics, applied: Applied):
    force, moment = np.array(actuator.force), np.array(actuator.moment)
    if actuator.axes == "body":
        R = motion.rotation(actuator.body)
        force, moment = R @ force, R @ moment
    body = motion.system.frame(actuator.body).body
    applied.push(motion, body, motion.position(actuator.body, actuator.at), force)
    applied.M[body] = applied.M[body] + moment


@efforts.register
def _(actuator: Cable, system: System):
    for body in (actuator.body, actuator.other):
        _require_body(system, f"cable {actuator.name!r}", body, ground=True)
    return (actuator.name,)


@push.register
def _(actuator: Cable, number: int, motion: Kinematics, applied: Applied):
    ends = motion.position(actuator.body, actuator.at), motion.position(actuator.other, actuator.other_at)
    line = ends[1] - ends[0]
    line = line / np.sqrt(line @ line)
    for body, end, sign in ((actuator.body, ends[0], 1.0), (actuator.other, ends[1], -1.0)):
        if body != GROUND:
            applied.push(motion, motion.system.frame(body).body, end, sign * line)


@efforts.register
def _(actuator: AuxiliarySupport, system: System):
    joints = [joint.name for joint in system.joints]
    for name in actuator.joints:
        if name not in joints:
            raise SceneError(f"support {actuator.name!r}: no joint {name!r}. {did_you_mean(name, joints)}")
    columns = _columns(actuator, system)
    return tuple(f"{actuator.name}.{system.coordinates[column]}" for column in columns)


@push.register
def _(actuator: AuxiliarySupport, number: int, motion: Kinematics, applied: Applied):
    applied.P[_columns(actuator, motion.system)[number]] += 1.0


def unit_of_effort(actuator, number: int, system: System) -> str:
    """Unit of one effort of an actuator; see :attr:`gauss.servo.Servo.effort_units`."""
    if isinstance(actuator, AuxiliarySupport):
        column = _columns(actuator, system)[number]
    elif isinstance(actuator, Motor):
        column = system.coordinates.index(actuator.coordinate)
    else:
        return "N" if isinstance(actuator, Cable) else "1"
    joint = next(joint for joint in system.joints if joint.v.start <= column < joint.v.stop)
    E_omega, _ = joint.pair.subspace(np.array(joint.pair.reference))
    return "N m" if np.any(E_omega[:, column - joint.v.start]) else "N"


def _columns(actuator: AuxiliarySupport, system: System) -> list[int]:
    return [k for name in actuator.joints for k in range(*system.joint(name).v.indices(system.n_v))]


def _require_body(system: System, what: str, body: str, ground: bool = False):
    bodies = [*system.structure.bodies, *([GROUND] if ground else [])]
    if body not in bodies:
        raise SceneError(f"{what}: no body {body!r}. {did_you_mean(body, bodies)}")
