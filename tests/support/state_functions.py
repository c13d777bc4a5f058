"""Names of the functions of a state, and the relative difference of their results."""

import numpy as np

OF_Q = "mass_matrix", "gravity_forces", "center_of_mass", "momentum_matrix", "potential_energy"
OF_Q_V = "bias_forces", "coriolis_matrix", "momentum", "kinetic_energy"


def relative(found, expected) -> float:
    """Largest difference relative to the largest entry."""
    return np.abs(np.asarray(found) - expected).max() / max(np.abs(expected).max(), 1e-300)


def names(system) -> list[str]:
    """All functions of a system, for its last frame."""
    frame = list(system.frames)[-1]
    return [*OF_Q, *OF_Q_V, *(f"{name}:{frame}" for name in ("forward_kinematics", "jacobian", "jacobian_rate"))]
