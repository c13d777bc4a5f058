"""Control of the step: error allowed, error found, length of the next step and of the first.

Hairer, Nørsett, Wanner, Solving Ordinary Differential Equations I, 2nd ed., II.4.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gauss import math
from gauss.codegen import Scalar
from gauss.integrators.step import Chart, Cost, Equations, Point
from gauss.system import State, System, sizes

SAFETY = 0.75  # of the step that would just do: DOP853 is refused a twelfth of its steps, with 0.9 a fifth, at the same cost
SLOWEST, FASTEST = 0.2, 10.0  # of the next step against this one
TINY, HUGE = 1e-300, 1e300
SHORT = 1e-6  # times of the scene: first step where nothing tells how long it may be
STILL = 1e-15  # slopes, in these times, below which nothing moves
SMALL = 1e-5  # size of a state, or of its slope, beside its tolerance: below, nothing can be told from them


@dataclass(frozen=True)
class Tolerance:
    """Local error allowed on coordinates and rates: atol + rtol · size.

    Parameters
    ----------
    rtol : float
        Relative to the coordinate or rate.
    atol : float
        Of coordinates [rad, m].
    atol_rates : float
        Of their rates [rad/s, m/s].
    shares : ndarray, shape (2, n_v), optional
        What both are multiplied with, for each coordinate and each rate.
    least : float
        Smallest of the shares, where they are tolerances and not units of the scene.
    """

    rtol: Scalar
    atol: Scalar
    atol_rates: Scalar
    shares: np.ndarray | None = None
    least: float = 1.0

    @cached_property
    def key(self) -> str:
        """What tells it from others once numbers are given."""
        return "" if self.shares is None else f" {self.shares.tolist()}"

    def share(self, system: System) -> float:
        """Largest error allowed of a coordinate, in units of the scene, where that is all it moves."""
        shares = np.ones((2, system.n_v)) if self.shares is None else self.shares
        return float(self.rtol + self.atol * np.max(shares[0] / system.scale.coordinates, initial=0.0))

    def scale(self, system: System, state: State) -> np.ndarray:
        """Allowed error (2 n_v,) of (θ, v)."""
        shares = np.ones((2, system.n_v)) if self.shares is None else self.shares
        coordinates = self.atol * shares[0] + self.rtol * sizes(system, state.q)
        return np.concatenate([coordinates, self.atol_rates * shares[1] + self.rtol * np.abs(state.v)])


@dataclass(frozen=True)
class TrialStep:
    """A step that was tried.

    Parameters
    ----------
    point : Point
        Where it leads.
    error : float
        Its error over the error allowed.
    factor : float
        Length of the next step over that of this one.
    kept : ndarray
        What dense output needs.
    cost : Cost
        What it took.
    """

    point: Point
    error: Scalar
    factor: Scalar
    kept: np.ndarray
    cost: Cost

    @property
    def accepted(self) -> bool:
        """Whether the estimated error is within the tolerance."""
        return bool(self.error <= 1.0)


def next_factor(error: Scalar, order: int) -> Scalar:
    """Length of the next step over that of this one, whose error is of an order: h^(order)."""
    factor = math.clip(SAFETY / _root(math.maximum(error, TINY), order), SLOWEST, math.where(error <= 1.0, FASTEST, 1.0))
    return math.where(error <= HUGE, factor, SLOWEST)  # not a number is no small error


def _root(x: Scalar, order: int) -> Scalar:
    """Root of an order; square roots where these do, as they are cheaper."""
    if order % 2 == 0:
        return _root(np.sqrt(x), order // 2)
    return x if order == 1 else np.exp(np.log(x) / order)


def first_step(equations: Equations, point: Point, tolerance: Tolerance, order: int) -> Scalar:
    """Step to begin with, from sizes of the first and second derivative (section "Starting step size")."""
    system = equations.system
    chart = Chart(equations, point.state)
    y = chart.start(point)
    scale = tolerance.scale(system, point.state)
    norm = lambda part: np.sqrt(np.sum((part[: scale.size] / scale) ** 2) / scale.size)  # noqa: E731
    slope = chart.rate(y, point.rates)
    size = norm(np.concatenate([sizes(system, point.state.q), point.state.v]))
    T = system.scale.time  # in which the formula, which adds first and second derivatives up, counts time
    d1 = T * norm(slope)
    h = T * math.where(math.minimum(size, d1) < SMALL, SHORT, 0.01 * size / math.maximum(d1, SMALL))
    d2 = T * T * norm(chart(point.state.t + h, y + h * slope) - slope) / h
    largest = math.maximum(d1, d2)
    free = math.maximum(SHORT, h * (1e-3 / T))
    longest = T * math.where(largest <= STILL, free, _root(0.01 / math.maximum(largest, TINY), order))
    return math.minimum(100 * h, longest)
