"""Motion under servos: trajectory, efforts, work and residuals; its energy balance dT − dU = work of loads + Σ u W q̇ dt.

The reactions of contacts drop out of the balance, those of servos do not unless W q̇ = 0: T − U is kept only where the actual
motion is among the displacements on which the servo reactions do no work.
"""

from dataclasses import dataclass, fields

import numpy as np

from gauss.analysis import Energy
from gauss.analysis import energy as energy_of
from gauss.errors import StateError, did_you_mean, require
from gauss.servo.servo import Servo
from gauss.servo.verdict import Verdict
from gauss.shapes import Shaped
from gauss.simulation import Trajectory
from gauss.versions import FormerAttribute, warn_of_former_name


@dataclass(frozen=True)
class Tracking:
    """Motion of a system whose relations are held by servos.

    Parameters
    ----------
    servo : Servo
        The servo.
    motion : Trajectory
        The motion; the work of the servos is part of that of the drives.
    efforts : ndarray, shape (k, j)
        Efforts u along their directions [N, N m], in the order of ``servo.efforts``.
    work : ndarray, shape (k, j)
        Work of each effort since the start [J].
    residuals : ndarray, shape (k, r)
        Residual of each relation at its own level, in the order of ``servo.held``.
    smallest : ndarray, shape (k,)
        Smallest singular value of the normalised S, distance from a loss of rank.
    verdict : Verdict
        Verdict of the start.

    Examples
    --------
    >>> import gauss
    >>> from gauss import servo
    >>> held = gauss.load("servo/inverted_pendulum")
    >>> run = servo.simulate(held, 0.05)
    >>> run.efforts.shape == (len(run), 1), bool(abs(run.residuals).max() < 1e-9)
    (True, True)
    """

    servo: Servo
    motion: Trajectory
    efforts: Shaped[np.ndarray, "k j"]
    work: Shaped[np.ndarray, "k j"]
    residuals: Shaped[np.ndarray, "k r"]
    smallest: Shaped[np.ndarray, " k"]
    verdict: Verdict

    @property
    def t(self) -> np.ndarray:
        """Times (k,) [s]."""
        return self.motion.t

    def __len__(self):
        return len(self.motion)

    def __repr__(self):
        return f"Tracking({self.motion!r}, holding {', '.join(self.servo.held)} by {', '.join(self.servo.efforts)})"

    def effort(self, name: str) -> np.ndarray:
        """Effort (k,) of this name [N, N m]."""
        return self.efforts[:, _index(name, self.servo.efforts, "effort")]

    def residual(self, name: str) -> np.ndarray:
        """Residual (k,) of the relation of this name."""
        return self.residuals[:, _index(name, self.servo.held, "relation")]

    def gap(self, name: str) -> np.ndarray:
        """Former name of :meth:`residual`."""
        warn_of_former_name("Tracking.gap", "Tracking.residual")
        return self.residual(name)

    gaps = FormerAttribute("residuals")


def _index(name: str, names: tuple[str, ...], what: str) -> int:
    if name not in names:
        raise StateError(f"no {what} {name!r}. {did_you_mean(name, names)}")
    return names.index(name)


@dataclass(frozen=True)
class ServoEnergy(Energy):
    """Energies at every sample [J]; those of drives without the servos.

    Parameters
    ----------
    servos : ndarray, shape (k, j)
        Work of each effort since the start, in the order of ``servo.efforts``.

    Examples
    --------
    >>> import gauss
    >>> from gauss import servo
    >>> held = gauss.load("servo/inverted_pendulum")
    >>> found = servo.energy(servo.simulate(held, 0.05))
    >>> bool(abs(found.balance).max() < 1e-9)
    True
    """

    servos: Shaped[np.ndarray, "k j"]

    @property
    def balance(self) -> Shaped[np.ndarray, " k"]:
        """T + V − all work + dissipated, less its value at the start: the error of the integration."""
        total = self.kinetic + self.potential - self.drives - self.loads - self.servos.sum(axis=1) + self.dissipated
        return total - total[0]

    @property
    def scale(self) -> float:
        """Largest kinetic energy, change of potential energy or work of an effort [J]."""
        return float(max(super().scale, np.abs(self.servos).max(initial=0.0)))


def energy(tracking: Tracking) -> ServoEnergy:
    """Energies at every sample of a motion under servos.

    Parameters
    ----------
    tracking : Tracking
        The motion.

    Returns
    -------
    ServoEnergy
        Energies (k,) [J].

    Raises
    ------
    ArgumentError
        If it is no motion under servos.
    """
    require(tracking, (Tracking,), "servo.energy")
    found = energy_of(tracking.motion)
    parts = {field.name: getattr(found, field.name) for field in fields(found)}
    parts["drives"] = found.drives - tracking.work.sum(axis=1)
    return ServoEnergy(**parts, servos=tracking.work)
