"""Energies of one instant, over numbers or symbols."""

import numpy as np

from gauss.assembly.kinematics import Motion
from gauss.assembly.loads import stretch
from gauss.scene import ElasticLink, JointSpring, Spring
from gauss.tracing import Scalar

PARTING = 1e-10  # rad, lengths of the scene: flanks that just part still touch: what is left in them is lost only afterwards


def kinetic_energy_of_bodies(motion: Motion) -> Scalar:
    """½ vᵀ Φ v [J]."""
    v = motion.quasi_velocities()
    return 0.5 * (v @ (motion.system.Phi * v))


def potential_energy(motion: Motion) -> Scalar:
    """Potential energy of gravity and springs [J]."""
    system = motion.system
    gravity = np.array(system.scene.gravity)
    total = -sum(mass * (gravity @ motion.x[i]) for i, mass in enumerate(system.Phi[3::6]))
    for bound in system.loads:
        load = bound.load
        if isinstance(load, Spring):
            total += 0.5 * load.stiffness * (stretch(load, motion)[1] - load.length) ** 2
        elif isinstance(load, JointSpring):
            total += 0.5 * load.stiffness * (motion.coordinate(load.joint) - load.rest) ** 2
        elif isinstance(load, ElasticLink):
            twist, lead = load.ends(motion)
            unit = system.scale.coordinates[system.column(load.driven)]
            parts = load.touching(twist, lead, PARTING * unit).items()
            total += sum(acts * load.stored(twist, side) for side, acts in parts)
    return total
