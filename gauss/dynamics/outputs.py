"""Outputs of a scene in one state: values of its sensors, from the kinematics and the accelerations; numbers or expressions.

A point r from the centre of mass c of a body has the acceleration a = a_c + α × r + ω × (ω × r); an accelerometer measures
Rᵀ (a − g).
"""

import numpy as np

from gauss.dynamics.inverse_dynamics_residual import outward_accelerations
from gauss.dynamics.kinematics import Kinematics
from gauss.rotations import cross
from gauss.scene import Output
from gauss.system import System

INERTIAL = ("acceleration", "accelerometer")  # kinds that depend on the accelerations
SHAPES = {"rotation": (3, 3), "coordinate": None, "rate": None}  # of values; None: those of the joint, (3,) of all others


def shape_of(output: Output, system: System) -> tuple[int, ...]:
    """Shape of the values of an output; () for a number."""
    shape = SHAPES.get(output.kind, (3,))
    if shape is not None:
        return shape
    pair = system.joint(output.of).pair
    size = pair.n_q if output.kind == "coordinate" else pair.n_v
    return () if size == 1 else (size,)


def measured(output: Output, motion: Kinematics, acceleration=None) -> np.ndarray:
    """Values of an output.

    Parameters
    ----------
    output : Output
        The sensor.
    motion : Kinematics
        Poses and velocities.
    acceleration : ndarray, shape (n_v,), optional
        Accelerations, for the kinds that depend on them.

    Returns
    -------
    ndarray, shape (m,)
        Values in one row, a rotation row by row.
    """
    state, name = motion.state, output.of
    match output.kind:
        case "coordinate":
            return state.q[motion.system.joint(name).q]
        case "rate":
            return state.v[motion.system.joint(name).v]
        case "position":
            return motion.position(name, output.at)
        case "rotation":
            return np.ravel(motion.rotation(name))
        case "velocity":
            return motion.velocity(name, output.at)
        case "angular_velocity":
            return motion.angular_velocity(name)
        case "gyroscope":
            return motion.rotation(name).T @ motion.angular_velocity(name)
    found = _acceleration(output, motion, acceleration)
    if output.kind == "acceleration":
        return found
    return motion.rotation(name).T @ (found - np.array(motion.system.scene.gravity))


def _acceleration(output: Output, motion: Kinematics, acceleration) -> np.ndarray:
    """Acceleration (3,) of the point of an output in world axes [m/s²]."""
    body = motion.system.frame(output.of).body
    if body < 0:
        return np.zeros(3)
    alpha, linear = next(found for edge, *found in outward_accelerations(motion, acceleration) if edge.outer == body)
    arm, omega = motion.position(output.of, output.at) - motion.x[body], motion.W[body]
    return linear + cross(alpha, arm) + cross(omega, cross(omega, arm))
