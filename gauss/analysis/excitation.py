"""Excitation trajectories for identification: Fourier series whose regressor has the least condition number within limits.

    q_i(t) = q̄_i + s Σ_k (a_ik sin(kωt) − b_ik cos(kωt)) / (kω),   k = 1 … n

is periodic, so that samples of periods average out noise (Swevers, Ganseman, Tükel, De Schutter, Van Brussel, Optimal robot
excitation and identification, IEEE Trans. Robotics and Automation 13(5), 1997). The factor s scales each coordinate to its
limits; the condition number of the base columns in their units is minimised (Gautier and Khalil, Exciting trajectories for
the identification of base inertial parameters of robots, IJRR 11(4), 1992). With loops the series are those of independent
coordinates; the others follow, and the regressor is projected.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from gauss.analysis.base_parameters import base_of, random_matrix
from gauss.analysis.closed_samples import ClosedSamples
from gauss.analysis.regressor import RegressorModel
from gauss.arguments import generator, named_arguments, table
from gauss.dynamics.projection import limits_and_stops
from gauss.errors import ArgumentError, SimulationError, StateError, did_you_mean, require
from gauss.scene import Scene
from gauss.simulation.tolerances import check_tolerances
from gauss.system import System

SAMPLES = 10  # of a period, for each harmonic: they resolve its extremes to 5 % of the limits, which are kept by MARGIN
MARGIN = 1.0 / 0.95
NOT_CLOSED = 690.0  # value of series along which loops do not close: near the logarithm of the largest number
LARGEST_TRANSMISSION = 100.0  # rate of a dependent coordinate over that of an independent one, in units; near-singular above
LIMITS = (1.0, 2.0, 10.0)  # of coordinates about their centre, rates and accelerations where none are given [rad or m, s]


@dataclass(frozen=True)
class Excitation:
    """A periodic motion that excites the parameters of a system.

    Parameters
    ----------
    coordinates : tuple of str
        Names of the coordinates: all, or the independent ones.
    centre : ndarray, shape (n,)
        Constant parts q̄ [rad, m].
    sines, cosines : ndarray, shape (n, harmonics)
        Amplitudes s a and s b of the rates [rad/s, m/s].
    frequency : float
        Frequency ω of the first harmonic [rad/s].
    condition : float
        Condition number of the base columns of the regressor over a period, in the units of the scene.
    random_condition : float
        Median of this number over the random series from which it was sought.
    """

    coordinates: tuple[str, ...]
    centre: np.ndarray
    sines: np.ndarray
    cosines: np.ndarray
    frequency: float
    condition: float
    random_condition: float

    @property
    def period(self) -> float:
        """Period [s]."""
        return 2.0 * np.pi / self.frequency

    def at(self, t) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Coordinates, rates and accelerations (k, n) at times (k,) [s]."""
        q, v, a = _series(np.asarray(t, dtype=float), self.frequency, self.sines, self.cosines)
        return self.centre + q, v, a


@named_arguments
def excitation(
    system: System | Scene,
    period: float,
    *,
    harmonics: int = 5,
    independent: Sequence[str] | None = None,
    limits: Mapping[str, tuple[tuple[float, float], float, float]] | None = None,
    friction=(),
    trials: int = 20,
    seed: int = 0,
) -> Excitation:
    """Periodic motion within limits that identifies the base parameters of a system best.

    Parameters
    ----------
    system : System or Scene
        A system without ball joints and free bodies; with loops, among its independent coordinates.
    period : float
        Period [s].
    harmonics : int
        Number of harmonics of each coordinate.
    independent : sequence of str, optional
        Independent coordinates of a system with loops, as of :func:`gauss.regressor`; poses are on the branch of its start.
    limits : mapping of str to ((float, float), float, float), optional
        Least and largest coordinate, largest rate and acceleration of each joint [rad, m, s]; when not given, the limits and
        stops of the joint, or one about the reference configuration, with loops about the start, with 2/s and 10/s².
    friction : sequence of str
        Joints whose friction is to be found, see :func:`gauss.identify`.
    trials : int
        Random series, of which the best is improved.
    seed : int
        Seed of these.

    Returns
    -------
    Excitation
        The series; ``at(t)`` gives the motion.

    Raises
    ------
    ArgumentError
        If an argument does not fit.
    SimulationError
        If joints turn about any axis, by name, the duration is no positive number, or loops do not close within the limits.
    StateError
        If independent coordinates do not determine the others.

    Examples
    --------
    >>> import gauss
    >>> series = gauss.excitation(gauss.load("double_pendulum"), 5.0, harmonics=3, trials=5)
    >>> bool(series.condition < series.random_condition)
    True
    """
    require(system, (System, Scene), "excitation")
    check_tolerances(duration=period, step=period)
    for name, value in (("harmonics", harmonics), ("trials", trials)):
        if not isinstance(value, int) or value < 1:
            raise ArgumentError(f"excitation: {name}: expected a number ≥ 1, got {value!r}.")
    model = RegressorModel(system, independent, friction)
    problem = _SeriesProblem(model, period, harmonics, limits)
    rng = generator(seed, "excitation")
    starts = rng.normal(size=(trials, 2 * harmonics * problem.n))
    found = np.array([problem.value(start) for start in starts])
    if found.min() >= NOT_CLOSED:
        raise SimulationError(
            f"excitation: within the limits of {', '.join(problem.names)} the loops of scene {model.system.scene.name!r} do "
            "not close, are near-singular, or pass limits or stops of other joints; narrow them by limits=."
        )
    first = starts[int(np.argmin(found))]
    best = minimize(problem.value, first, method="L-BFGS-B", options={"maxiter": 15 * problem.n}).x
    sines, cosines = problem.scaled(best)
    condition, usual = float(np.exp(problem.value(best))), float(np.exp(np.median(found[found < NOT_CLOSED])))
    return Excitation(problem.names, problem.centre, sines, cosines, problem.frequency, condition, usual)


