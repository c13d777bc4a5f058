"""Equations of motion as integrators use them: points, rates, and the ODE y' = f(t, y) in a chart around a state.

Configurations are q = q₀ ⊕ θ, by :func:`gauss.system.retract`; y = (θ, v, work).
"""

from dataclasses import dataclass, replace
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np

from gauss.codegen import Entry, Scalar
from gauss.integrators.tableaus import Tableau
from gauss.shapes import Shaped
from gauss.system import State, System, chart_rate, displacement, retract


class Rates(NamedTuple):
    """Time derivatives of rates and quadratures.

    Attributes
    ----------
    acceleration : ndarray, shape (n_v,)
        Accelerations v̇.
    power : ndarray, shape (3,)
        Power of drives, power of forces on bodies, power lost in dampers [W].
    """

    acceleration: np.ndarray
    power: np.ndarray


@dataclass(frozen=True)
class Point:
    """State with its quadratures of work, its rates, and the method state; accelerations where that is not given."""

    state: State
    work: np.ndarray
    rates: Rates
    method_state: np.ndarray | None = None


@runtime_checkable
class Equations(Protocol):
    """Equations of motion of a system, over numbers or expressions."""

    system: System

    def evaluate(self, state: State) -> Rates:
        """Rates of a state."""


class Impulses(NamedTuple):
    """Momentum ∂T/∂θ̇ and force ∂T/∂θ + Q without reactions in a chart, and the power (3,) of loads."""

    momentum: np.ndarray
    force: np.ndarray
    power: np.ndarray


class Reached(NamedTuple):
    """End of a step: state, momentum (n_v,) in axes of parents, its compensation, work of rheonomic constraints."""

    state: State
    momentum: np.ndarray
    compensation: np.ndarray
    work: Scalar


class CompensatedSums(NamedTuple):
    """Method state of methods in momenta: compensated sums (Kahan 1965)."""

    compensation: np.ndarray  # (n_v,) compensation of the coordinates
    momentum: np.ndarray  # momentum, momentum_compensation (n_v,): momentum in axes of parents, and its compensation
    momentum_compensation: np.ndarray
    work_compensation: np.ndarray  # (3,) compensation of the work
    begun: Scalar  # 0 before the first step, when the momentum is not yet computed

    @classmethod
    def of(cls, method_state: np.ndarray, n_v: int) -> "CompensatedSums":
        """Sums of a method state."""
        *sums, begun = np.split(method_state, np.cumsum([n_v, n_v, n_v, 3]))
        return cls._make([*sums, begun[0]])

    @staticmethod
    def size(system: System) -> int:
        """Size of the method state."""
        return 3 * system.n_v + 3 + 1

    @property
    def packed(self) -> np.ndarray:
        """The method state."""
        return np.concatenate([*self[:-1], [self.begun]])


@runtime_checkable
class Mechanics(Equations, Protocol):
    """Momenta, forces and constraints for methods that discretise the equations of motion themselves, over expressions.

    Attributes
    ----------
    n_constraints : int
        Number m of loop, coupling and relation constraints g(q) = 0, with Jacobian K.
    extent : float
        Size of the positions in units of the scene: 1 for each rate, 0 without constraints.
    redundant : bool
        Whether constraints are redundant.
    spread : ndarray, shape (n_v, n)
        Matrix S of v = S u, u being the rates along the free coordinates; without the rates of joints that close loops.
    acts : ndarray, shape (n_v,)
        1 for coordinates on which a force may act, else 0: their momenta change by reactions only.
    """

    n_constraints: int
    extent: float
    redundant: bool
    spread: np.ndarray
    acts: np.ndarray

    def energies(self, state: State) -> tuple[Scalar, Scalar]:
        """Kinetic energy, and potential energy of gravity and springs [J]."""

    def momentum(self, state: State) -> np.ndarray:
        """Momentum M v (n_v,) along the free coordinates, in axes of parents (see :func:`gauss.system.in_parent_axes`)."""

    def in_own_axes(self, q, vector) -> np.ndarray:
        """Vector along the rates (n_v,) in the axes of the joints instead of those of their parents."""

    def impulses(self, t: Scalar, q, theta, rate) -> Impulses:
        """Momentum and force in the chart around q."""

    def transported(self, t: Scalar, q, theta, rate) -> tuple[Impulses, np.ndarray]:
        """Momentum and force in the chart around q, and the force ∂T/∂q + Q at fixed rates v, in axes of parents."""

    def in_chart(self, q, theta, momentum, push) -> np.ndarray:
        """Change of momentum (n_v,) in the chart around q up to θ, of a momentum and a change in axes of parents."""

    def out_of_chart(self, q, theta, momentum, push) -> np.ndarray:
        """Change of momentum (n_v,) in axes of parents, of a momentum in these axes and a change in the chart around q."""

    def mechanism(self, state: State):
        """Factored equations of motion in a state: an object with ``response`` and ``released``."""

    def reaction(self, t: Scalar, q, theta, multipliers) -> tuple[np.ndarray, Scalar, np.ndarray]:
        """Force −Kᵀ λ (n_v,) in the chart around q, the power of rheonomic constraints, and −Kᵀ λ in axes of parents."""

    def violation(self, t: Scalar, q) -> np.ndarray:
        """Constraint residual g(q) (m,)."""

    def residual(self, t: Scalar, q, theta, v, acceleration, multipliers) -> tuple[np.ndarray, np.ndarray]:
        """Residuals of the equations of motion (n_v,) and of the constraints (m,) at θ in the chart around q."""

    def velocity_violation(self, t: Scalar, q, theta, v) -> np.ndarray:
        """Velocity residual K v − C (m,) of the constraints at θ in the chart around q."""

    def tracked(self, t: Scalar, q, theta, v) -> State:
        """State at θ in the chart around q; coordinates of joints that close loops follow from the others."""

    def reached(self, t: Scalar, q, theta, momentum, push) -> Reached:
        """End of a step at θ in the chart around q, up to a reaction; momentum and push are in axes of parents."""


