"""Values of the sensors of a scene in one state, from the kinematics and the accelerations; numbers or expressions.

A point r from the centre of mass c of a body has the velocity ċ + ω × r and the acceleration c̈ + α × r + ω × (ω × r); an
accelerometer measures Rᵀ (a − g). Seen from a frame (R₁, p₁) that turns by ω₁, a point moves by

    R₁ᵀ (p − p₁),   R₁ᵀ (ṗ − ṗ₁ − ω₁ × (p − p₁)),   R₁ᵀ (ω − ω₁).
"""

import numpy as np

from gauss.dynamics.inverse_dynamics_residual import outward_accelerations
from gauss.dynamics.kinematics import Kinematics
from gauss.errors import SimulationError
from gauss.rotations import cross
from gauss.scene import Output
from gauss.scene.inputs import AXES

INERTIAL = ("acceleration", "angular_acceleration", "proper_acceleration", "accelerometer")  # those that need accelerations
OF_SUBTREES = ("center_of_mass", "center_of_mass_velocity", "angular_momentum")


def measured(output: Output, motion: Kinematics, acceleration=None) -> np.ndarray:
    """Values (m,) of an output, a rotation row by row; accelerations (n_v,) for the kinds that depend on them."""
    if output.kind == "coordinate":
        return motion.state.q[motion.system.joint(output.of).q]
    if output.kind == "rate":
        return motion.state.v[motion.system.joint(output.of).v]
    if output.kind in OF_SUBTREES:
        return _of_subtree(output, motion)
    if output.kind in INERTIAL:
        return _acceleration(output, motion, acceleration)
    found = _of_frame(output, motion)
    return np.ravel(motion.rotation(output.relative_to).T @ found if output.relative_to else found)


def _of_frame(output: Output, motion: Kinematics) -> np.ndarray:
    """Pose or velocity of a point or frame, less those of the frame that it is seen from, in world axes or its own."""
    name, base = output.of, output.relative_to
    match output.kind:
        case "position":
            found = motion.position(name, output.at)
            return found - motion.position(base) if base else found
        case "velocity":
            found = motion.velocity(name, output.at)
            if not base:
                return found
            arm = motion.position(name, output.at) - motion.position(base)
            return found - motion.velocity(base) - cross(motion.angular_velocity(base), arm)
        case "velocimeter":
            return motion.rotation(name).T @ motion.velocity(name, output.at)
        case "gyroscope":
            return motion.rotation(name).T @ motion.angular_velocity(name)
        case "angular_velocity":
            found = motion.angular_velocity(name)
            return found - motion.angular_velocity(base) if base else found
        case "rotation":
            return motion.rotation(name)
    return motion.rotation(name)[:, AXES.index(output.kind)]


def _acceleration(output: Output, motion: Kinematics, acceleration) -> np.ndarray:
    """Acceleration (3,), linear [m/s²] or angular [rad/s²], in world axes or, of an accelerometer, in its own."""
    body = motion.system.frame(output.of).body
    alpha = linear = np.zeros(3)
    if body >= 0:
        alpha, linear = next(found for edge, *found in outward_accelerations(motion, acceleration) if edge.outer == body)
    if output.kind == "angular_acceleration":
        return alpha
    if body >= 0:
        arm, omega = motion.position(output.of, output.at) - motion.x[body], motion.W[body]
        linear = linear + cross(alpha, arm) + cross(omega, cross(omega, arm))
    if output.kind == "acceleration":
        return linear
    felt = linear - np.array(motion.system.scene.gravity)
    return felt if output.kind == "proper_acceleration" else motion.rotation(output.of).T @ felt


def _of_subtree(output: Output, motion: Kinematics) -> np.ndarray:
    """Centre of mass of a body and all that hangs on it, its velocity, or the angular momentum (3,) about it, in world axes.

    SimulationError if they have no mass.
    """
    system = motion.system
    found = {system.frame(output.of).body}
    for edge in system.structure.tree:  # inner bodies first
        if edge.inner in found:
            found.add(edge.outer)
    bodies = sorted(found - {-1})
    masses = [system.Phi[6 * body + 3] for body in bodies]
    if not any(masses):
        raise SimulationError(f"output {output.name!r}: body {output.of!r}, with all that hangs on it, has no mass.")
    total = sum(masses)

    def mean(of_bodies):
        return sum(mass * of_bodies[body] for mass, body in zip(masses, bodies, strict=True)) / total

    if output.kind == "center_of_mass":
        return mean(motion.x)
    u, momentum = mean(motion.u), np.zeros(3)
    if output.kind == "center_of_mass_velocity":
        return u
    place = mean(motion.x)
    for mass, body in zip(masses, bodies, strict=True):
        R = motion.R[body]
        spin = R @ (system.Phi[6 * body : 6 * body + 3] * (R.T @ motion.W[body]))
        momentum = momentum + spin + mass * cross(motion.x[body] - place, motion.u[body] - u)
    return momentum
