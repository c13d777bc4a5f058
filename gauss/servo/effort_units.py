"""Units of the efforts of servos, for tables and figures."""

import numpy as np

from gauss.servo.actuators import AuxiliarySupport, Cable, Motor
from gauss.servo.servo import Servo
from gauss.system import System


def effort_units(servo: Servo) -> tuple[str, ...]:
    """Unit of each effort: "N", "N m", or "1" of a thruster, whose effort multiplies a force and a moment."""
    return tuple(_unit(actuator, number, servo.system) for actuator, number in servo.each_effort)


def _unit(actuator, number: int, system: System) -> str:
    if isinstance(actuator, Cable):
        return "N"
    if not isinstance(actuator, Motor | AuxiliarySupport):
        return "1"
    names = [actuator.coordinate] if isinstance(actuator, Motor) else actuator.joints
    joints = [(joint, k) for joint in system.joints for k in range(joint.pair.n_v)]
    columns = [k for k, name in enumerate(system.coordinates) if name in names or name.split(".")[0] in names]
    joint, k = joints[columns[number]]
    E_omega, _ = joint.pair.subspace(np.array(joint.pair.reference))
    return "N m" if np.any(E_omega[:, k]) else "N"
