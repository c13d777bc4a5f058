"""Energies of one state, over numbers or symbols: T = ½ vᵀ Φ v, V of gravity and springs, T + V − W."""

import numpy as np

from gauss import math
from gauss.codegen import Scalar
from gauss.dynamics.kinematics import Kinematics
from gauss.dynamics.loads import stretch
from gauss.scene import ElasticLink, JointSpring, Spring
from gauss.system import System

PARTING = 1e-10  # rad, lengths of the scene: backlash sides closer than this still touch, and keep their elastic energy


def kinetic_energy_of_bodies(motion: Kinematics) -> Scalar:
    """½ vᵀ Φ v [J]."""
    v = motion.quasi_velocities()
    return 0.5 * (v @ (motion.system.Phi * v))


def potential_energy(motion: Kinematics) -> Scalar:
    """Potential energy of gravity and springs [J]."""
    return sum(stored_energies(motion), start=-sum(_lifted(motion)))


def look_at_energies(motion: Kinematics, work) -> np.ndarray:
    """Kinetic energy, potential energy, their sum less the work, and the scale of their round-off (4,) [J].

    The scale is the sum of the absolute terms of the potential energy, with a least height of each body by its size.

    ``work`` (3,): work of drives and of forces on bodies, and energy dissipated, since the start [J].
    """
    lifted, stored = _lifted(motion), stored_energies(motion)
    potential = sum(stored, start=-sum(lifted))
    magnitude = sum(math.abs(part) for part in (*lifted, *stored)) + least_magnitude(motion.system)
    return energy_sample(kinetic_energy_of_bodies(motion), potential, magnitude, work)


def energy_sample(kinetic: Scalar, potential: Scalar, magnitude: Scalar, work) -> np.ndarray:
    """Energy sample (4,) of :func:`look_at_energies`."""
    return np.array([kinetic, potential, kinetic + potential - work[0] - work[1] + work[2], magnitude])


def least_magnitude(system: System) -> Scalar:
    """Potential energy of all bodies at heights of their radii of gyration [J]."""
    gravity, Phi = np.array(system.scene.gravity), system.Phi
    thick = [math.sqrt(mass * sum(Phi[6 * i : 6 * i + 3])) for i, mass in enumerate(Phi[3::6])]  # mass × radius of gyration
    return math.sqrt(gravity @ gravity) * sum(thick)


def _lifted(motion: Kinematics) -> list[Scalar]:
    """Work of gravity on the way of each body from the origin [J]."""
    gravity = np.array(motion.system.scene.gravity)
    return [mass * (gravity @ motion.x[i]) for i, mass in enumerate(motion.system.Phi[3::6])]


def stored_energies(motion: Kinematics) -> list[Scalar]:
    """Energy in each spring [J]."""
    energies = []
    for load in (bound.load for bound in motion.system.loads):
        if isinstance(load, Spring):
            energies.append(0.5 * load.stiffness * (stretch(load, motion)[1] - load.length) ** 2)
        elif isinstance(load, JointSpring):
            energies.append(0.5 * load.stiffness * (motion.coordinate(load.joint) - load.rest) ** 2)
        elif isinstance(load, ElasticLink):
            twist, lead = load.ends(motion)
            unit = motion.system.scale.coordinates[motion.system.column(load.driven)]
            parts = load.touching(twist, lead, PARTING * unit).items()
            energies.append(sum(acts * load.stored(twist, side) for side, acts in parts))
    return energies
