"""What integrators share: a point of the motion, the rates there, and the motion as a plain ODE around a state."""

from dataclasses import dataclass, replace
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np

from gauss.codegen import Scalar
from gauss.integrators.tableaus import Tableau
from gauss.shapes import Shaped
from gauss.system import State, System, chart_rate, displacement, retract


class Rates(NamedTuple):
    """What drives a motion on.

    Attributes
    ----------
    acceleration : ndarray, shape (n_v,)
        Rates of v.
    power : ndarray, shape (3,)
        Power of drives, power of forces on bodies, power lost in dampers [W].
    """

    acceleration: np.ndarray
    power: np.ndarray


@dataclass(frozen=True)
class Point:
    """State with the work done up to it, the rates there, and what the method remembers; accelerations when not given."""

    state: State
    work: np.ndarray
    rates: Rates
    memory: np.ndarray | None = None


@runtime_checkable
class Equations(Protocol):
    """What an integrator asks of a system, over numbers or expressions."""

    system: System

    def evaluate(self, state: State) -> Rates:
        """Rates of a state."""


class Impulses(NamedTuple):
    """What moves a system in a chart: momentum ∂T/∂θ̇, force ∂T/∂θ + Q without reactions, power (3,) of loads."""

    momentum: np.ndarray
    force: np.ndarray
    power: np.ndarray


class Reached(NamedTuple):
    """State, its momentum (n_v,) in axes of parents, what rounding took from that, and the work of constraints that move."""

    state: State
    momentum: np.ndarray
    lost: np.ndarray
    work: Scalar


class CompensatedSums(NamedTuple):
    """What methods in momenta carry from step to step: compensated sums.

    Attributes
    ----------
    lost : ndarray, shape (n_v,)
        What rounding took from the coordinates.
    momentum, lost_momentum : ndarray, shape (n_v,)
        Momentum in axes of parents, and what rounding took from it.
    lost_work : ndarray, shape (3,)
        What rounding took from the work.
    begun : float
        0 before the first step, when the momentum is not known yet.
    """

    lost: np.ndarray
    momentum: np.ndarray
    lost_momentum: np.ndarray
    lost_work: np.ndarray
    begun: Scalar

    @classmethod
    def of(cls, memory: np.ndarray, n_v: int) -> "CompensatedSums":
        """Take apart what a point remembers."""
        *parts, begun = np.split(memory, np.cumsum([n_v, n_v, n_v, 3]))
        return cls(*parts, begun[0])

    @staticmethod
    def size(system: System) -> int:
        """Numbers that a point remembers."""
        return 3 * system.n_v + 3 + 1

    @property
    def packed(self) -> np.ndarray:
        """What a point remembers."""
        return np.concatenate([*self[:-1], [self.begun]])


@runtime_checkable
class Mechanics(Equations, Protocol):
    """What an integrator asks of a system whose equations of motion it discretises itself, over expressions.

    Attributes
    ----------
    closing : int
        Number of closing rows.
    extent : float
        Size of all places in units of the scene: 1 for each rate, 0 where nothing closes.
    redundant : bool
        Whether closing rows repeat others.
    spread : ndarray, shape (n_v, n)
        Rates (n_v,) that come with those along the free coordinates; joints that close loops are left out.
    acts : ndarray, shape (n_v,)
        1 where a force may act in a chart, 0 along the others: their momenta are constant but for reactions.
    """

    closing: int
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
        """Push (n_v,) in the chart around q up to a place θ, of a momentum and a push in axes of parents."""

    def out_of_chart(self, q, theta, momentum, push) -> np.ndarray:
        """Push (n_v,) in axes of parents, of a momentum in these axes and a push in the chart around q."""

    def mechanism(self, state: State):
        """The system in a state, eliminated: an object with ``response`` and ``released``."""

    def reaction(self, t: Scalar, q, theta, multipliers) -> tuple[np.ndarray, Scalar, np.ndarray]:
        """Force −Kᵀ λ (n_v,) in the chart around q, the power of constraints that move, and −Kᵀ λ in axes of parents."""

    def gap(self, t: Scalar, q) -> np.ndarray:
        """Residual of the closing rows."""

    def residual(self, t: Scalar, q, theta, v, acceleration, multipliers) -> tuple[np.ndarray, np.ndarray]:
        """What the equations of motion (n_v,) lack at a place in the chart around q, and the gap of the closing rows."""

    def slip(self, t: Scalar, q, theta, v) -> np.ndarray:
        """By how much rates miss the closing rows at a place in the chart around q."""

    def tracked(self, t: Scalar, q, theta, v) -> State:
        """State at a place in the chart around q, in which joints that close loops follow."""

    def reached(self, t: Scalar, q, theta, momentum, push) -> Reached:
        """What is reached at a place in the chart around q but for a reaction; momentum and push are in axes of parents."""


