"""Interfaces of integrators: fixed-step methods y₁ = Ψ(y₀, h), and adaptive ones with an error estimate and dense output.

The same source runs on numbers, in the Python loop, and on expressions, from which the step of a compiled loop is written.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np

from gauss.codegen import Scalar
from gauss.integrators.control import Tolerance, TrialStep
from gauss.integrators.step import Cost, Equations, Point
from gauss.system import State, System


@runtime_checkable
class Integrator(Protocol):
    """Numerical integration method.

    Attributes
    ----------
    name, title : str
        Name as an option, and in words.
    order : int
        Order of convergence of coordinates and rates.
    reference : str
        Source of the method.
    evaluations : int
        Evaluations of the accelerations in a step; an estimate for implicit methods.
    mechanical : bool
        Whether it needs more than accelerations: :class:`gauss.integrators.step.Mechanics`, or the equations of motion.
    """

    @property
    def name(self) -> str: ...  # noqa: D102
    @property
    def title(self) -> str: ...  # noqa: D102
    @property
    def order(self) -> int: ...  # noqa: D102
    @property
    def reference(self) -> str: ...  # noqa: D102
    @property
    def evaluations(self) -> int: ...  # noqa: D102
    @property
    def mechanical(self) -> bool: ...  # noqa: D102


@dataclass(frozen=True)
class FixedStep:
    """Fixed-step method.

    Parameters
    ----------
    name, title, order, reference, evaluations
        See :class:`Integrator`.
    step : callable
        (equations, point, h) → (point after, cost).
    mechanical : bool
        Whether it needs :class:`gauss.integrators.step.Mechanics`, which compiled systems have.
    state_size : callable, optional
        System → size of its method state, initially zero: compensated sums. Such a method satisfies the constraints on
        positions and velocities to rounding.
    starts_from_accelerations : bool
        Whether its method state has the size n_v and is initially the accelerations.
    nonsmooth : bool
        Whether its steps contain impacts and friction (Moreau–Jean time stepping).
    evaluates_end : bool
        Whether a step evaluates the laws of time at its end, and of a law that jumps there the value after the jump.
    """

    name: str
    title: str
    order: int
    reference: str
    evaluations: int
    step: Callable[[Any, Point, Scalar], tuple[Point, Cost]]  # Equations, or Mechanics where mechanical
    mechanical: bool = False
    state_size: Callable[[System], int] | None = None
    starts_from_accelerations: bool = False
    nonsmooth: bool = False
    evaluates_end: bool = False


@runtime_checkable
class Controlled(Integrator, Protocol):
    """Adaptive method, with an error estimate and dense output."""

    def attempt(
        self, equations: Equations, point: Point, h: Scalar, tolerance: Tolerance, steps: Scalar | None = None
    ) -> TrialStep:
        """Trial step; ``steps`` is the number of accepted steps so far, for the step-size factor."""

    def dense(self, equations: Equations, point: Point, h: Scalar, kept: np.ndarray) -> tuple[np.ndarray, int]:
        """Coefficients of dense output of an accepted step, and the number of evaluations for them."""

    def interpolate(self, equations: Equations, point: Point, h: Scalar, coefficients, t) -> tuple[State, np.ndarray]:
        """State and work at a time within a step from a point, by dense output."""