class _SeriesProblem:
    """Logarithm of the condition number, as a function of the amplitudes."""

    def __init__(self, model: RegressorModel, period: float, harmonics: int, limits):
        system = model.system
        wide = [joint.name for joint in system.joints if joint.pair.quaternion is not None and _moves(joint, model.places)]
        if wide:
            raise SimulationError(
                f"excitation: scene {system.scene.name!r} turns about any axis in {', '.join(wide)}, whose angles are no "
                "series; give motions of your own."
            )
        self.model, self.names, self.n = model, model.rows, len(model.rows)
        self.samples = ClosedSamples(system, system.initial_state(), model.places) if system.has_closures else None
        self.base = list(base_of(model, random_matrix(model, 0)).base)
        self.frequency = 2.0 * np.pi / period
        self.t = np.linspace(0.0, period, SAMPLES * harmonics, endpoint=False)
        self.bounds = limits_and_stops(system)
        self.centre, self.largest = self._limits(
            table(limits, "excitation: limits", "((least, largest), speed, acceleration) by name")
        )

    def _limits(self, given: dict) -> tuple[np.ndarray, np.ndarray]:
        """Centres (n,), and largest displacements, rates and accelerations (3, n)."""
        system, samples = self.model.system, self.samples
        middles = system.reference.q if samples is None else samples.start.q[samples.entries]
        for name in given:
            if name not in self.names:
                raise ArgumentError(f"excitation: limits of {name!r}. {did_you_mean(name, self.names)}")
        centre, largest = np.zeros(self.n), np.zeros((3, self.n))
        for k, name in enumerate(self.names):
            least, most = (float(bound[self.model.places[k]]) for bound in self.bounds)
            (low, high), rate, acceleration = given.get(name, (_range(least, most, middles[k]), LIMITS[1], LIMITS[2]))
            if low < least or high > most:
                raise ArgumentError(f"excitation: limits of {name!r}: ({low:g}, {high:g}) passes {least:g} or {most:g}.")
            if not (low < high and rate > 0.0 and acceleration > 0.0):
                raise ArgumentError(f"excitation: limits of {name!r}: expected ((low, high), rate, acceleration).")
            centre[k], largest[:, k] = 0.5 * (low + high), (0.5 * (high - low), rate, acceleration)
        return centre, largest

    def scaled(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Amplitudes (n, harmonics) of the largest series within the limits."""
        sines, cosines = x.reshape(2, self.n, -1)
        parts = _series(self.t, self.frequency, sines, cosines)
        sizes = np.array([np.abs(part).max(axis=0) for part in parts])
        factor = (self.largest / (MARGIN * np.maximum(sizes, np.finfo(float).tiny))).min(axis=0)
        return sines * factor[:, None], cosines * factor[:, None]

    def value(self, x: np.ndarray) -> float:
        """Logarithm of the condition number."""
        q, v, a = _series(self.t, self.frequency, *self.scaled(x))
        try:
            matrix = self._matrix(self.centre + q, v, a)
        except StateError:  # the independent coordinates do not determine the others
            return NOT_CLOSED
        if matrix is None:
            return NOT_CLOSED
        rows = matrix[:, :, self.base] * self.model.units[self.base]
        rows = rows / self.model.row_units[:, None]
        sizes = np.linalg.svd(rows.reshape(-1, len(self.base)), compute_uv=False)
        return float(np.log(sizes[0] / max(sizes[-1], 1e-300)))

    def _matrix(self, *motion: np.ndarray) -> np.ndarray | None:
        """Regressors (k, n, p) of samples (k, n); None where loops do not close, or are near-singular."""
        if self.samples is None:
            return self.model.matrix(*motion)
        system, places = self.model.system, self.model.places
        q, closed = self.samples.poses(motion[0])
        if not closed.all() or not self._within(q):
            return None
        v, a = (np.zeros((len(q), system.n_v)) for _ in range(2))
        v[:, places], a[:, places] = motion[1:]
        scale = system.scale.coordinates
        N = system.null_space(q, independent=self.model.independent) / scale[:, None] * scale[places]
        return None if np.abs(N).max() > LARGEST_TRANSMISSION else self.model.matrix(q, v, a)

    def _within(self, q: np.ndarray) -> bool:
        """Whether dependent joints of one freedom keep their limits."""
        (least, largest), joints = self.bounds, self.model.system.joints
        plain = [(one.q.start, one.v.start) for one in joints if one.pair.n_v == 1]
        return all((least[k] <= q[:, entry]).all() and (q[:, entry] <= largest[k]).all() for entry, k in plain)


def _range(least: float, most: float, middle: float) -> tuple[float, float]:
    """Bounds of a coordinate; on sides without any those of a range about the middle."""
    low = least if least > -np.inf else min(middle, most) - LIMITS[0]
    return low, most if most < np.inf else max(middle, low) + LIMITS[0]


def _moves(joint, places) -> bool:
    """Whether rates of a joint are among some places in v."""
    return any(joint.v.start <= place < joint.v.stop for place in places)


def _series(t: np.ndarray, frequency: float, sines: np.ndarray, cosines: np.ndarray) -> tuple[np.ndarray, ...]:
    """Displacements, rates and accelerations (k, n) of a series."""
    omega = frequency * np.arange(1, sines.shape[1] + 1)
    s, c = np.sin(np.outer(t, omega)), np.cos(np.outer(t, omega))
    return (
        (s / omega) @ sines.T - (c / omega) @ cosines.T,
        c @ sines.T + s @ cosines.T,
        (c * omega) @ cosines.T - (s * omega) @ sines.T,
    )
