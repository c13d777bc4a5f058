"""Changes of the accelerations along the tangents of a system in one state, whose digits are checked.

Where bodies of one loop differ in mass by many orders, multipliers lose digits, and accelerations leave the constraints:
those by unit forces along independent coordinates show it.
"""

import numpy as np

from gauss.analysis.derivatives import AccelerationChanges
from gauss.analysis.tangents import Tangents
from gauss.errors import SimulationError
from gauss.system import System

FEW_DIGITS = 1e-5  # share of accelerations by which constraints may be left: derivatives are about as wrong


def changes_along(changes: AccelerationChanges, tangents: Tangents, forces: np.ndarray) -> list[np.ndarray]:
    """Changes of the accelerations by independent displacements (n_v, k), by rates (n_v, l), and by forces (n_v, m).

    SimulationError if they are not determined, or round-off leaves them few digits.
    """
    N, D, rate, zeros = tangents.position, tangents.change, tangents.rate, np.zeros
    (n, k), many, free = N.shape, rate.shape[1], tangents.independent_rates
    pushes = np.concatenate([forces, np.eye(n)[:, free]], axis=1)
    m = pushes.shape[1]
    directions = np.block([[N, zeros((n, many + m))], [D, rate, zeros((n, m))], [zeros((n, k + many)), pushes]])
    found = np.split(changes.along(directions), [k, k + many, k + many + forces.shape[1]], axis=1)
    _refuse_few_digits(changes.system, rate, found.pop(), free)
    return found


def _refuse_few_digits(system: System, rate: np.ndarray, response: np.ndarray, free: list[int]):
    """Refuse accelerations (n_v, l) by unit forces along independent coordinates that leave the constraints by round-off."""
    shares = response / system.scale.coordinates[:, None]
    off = np.abs(shares - (rate / system.scale.coordinates[:, None]) @ response[free]).max(axis=0, initial=0.0)
    if (off > FEW_DIGITS * np.abs(shares).max(axis=0, initial=0.0)).any():
        raise SimulationError(
            f"scene {system.scene.name!r}: the derivatives of its accelerations have too few digits in this state: masses "
            "of one loop differ by too many orders, or the pose is near-singular; give the lightest bodies no mass, or more."
        )
