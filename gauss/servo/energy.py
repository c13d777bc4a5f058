"""Energy balance under servos: dT − dU = work of loads + Σ u W q̇ dt, with each reaction of the second kind listed.

The reactions of contacts drop out, those of servos do not unless W q̇ = 0: T − U is kept only where the actual motion is
among the displacements on which the servo reactions do no work.
"""

from dataclasses import dataclass, fields

import numpy as np

from gauss.analysis import Energy
from gauss.analysis import energy as energy_of
from gauss.servo.tracking import Tracking
from gauss.shapes import Shaped


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
    """
    found = energy_of(tracking.motion)
    parts = {field.name: getattr(found, field.name) for field in fields(found)}
    parts["drives"] = found.drives - tracking.work.sum(axis=1)
    return ServoEnergy(**parts, servos=tracking.work)
