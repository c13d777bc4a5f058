"""Energy along a motion: T + V − work of drives and loads + dissipated = const."""

from dataclasses import dataclass

import numpy as np

from gauss.dynamics.energies import kinetic_energy_of_bodies, potential_energy
from gauss.errors import require
from gauss.shapes import Shaped
from gauss.simulation.trajectory import Trajectory


@dataclass(frozen=True)
class Energy:
    """Energies at every sample [J].

    Parameters
    ----------
    kinetic, potential : ndarray, shape (k,)
        Of the bodies; of gravity (zero at the world's origin) and springs.
    drives, loads : ndarray, shape (k,)
        Work of drives and of forces on bodies since the start.
    dissipated : ndarray, shape (k,)
        Energy lost in dampers since the start.
    """

    kinetic: Shaped[np.ndarray, " k"]
    potential: Shaped[np.ndarray, " k"]
    drives: Shaped[np.ndarray, " k"]
    loads: Shaped[np.ndarray, " k"]
    dissipated: Shaped[np.ndarray, " k"]

    @property
    def balance(self) -> Shaped[np.ndarray, " k"]:
        """T + V − work + dissipated minus its initial value: the error of the integration."""
        total = self.kinetic + self.potential - self.drives - self.loads + self.dissipated
        return total - total[0]

    @property
    def scale(self) -> float:
        """Largest kinetic energy or change of potential energy: the scale of the balance [J]."""
        return float(max(self.kinetic.max(), np.ptp(self.potential)))


def energy(trajectory: Trajectory) -> Energy:
    """Energies at every sample of a trajectory.

    Parameters
    ----------
    trajectory : Trajectory
        The motion.

    Returns
    -------
    Energy
        Kinetic, potential and dissipated energy, work of drives and loads, and the balance, (k,) each [J].

    Raises
    ------
    ArgumentError
        If the argument is no trajectory.
    """
    require(trajectory, (Trajectory,), "energy")
    both = trajectory.sampled(
        "energies", lambda motion: np.array([kinetic_energy_of_bodies(motion), potential_energy(motion)])
    )
    of_states = _energy_of_states(trajectory)
    kinetic, potential = both.T
    drives, loads, dissipated = trajectory.work.T.copy()  # the user may write to them
    return Energy(kinetic - of_states, potential, drives - (of_states - of_states[:1]), loads, dissipated)


def _energy_of_states(trajectory: Trajectory) -> np.ndarray:
    """½ x² (k,) of states of one's own, which bodies stand for: neither energy of the mechanism nor work of its drives."""
    columns = [trajectory.system.column(name) for name in trajectory.system.scene.states]
    return 0.5 * (trajectory.v[:, columns] ** 2).sum(axis=1)