class Cost(NamedTuple):
    """Cost of a step.

    Attributes
    ----------
    evaluations : int
        Evaluations of the accelerations, or of forces and momenta.
    factorisations : int
        Matrices factored for implicit equations, without the elimination of the mechanism in every evaluation.
    unsolved : float
        Above 0 where the iteration of implicit equations did not converge.
    """

    evaluations: Entry
    factorisations: Entry = 0
    unsolved: Entry = 0.0


@dataclass(frozen=True)
class Chart:
    """Equations of motion as an ODE y' = f(t, y), y = (θ, v, work), in the chart around one state."""

    equations: Equations
    origin: State

    @property
    def system(self) -> System:
        """The system."""
        return self.equations.system

    def start(self, point: Point) -> Shaped[np.ndarray, " y"]:
        """Return y of the origin."""
        return np.concatenate([np.zeros(self.system.n_v), point.state.v, point.work])

    def state(self, t: Scalar, y: np.ndarray) -> State:
        """State of y."""
        n = self.system.n_v
        return State(t, retract(self.system, self.origin.q, y[:n]), y[n : 2 * n])

    def rate(self, y: np.ndarray, rates: Rates) -> np.ndarray:
        """Y' given the rates at y."""
        n = self.system.n_v
        return np.concatenate([chart_rate(self.system, y[:n], y[n : 2 * n]), *rates])

    def __call__(self, t: Scalar, y: np.ndarray) -> np.ndarray:
        """Y' at (t, y)."""
        return self.rate(y, self.equations.evaluate(self.state(t, y)))

    def point(self, t: Scalar, y: np.ndarray) -> Point:
        """Point of y, with its rates."""
        state = self.state(t, y)
        return Point(state, y[2 * self.system.n_v :], self.equations.evaluate(state))


def crossed_time(equations: Equations, point: Point, t: float) -> Point:
    """Point just after a switching time, with the rates there: a trapezoidal step of a few roundings of the time."""
    system, state, h = equations.system, point.state, t - point.state.t
    q = retract(system, state.q, h * state.v)
    rates = equations.evaluate(State(t, q, state.v + 0.5 * h * point.rates.acceleration))
    mean = Rates(*(0.5 * (one + two) for one, two in zip(point.rates, rates, strict=True)))
    return replace(point, state=State(t, q, state.v + h * mean.acceleration), work=point.work + h * mean.power, rates=rates)


def method_state_of(point: Point) -> np.ndarray:
    """Method state of a point of a method that has one."""
    assert point.method_state is not None
    return point.method_state


def stages(tableau: Tableau, chart: Chart, y: np.ndarray, first: np.ndarray, h: Scalar) -> np.ndarray:
    """Slopes K (s, len(y)) of a Runge–Kutta step from the origin of the chart."""
    K = np.empty((tableau.c.size, y.size), dtype=first.dtype)
    K[0] = first
    for i in range(1, tableau.c.size):
        K[i] = chart(chart.origin.t + tableau.c[i] * h, y + h * (tableau.A[i, :i] @ K[:i]))
    return K


def advance(chart: Chart, point: Point, h: Scalar, change: np.ndarray) -> Point:
    """Point after a change of y in a time h; its method state is the rounding error of both, which the next step adds.

    Compensated summation (Kahan 1965; Hairer, Lubich, Wanner, Geometric Numerical Integration, VIII.5).
    """
    state, n = point.state, chart.system.n_v
    compensation = method_state_of(point)
    change, h = change + compensation[:-1], h + compensation[-1]
    reached = chart.point(state.t + h, chart.start(point) + change)
    moved = displacement(chart.system, state.q, reached.state.q, change[:n])
    kept = np.concatenate([moved, reached.state.v - state.v, reached.work - point.work])
    return replace(reached, method_state=np.concatenate([change - kept, [h - (reached.state.t - state.t)]]))
