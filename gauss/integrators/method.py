"""What an integrator is: a name, an order, a source, and what it does in a step.

The same source runs on numbers, step by step, and on expressions, to become part of a loop in machine code.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from gauss.codegen import Scalar
from gauss.integrators.control import Tolerance, TrialStep
from gauss.integrators.step import Cost, Equations, Point
from gauss.system import State, System


@runtime_checkable
class Integrator(Protocol):
    """A method.

    Attributes
    ----------
    name, title : str
        Its name as an option, and in words.
    order : int
        Order of convergence of coordinates and rates.
    reference : str
        Where it is described.
    evaluations : int
        Evaluations of the accelerations in a step; about as many where equations are solved.
    """

    name: str
    title: str
    order: int
    reference: str
    evaluations: int


@dataclass(frozen=True)
class FixedStep:
    """Method whose step is given.

    Parameters
    ----------
    name, title, order, reference, evaluations
        See :class:`Integrator`.
    step : callable
        (equations, point, h) → (point after, cost).
    mechanical : bool
        Whether it asks for :class:`gauss.integrators.step.Mechanics`, which are known of what can be compiled.
    carries : callable, optional
        System → how many further numbers a point carries from step to step; they begin as zeros. Such a method meets
        the constraints of positions and rates to rounding by itself.
    remembers : bool
        Whether a point carries n_v further numbers that begin as the accelerations.
    nonsmooth : bool
        Whether impacts and friction are part of its steps.
    """

    name: str
    title: str
    order: int
    reference: str
    evaluations: int
    step: Callable[[Equations, Point, Scalar], tuple[Point, Cost]]
    mechanical: bool = False
    carries: Callable[[System], int] | None = None
    remembers: bool = False
    nonsmooth: bool = False


@runtime_checkable
class Controlled(Integrator, Protocol):
    """Method that estimates its error and chooses its step.

    Attributes
    ----------
    mechanical : bool
        Whether it asks for :class:`gauss.integrators.step.Mechanics`.
    """

    mechanical: bool

    def attempt(self, equations: Equations, point: Point, h: Scalar, tolerance: Tolerance) -> TrialStep:
        """Try one step."""

    def dense(self, equations: Equations, point: Point, h: Scalar, kept: np.ndarray) -> tuple[np.ndarray, int]:
        """Coefficients of dense output over an accepted step, and the evaluations that they took."""

    def interpolate(self, equations: Equations, point: Point, h: Scalar, coefficients, t) -> tuple[State, np.ndarray]:
        """State and work at a time within a step from a point."""
