"""Motion of a rotor network: samples, events, energies, run-up times."""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicHermiteSpline
from scipy.optimize import brentq

from gauss.dynamics import Plan
from gauss.errors import StateError
from gauss.rotors.events import RotorEvent
from gauss.rotors.reduced import ReducedNetwork

FRACTION = 0.95  # of the last speed: default end of a run-up


@dataclass(frozen=True)
class RotorEnergy:
    """Energies since the start [J], each (k,): input = useful + heat + kinetic + elastic.

    Parameters
    ----------
    input : ndarray
        Work of motors.
    useful : ndarray
        Work taken by loads, dry friction of shafts among them.
    bearings : ndarray
        Heat of torques whose role is "loss".
    slip, mesh : ndarray
        Heat of links by slip or damping, and by their efficiencies.
    kinetic, elastic : ndarray
        Change of the energies of motion and of springs.

    Examples
    --------
    >>> from gauss import load_rotors, rotors
    >>> drum = load_rotors("gear_runup")
    >>> run = rotors.simulate(drum, 0.5, times=[0.0, 0.5])
    >>> energy = run.energy()
    >>> energy.kinetic.round(2), bool(abs(energy.balance).max() < 1e-9 * energy.scale)
    (array([  0.  , 274.26]), True)
    """

    input: np.ndarray
    useful: np.ndarray
    bearings: np.ndarray
    slip: np.ndarray
    mesh: np.ndarray
    kinetic: np.ndarray
    elastic: np.ndarray

    @property
    def heat(self) -> np.ndarray:
        """All heat (k,)."""
        return self.bearings + self.slip + self.mesh

    @property
    def balance(self) -> np.ndarray:
        """Residual of the energy balance (k,): input − useful − heat − kinetic − elastic."""
        return self.input - self.useful - self.heat - self.kinetic - self.elastic

    @property
    def scale(self) -> float:
        """Scale of the balance: the largest of all these energies."""
        return max(np.abs(getattr(self, key)).max() for key in self.__dataclass_fields__)


@dataclass(frozen=True)
class RotorStats:
    """Cost of a run: evaluations, steps, wall time [s], and the plan of its equations."""

    evaluations: int
    steps: int
    wall_time: float
    plan: Plan