class Cost(NamedTuple):
    """What a step took.

    Attributes
    ----------
    evaluations : int
        Evaluations of the accelerations, or of forces and momenta.
    factorisations : int
        Matrices factored for implicit equations; the elimination of the mechanism in every evaluation is not counted.
    unsolved : float
        Above 0 if implicit equations were not solved.
    """

    evaluations: Scalar
    factorisations: Scalar = 0
    unsolved: Scalar = 0.0


@dataclass(frozen=True)
class Chart:
    """The motion as a plain ODE y' = f(t, y), y = (θ, v, work), in the chart around one state."""

    equations: Equations
    origin: State

    @property
    def system(self) -> System:
        """What moves."""
        return self.equations.system

    def start(self, point: Point) -> Shaped[np.ndarray, " y"]:
        """Return y of the origin."""
        return np.concatenate([np.zeros(self.system.n_v), point.state.v, point.work])

    def state(self, t: Scalar, y: np.ndarray) -> State:
        """State that y stands for."""
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


def carried(equations: Equations, point: Point, t: float) -> Point:
    """Point a few roundings of the time later, across a switching time in the middle, with the rates there."""
    system, state, h = equations.system, point.state, t - point.state.t
    q = retract(system, state.q, h * state.v)
    rates = equations.evaluate(State(t, q, state.v + 0.5 * h * point.rates.acceleration))
    mean = Rates(*(0.5 * (one + two) for one, two in zip(point.rates, rates, strict=True)))
    return replace(point, state=State(t, q, state.v + h * mean.acceleration), work=point.work + h * mean.power, rates=rates)


def stages(tableau: Tableau, chart: Chart, y: np.ndarray, first: np.ndarray, h: Scalar) -> np.ndarray:
    """Slopes K (s, len(y)) of one step from the origin of the chart."""
    K = np.empty((tableau.c.size, y.size), dtype=first.dtype)
    K[0] = first
    for i in range(1, tableau.c.size):
        K[i] = chart(chart.origin.t + tableau.c[i] * h, y + h * (tableau.A[i, :i] @ K[:i]))
    return K


def lost(system: System) -> int:
    """Numbers that compensated sums remember: what rounding took from y and from t."""
    return 2 * system.n_v + 3 + 1


def advance(chart: Chart, point: Point, h: Scalar, change: np.ndarray) -> Point:
    """Point after a change of y in a time h; it remembers what rounding took from both, to be added in the next step.

    Compensated summation (Kahan 1965; Hairer, Lubich, Wanner, Geometric Numerical Integration, VIII.5).
    """
    state, n = point.state, chart.system.n_v
    change, h = change + point.memory[:-1], h + point.memory[-1]
    reached = chart.point(state.t + h, chart.start(point) + change)
    moved = displacement(chart.system, state.q, reached.state.q, change[:n])
    kept = np.concatenate([moved, reached.state.v - state.v, reached.work - point.work])
    return replace(reached, memory=np.concatenate([change - kept, [h - (reached.state.t - state.t)]]))
