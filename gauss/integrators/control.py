"""Step-size control: tolerance, step-size factor h_new / h = 0.75 · error^(−1/order) within bounds, and initial step.

Hairer, Nørsett, Wanner, Solving Ordinary Differential Equations I, 2nd ed., II.4. The same functions control steps in
Python, over numbers, and in machine code, over expressions.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gauss import math
from gauss.codegen import Entry, Scalar
from gauss.integrators.step import Chart, Cost, Equations, Point
from gauss.system import State, System, sizes

SAFETY = (
    0.75  # of the step that just meets the tolerance: DOP853 rejects a twelfth of its steps, with 0.9 a fifth, at equal cost
)
SMALLEST_FACTOR, LARGEST_FACTOR = 0.2, 10.0  # next step over this one
STARTING_STEPS = 8.0  # accepted steps in which the step finds its size
LARGEST_LATER_FACTOR = 2.5  # next step over this one after these: an error estimate may be almost zero by chance
SMALLEST_DIVISOR = 1e-300  # added to divisors, and least argument of logarithms
LARGEST_ERROR = 1e300  # larger errors, and NaN, give the smallest factor
SHORTEST_FIRST_STEP = 1e-6  # in units of the time of the scene: initial step where the derivatives do not give one
SHORTEST_TRIAL = (
    1e-9  # in these units: step that estimates the second derivative where a state at rest is zero but for round-off
)
STATIONARY_SLOPE = 1e-15  # norm of the slope in these units below which a state is stationary
SMALLEST_NORM = 1e-5  # norm of a state or slope, relative to its tolerance, below which it gives no initial step


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
        Factors of both absolute tolerances, for each coordinate and each rate.
    least : float
        Smallest of the factors, where these are tolerances and not units of the scene.
    """

    rtol: Entry
    atol: Entry
    atol_rates: Entry
    shares: np.ndarray | None = None
    least: float = 1.0

    @cached_property
    def key(self) -> str:
        """Part of cache keys: machine code depends on the factors, not on the other numbers."""
        return "" if self.shares is None else f" {self.shares.tolist()}"

    def share(self, system: System) -> float:
        """Largest tolerance of a coordinate of size 1, in units of the scene."""
        shares = np.ones((2, system.n_v)) if self.shares is None else self.shares
        return float(self.rtol + self.atol * np.max(shares[0] / system.scale.coordinates, initial=0.0))

    def scale(self, system: System, state: State) -> np.ndarray:
        """Tolerance (2 n_v,) of (θ, v) in a state."""
        shares = np.ones((2, system.n_v)) if self.shares is None else self.shares
        return np.concatenate([self.of_coordinates(sizes(system, state.q), shares[0]), self.of_rates(state.v, shares[1])])

    def of_coordinates(self, size, share):
        """Tolerance of coordinates of a size, with their factors of the absolute tolerance."""
        return self.atol * share + self.rtol * size

    def of_rates(self, v, share):
        """Tolerance of rates, with their factors of the absolute tolerance."""
        return self.atol_rates * share + self.rtol * np.abs(v)


@dataclass(frozen=True)
class TrialStep:
    """Trial step of an adaptive method.

    Parameters
    ----------
    point : Point
        End of the step.
    error : float
        Estimated error over the tolerance.
    factor : float
        Step-size factor: next step over this one.
    kept : ndarray
        Slopes for dense output.
    cost : Cost
        Evaluations and factorisations.
    """

    point: Point
    error: Entry
    factor: Entry
    kept: np.ndarray
    cost: Cost

    @property
    def accepted(self) -> bool:
        """Whether the estimated error is within the tolerance."""
        return bool(self.error <= 1.0)


def next_factor(error: Scalar, order: int, steps: Scalar | None = None) -> Scalar:
    """Step-size factor: length of the next step over that of this one.

    Parameters
    ----------
    error : float
        Estimated error over the tolerance, proportional to h^order.
    order : int
        Order of the estimate.
    steps : float, optional
        Accepted steps so far: after :data:`STARTING_STEPS` of them a step grows by :data:`LARGEST_LATER_FACTOR` at most. No
        such bound where they are not given.
    """
    largest = math.where(error <= 1.0, LARGEST_FACTOR, 1.0)
    factor = math.clip(SAFETY / _root(math.maximum(error, SMALLEST_DIVISOR), order), SMALLEST_FACTOR, largest)
    factor = math.where(error <= LARGEST_ERROR, factor, SMALLEST_FACTOR)  # False for NaN
    return (
        factor if steps is None else math.minimum(factor, math.where(steps < STARTING_STEPS, np.inf, LARGEST_LATER_FACTOR))
    )


def _root(x: Scalar, order: int) -> Scalar:
    """Root of an order; by square roots as far as possible, which are cheaper."""
    if order % 2 == 0:
        return _root(math.sqrt(x), order // 2)
    return x if order == 1 else math.exp(math.log(x) / order)


def first_step(equations: Equations, point: Point, tolerance: Tolerance, order: int) -> Scalar:
    """Initial step [s] from the norms of the first and second derivative (Hairer et al., II.4, "Starting Step Size")."""
    system = equations.system
    chart = Chart(equations, point.state)
    y = chart.start(point)
    scale = tolerance.scale(system, point.state)
    square = lambda part: np.sum((part[: scale.size] / scale) ** 2)  # noqa: E731
    slope = chart.rate(y, point.rates)
    squares = square(np.concatenate([sizes(system, point.state.q), point.state.v])), square(slope)
    h = trial_length(system, *squares)
    change = chart(point.state.t + h, y + h * slope) - slope
    return first_length(system, order, h, squares[1], square(change))


def trial_length(system: System, size: Scalar, slope: Scalar) -> Scalar:
    """Length [s] of the step that estimates the second derivative, from the squared norms of a state and its slope."""
    T = system.scale.time  # the formula compares first and second derivatives: it needs a unit of time
    size, d1 = (np.sqrt(square / (2 * system.n_v)) for square in (size, slope))
    d1 = T * d1
    h = 0.01 * size / math.maximum(d1, SMALLEST_NORM)
    h = math.where(h > SHORTEST_TRIAL, h, SHORTEST_TRIAL)  # of sizes that are not finite, too
    return T * math.where(math.where(size < d1, size, d1) < SMALLEST_NORM, SHORTEST_FIRST_STEP, h)


def first_length(system: System, order: int, h: Scalar, slope: Scalar, change: Scalar) -> Scalar:
    """Initial step [s] from the squared norms of a slope, and of its change in a time h."""
    T = system.scale.time
    d1, d2 = (np.sqrt(square / (2 * system.n_v)) for square in (slope, change))
    d1, d2 = T * d1, T * T * d2 / h
    largest = math.where(d2 > d1, d2, d1)  # without d2 where the trial is not finite
    free = math.maximum(SHORTEST_FIRST_STEP, h * (1e-3 / T))
    longest = T * math.where(largest <= STATIONARY_SLOPE, free, _root(0.01 / math.maximum(largest, SMALLEST_DIVISOR), order))
    return math.where(longest < 100 * h, longest, 100 * h)
