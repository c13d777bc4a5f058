"""Energy along a motion: T + V − work of drives and loads + dissipated = const."""

import time
import warnings
from dataclasses import dataclass

import numpy as np

from gauss.assembly import kinematics, potential_energy
from gauss.assembly import kinetic_energy_of_bodies as kinetic_energy
from gauss.errors import BalanceWarning, require
from gauss.shapes import Shaped
from gauss.simulation.trajectory import Trajectory

WRONG = 1e-3  # of the largest energy: a balance that is off by more means a motion that is wrong
ROUNDING = 1e-9  # of the potential energy: what is at rest has no other scale
STILL = 1e-20  # of the energy of the scene: what is held at rest moves no less than that
SHARE = 0.02  # of the time of a simulation that a look at its energies may take
LOOKS, THOROUGH = 5, 60  # samples that are looked at, and again where these are off: few may miss the largest energy


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
        """T + V − work + dissipated, less its value at the start: zero but for the error of the integration."""
        total = self.kinetic + self.potential - self.drives - self.loads + self.dissipated
        return total - total[0]

    @property
    def scale(self) -> float:
        """Largest kinetic energy or change of potential energy: what the balance should be compared with [J]."""
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
        Kinetic and potential energy, work of drives and loads, what was dissipated, and the balance, (k,) each [J].

    Raises
    ------
    ArgumentError
        If it is no motion.
    """
    require(trajectory, (Trajectory,), "energy")
    both = trajectory.sampled("energies", lambda motion: np.array([kinetic_energy(motion), potential_energy(motion)]))
    return Energy(*both.T, *trajectory.work.T)


def warn_of_balance(found: Energy, unit: float = 0.0, stacklevel: int = 3):
    """Warn where the balance is off by more than a thousandth of the energies, as no motion that is solved well is.

    Parameters
    ----------
    found : Energy
        Of a motion.
    unit : float
        Energy of the scene, beside which what is left at rest is small [J].
    stacklevel : int
        How many calls up is whom to tell.

    Warns
    -----
    BalanceWarning
        With what it is off by.
    """
    if _is_off(found, unit):
        warnings.warn(
            f"the energy balance is off by {np.abs(found.balance).max():.3g} J of {found.scale:.3g} J: give a smaller step "
            "or tolerance, or another integrator.",
            BalanceWarning,
            stacklevel=stacklevel,
        )


def watch_balance(trajectory: Trajectory, seconds: float):
    """Look at the balance of a few samples if that takes no more than a fiftieth of the time that the motion took.

    Parameters
    ----------
    trajectory : Trajectory
        What was simulated.
    seconds : float
        How long that took [s].

    Warns
    -----
    BalanceWarning
        As :func:`warn_of_balance`, where more samples confirm what a few say.
    """
    if trajectory.system.dynamics is None or len(trajectory) < 2:
        return
    cost = trajectory.system.dynamics.on_demand("time of an energy", lambda: _seconds_of_a_look(trajectory))
    if 2.0 * cost > SHARE * seconds:
        return
    looks = min(LOOKS, int(SHARE * seconds / cost))
    unit = trajectory.system.scale.energy
    if _is_off(_looked_at(trajectory, looks), unit):
        warn_of_balance(_looked_at(trajectory, THOROUGH), unit, stacklevel=4)


def _is_off(found: Energy, unit: float) -> bool:
    return not np.abs(found.balance).max() <= max(
        WRONG * found.scale, ROUNDING * np.abs(found.potential).max(), STILL * unit
    )


def _looked_at(trajectory: Trajectory, looks: int) -> Energy:
    """Energies of some samples, spread over the motion."""
    rows = np.unique(np.linspace(0, len(trajectory) - 1, looks).round().astype(int))
    motions = [kinematics(trajectory.system, trajectory.state(row)) for row in rows]
    both = np.array([[kinetic_energy(motion), potential_energy(motion)] for motion in motions])
    return Energy(*both.T, *trajectory.work[rows].T)


def _seconds_of_a_look(trajectory: Trajectory) -> float:
    began = time.perf_counter()
    _looked_at(trajectory, 1)
    return time.perf_counter() - began