@dataclass(frozen=True)
class RotorMotion:
    """Motion of a rotor network; at a switch or event accelerations and torques are those just after it.

    Parameters
    ----------
    reduced : ReducedNetwork
        The network in minimal coordinates; ``reduced.network`` is that of the user.
    t : ndarray, shape (k,)
        Times [s].
    angles, speeds, accelerations : ndarray, shape (k, n)
        Of the shafts [rad], [rad/s], [rad/s²].
    torques : ndarray, shape (k, n_l)
        Torque Q_em of each link on its driven shaft [N m].
    forward : ndarray of bool, shape (k, n_l)
        Whether power flows from driver to driven; meaningful for lossy links.
    work : ndarray, shape (k, 3)
        Work of motors, loads and losses [J].
    slip_heat, mesh_heat : ndarray, shape (k, n_l)
        Heat of each link [J].
    elastic : ndarray, shape (k, n_l)
        Elastic energy of each link [J].
    stuck : ndarray of bool, shape (k, n)
        Shafts stuck at rest: by dry friction of a shaft of their group, or by the losses of its gears.
    events : tuple of RotorEvent
        What happened.
    stats : RotorStats
        What it cost.
    elastic_at_start : float
        Elastic energy of all links at the start of the run [J].

    Examples
    --------
    >>> from gauss import load_rotors, rotors
    >>> drum = load_rotors("gear_runup")
    >>> run = rotors.simulate(drum, 0.5, times=[0.0, 0.5])
    >>> run.speed("drum").round(3), run.torque("belt").round(3)
    (array([0.327, 7.883]), array([85.78 , 97.557]))
    >>> run.t
    array([0. , 0.5])
    """

    reduced: ReducedNetwork
    t: np.ndarray
    angles: np.ndarray
    speeds: np.ndarray
    accelerations: np.ndarray
    torques: np.ndarray
    forward: np.ndarray
    work: np.ndarray
    slip_heat: np.ndarray
    mesh_heat: np.ndarray
    elastic: np.ndarray
    stuck: np.ndarray
    events: tuple[RotorEvent, ...]
    stats: RotorStats
    elastic_at_start: float = 0.0

    def __len__(self):
        return len(self.t)

    def __repr__(self):
        return (
            f"RotorMotion({self.reduced.network.name!r}, {len(self)} samples, {self.t[0]:.6g} … {self.t[-1]:.6g} s, "
            f"{len(self.events)} events)"
        )

    def angle(self, shaft) -> np.ndarray:
        """Angle (k,) of a shaft [rad]."""
        return self.angles[:, self.reduced.shaft_place(shaft)]

    def speed(self, shaft) -> np.ndarray:
        """Speed (k,) of a shaft [rad/s]."""
        return self.speeds[:, self.reduced.shaft_place(shaft)]

    def acceleration(self, shaft) -> np.ndarray:
        """Acceleration (k,) of a shaft [rad/s²]."""
        return self.accelerations[:, self.reduced.shaft_place(shaft)]

    def torque(self, link) -> np.ndarray:
        """Torque (k,) of a link on its driven shaft [N m]."""
        return self.torques[:, self.reduced.link_place(link)]

    def slip(self, link) -> np.ndarray:
        """Slip (k,) 1 − i ω_driven/ω_driver of a link (III.73); NaN while the driver is at rest."""
        b = self.reduced.link_place(link)
        v_d = self.speeds[:, self.reduced.driver[b]]
        v = self.reduced.links[b].ratio * self.speeds[:, self.reduced.driven[b]]
        return 1.0 - np.divide(v, v_d, out=np.full_like(v, np.nan), where=np.abs(v_d) > self.reduced.v_0)

    def loss(self, link) -> np.ndarray:
        """Heat (k,) of a link since the start, by slip and mesh [J]."""
        b = self.reduced.link_place(link)
        return self.slip_heat[:, b] + self.mesh_heat[:, b]

    def energy(self) -> RotorEnergy:
        """Energies since the start."""
        kinetic = 0.5 * self.speeds**2 @ self.reduced.inertia
        elastic = self.elastic.sum(axis=1)
        motor, load, loss = self.work.T
        slip, mesh = self.slip_heat.sum(axis=1), self.mesh_heat.sum(axis=1)
        # counted from the start of the run, which need not be a sample
        first = self.reduced.speed[self.reduced.group] * self.reduced.K
        start = 0.5 * float(first**2 @ self.reduced.inertia)
        return RotorEnergy(motor, -load, -loss, slip, mesh, kinetic - start, elastic - self.elastic_at_start)


def run_up_time(motion: RotorMotion, shaft, speed: float | None = None) -> float:
    """Time [s] at which a shaft first reaches a speed, by cubics through speeds and accelerations of the samples.

    Parameters
    ----------
    motion : RotorMotion
        The motion.
    shaft : str or Shaft
        The shaft.
    speed : float, optional
        [rad/s]; 95 % of the last speed when not given.

    Returns
    -------
    float
        Time [s].

    Raises
    ------
    StateError
        If the shaft never reaches it.
    """
    values, t = motion.speed(shaft), motion.t
    speed = FRACTION * values[-1] if speed is None else float(speed)
    reached = values >= speed if speed >= values[0] else values <= speed
    if not reached.any():
        raise StateError(
            f"the shaft never reaches {speed:g} rad/s: it moves between {values.min():.6g} and {values.max():.6g} rad/s "
            f"within {t[-1]:g} s. Simulate longer, or ask for another speed."
        )
    k = int(np.argmax(reached))
    if k == 0:
        return float(t[0])
    curve = CubicHermiteSpline(t[k - 1 : k + 1], values[k - 1 : k + 1], motion.acceleration(shaft)[k - 1 : k + 1])
    left, right = (float(curve(time)) - speed for time in t[k - 1 : k + 1])
    return float(t[k]) if left * right > 0 or right == 0 else float(brentq(lambda s: curve(s) - speed, t[k - 1], t[k]))
