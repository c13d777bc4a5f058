"""Steady operating points: speeds at which nothing accelerates, their losses, and their stability."""

from dataclasses import dataclass

import numpy as np

from gauss.rotors.phase import NetworkPhase
from gauss.rotors.reduced import ReducedNetwork

DEPENDENT_ROW = 1e-12  # singular value of rows of sticking links that depend on each other
DIFFERENCE = 1e-2  # of v_0: step of central differences over speeds


@dataclass(frozen=True)
class OperatingPoint:
    """Steady operating point.

    Parameters
    ----------
    reduced : ReducedNetwork
        The network with rigid springs.
    speeds : ndarray, shape (n,)
        Of the shafts [rad/s].
    torques : ndarray, shape (n_l,)
        Q_em of the links [N m].
    stuck : ndarray of bool, shape (n,)
        Shafts that stick at rest.
    eigenvalues : ndarray
        Eigenvalues of the linearised speeds that are free [1/s].
    input, useful, bearings : float
        Power of motors, loads and bearings [W].
    slip_loss, mesh_loss : ndarray, shape (n_l,)
        Power lost in the links [W].

    Examples
    --------
    >>> from gauss import load_rotors, rotors
    >>> drum = load_rotors("gear_runup")
    >>> point = rotors.operating_points(drum)[0]
    >>> round(point.speed("drum"), 3), point.stable
    (50.387, True)
    >>> lost = point.bearings + point.slip_loss.sum() + point.mesh_loss.sum()
    >>> bool(abs(point.input - point.useful - lost) < 1e-9 * point.input)
    True
    """

    reduced: ReducedNetwork
    speeds: np.ndarray
    torques: np.ndarray
    stuck: np.ndarray
    eigenvalues: np.ndarray
    input: float
    useful: float
    bearings: float
    slip_loss: np.ndarray
    mesh_loss: np.ndarray

    @property
    def stable(self) -> bool:
        """Whether it is asymptotically stable."""
        return bool((self.eigenvalues.real < 0).all())

    @property
    def efficiency(self) -> float:
        """Useful power over input, nan without input."""
        return self.useful / self.input if self.input > 0 else float("nan")

    def speed(self, shaft) -> float:
        """Speed of a shaft [rad/s]."""
        return float(self.speeds[self.reduced.shaft_place(shaft)])

    def slip(self, link) -> float:
        """Slip 1 − i ω_driven/ω_driver (III.73) of a link; nan where the driver stands."""
        b = self.reduced.link_place(link)
        v_d = self.speeds[self.reduced.driver[b]]
        return float(1.0 - self.reduced.links[b].ratio * self.speeds[self.reduced.driven[b]] / v_d) if v_d else float("nan")


def point_of(phase: NetworkPhase, t: float, w: np.ndarray) -> OperatingPoint:
    """Operating point of a phase in which nothing accelerates."""
    reduced = phase.reduced
    found = phase.instant(t, np.zeros_like(w), w)
    free = np.flatnonzero(phase.mode.direction != 0)
    A = slopes(phase, t, w)[np.ix_(free, free)]
    rows = [lock.row[free] for lock in phase.locks if lock.kind == "link"]
    if rows and free.size:  # sticking links are constraints: deviations in their null space only
        _, s, Vt = np.linalg.svd(np.array(rows))
        basis = Vt[int((s > DEPENDENT_ROW).sum()) :].T
        A = basis.T @ A @ basis
    motor, load, loss = found.power
    return OperatingPoint(
        reduced,
        reduced.K * w[reduced.group],
        phase.link_torques(found),
        phase.standing()[reduced.group],
        np.linalg.eigvals(A) if A.size else np.zeros(0),
        float(motor),
        float(-load),
        float(-loss),
        found.slipped,
        found.meshed,
    )


def slopes(phase: NetworkPhase, t: float, w: np.ndarray) -> np.ndarray:
    """∂ω̇/∂ω of the roots in a mode, by central differences."""
    size = DIFFERENCE * phase.reduced.v_0
    columns = []
    for k in range(len(w)):
        step = size * (np.arange(len(w)) == k)
        ahead, back = (phase.instant(t, np.zeros_like(w), w + sign * step).acceleration for sign in (1.0, -1.0))
        columns.append((ahead - back) / (2 * size))
    return np.array(columns).T
