"""Sensitivities of a motion: how its states change with the start, the inputs and the parameters; forward and adjoint.

Forward, X₊ = F′ (X, du, dp) along the motion, a column for each direction; adjoint, λ = F′ᵀ λ₊ back along it, for the
gradient of one number at the cost of some motions, whatever the number of inputs. Both are exact derivatives of the computed
steps (:mod:`gauss.dynamics.motion_step`); with loops, those by parameters to the order of the method, for stages are off the
constraints. Events lie between steps, with matrices of their own (:mod:`gauss.analysis.sensitivity.saltation`).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from gauss.analysis.sensitivity.motion import Motion
from gauss.analysis.user_functions import numbers_of
from gauss.arguments import named_arguments
from gauss.codegen import Graph, reverse, substitute
from gauss.errors import ArgumentError
from gauss.scene import Scene
from gauss.system import State, System


@dataclass(frozen=True)
class Sensitivities:
    """A motion of fixed steps, and its derivatives.

    Parameters
    ----------
    t : ndarray, shape (k,)
        Times [s].
    q, v : ndarray, shape (k, n_q), (k, n_v)
        Coordinates and rates.
    start : ndarray, shape (k, n_q + n_v, m)
        Derivatives of (q, v) by displacements of independent coordinates, then by independent rates, of the start.
    states : tuple of str
        Names of the m columns of ``start``.
    parameters : dict of str to ndarray, shape (k, n_q + n_v, n)
        Derivatives of (q, v) by each parameter of n values.
    """

    t: np.ndarray
    q: np.ndarray
    v: np.ndarray
    start: np.ndarray
    states: tuple[str, ...]
    parameters: dict[str, np.ndarray]


@dataclass(frozen=True)
class MotionGradient:
    """A number that a motion ends with, and its gradient.

    Parameters
    ----------
    value : float
        The number.
    start : ndarray, shape (m,)
        Gradient by displacements of independent coordinates, then by independent rates, of the start.
    states : tuple of str
        Names of the entries of ``start``.
    inputs : ndarray, shape (steps, n_u)
        Gradient by the inputs held in each step; at a limit of an input the one-sided one, into the allowed values, and zero
        beyond.
    parameters : dict of str to ndarray, shape (n,)
        Gradient by each parameter of n values.
    t, q, v : ndarray, shape (k,), (k, n_q), (k, n_v)
        The motion.
    """

    value: float
    start: np.ndarray
    states: tuple[str, ...]
    inputs: np.ndarray
    parameters: dict[str, np.ndarray]
    t: np.ndarray
    q: np.ndarray
    v: np.ndarray


@named_arguments
def sensitivities(
    system: System | Scene,
    duration: float,
    *,
    step: float,
    state: State | None = None,
    inputs=None,
    parameters: Sequence[str] = (),
    integrator: str = "rk4",
) -> Sensitivities:
    """State-transition matrix of a motion along it, and derivatives by parameters.

    Parameters
    ----------
    system : System or Scene
        The system. Impacts, stops, stick and slip are events between smooth phases; contacts with friction have no
        derivatives.
    duration : float
        Duration, a whole number of steps [s].
    step : float
        Step [s].
    state : State, optional
        Consistent start; that of the scene when not given.
    inputs : array_like, shape (steps, n_u), optional
        Inputs held in each step, in the order of the scene; zero when not given.
    parameters : sequence of str
        Parameters, as "mass:arm" or "stiffness:spring"; see :meth:`gauss.System.parameter_derivatives`. Lengths of loops are
        refused: with another length the start does not close them.
    integrator : str
        Explicit Runge–Kutta method with fixed steps: "rk4", "dopri5" or "dop853". A motion with events is that of
        :func:`gauss.simulate`, and its derivatives are exact to the order of this method.

    Returns
    -------
    Sensitivities
        Motion and derivatives at every step.

    Raises
    ------
    ArgumentError
        If an argument does not fit.
    StateError
        If a parameter names what the scene does not have.
    SimulationError
        If the system has no smooth dynamics between events in machine code, by the names of its elements; an event has no
        derivative, as two gaps that close at once, or a grazed one; the duration or the step is no positive number; or the
        motion is not finite.

    Examples
    --------
    >>> import gauss
    >>> gauss.sensitivities(gauss.load("pendulum"), 0.1, step=0.01, parameters=["mass:rod"]).start.shape
    (11, 2, 2)
    """
    motion = Motion(system, duration, step, state, inputs, parameters, integrator)
    one, columns, names = motion.step, *motion.directions()
    n_u, m = len(one.inputs), columns.shape[1]
    held = np.concatenate([np.zeros((n_u, m + one.n_p)), np.zeros((one.n_p, m + one.n_p))])
    held[n_u:, m:] = np.eye(one.n_p)
    now = np.concatenate([columns, np.zeros((one.n_x, one.n_p))], axis=1)
    along = [now]
    for k in range(motion.steps):
        for piece in motion.pieces[k]:
            now = piece.change(np.concatenate([now, held]))
        along.append(now)
    found = np.array(along)
    parts = np.split(found[:, :, m:], np.cumsum(list(one.sizes.values()))[:-1], axis=2) if one.sizes else []
    return Sensitivities(*motion.states, found[:, :, :m], names, dict(zip(one.sizes, parts, strict=True)))


@named_arguments
def motion_gradient(
    system: System | Scene,
    duration: float,
    loss: Callable,
    *,
    step: float,
    state: State | None = None,
    inputs=None,
    parameters: Sequence[str] = (),
    integrator: str = "rk4",
) -> MotionGradient:
    """Gradient of a function of the end of a motion by its start, inputs and parameters, by the adjoint equations.

    Parameters
    ----------
    system, duration, step, state, inputs, parameters, integrator
        As for :func:`sensitivities`.
    loss : callable
        (q, v) at the end → number; written with arithmetic and :mod:`gauss.math`, so that it can be traced. A cost along the
        motion is a state of its own (:meth:`gauss.Scene.state`).

    Returns
    -------
    MotionGradient
        The number and its gradient.

    Raises
    ------
    ArgumentError
        If an argument does not fit.
    StateError
        If a parameter names what the scene does not have.
    SimulationError
        If the system has no smooth dynamics between events in machine code, by the names of its elements; an event has no
        derivative, as two gaps that close at once, or a grazed one; the duration or the step is no positive number; or the
        motion is not finite.

    Examples
    --------
    >>> import gauss
    >>> swing = gauss.motion_gradient(gauss.load("pendulum"), 0.1, lambda q, v: q[0] ** 2, step=0.01)
    >>> swing.states
    ('A', 'A rate')
    """
    motion = Motion(system, duration, step, state, inputs, parameters, integrator)
    one, columns, names = motion.step, *motion.directions()
    value, weights = _loss(loss, one.system, motion.x[-1])
    by_inputs, by_parameters = np.zeros_like(motion.inputs), np.zeros(one.n_p)
    ends = [one.n_x, one.n_x + len(one.inputs)]
    for k in reversed(range(motion.steps)):
        for piece in reversed(motion.pieces[k]):
            weights, by_input, own = np.split(piece.gradient(weights), ends)
            by_inputs[k] += by_input
            by_parameters += own
    parts = np.split(by_parameters, np.cumsum(list(one.sizes.values()))[:-1]) if one.sizes else []
    of_parameters = dict(zip(one.sizes, parts, strict=True))
    return MotionGradient(value, columns.T @ weights, names, by_inputs, of_parameters, *motion.states)


def _loss(loss: Callable, system: System, end: np.ndarray) -> tuple[float, np.ndarray]:
    """Value of a function of (q, v), and its gradient (n_q + n_v,)."""
    symbols = Graph().symbols("x", system.n_q + system.n_v)
    q, v = np.split(symbols, [system.n_q])
    found = symbols[0].graph.lift(numbers_of(loss, (q, v), "motion_gradient: loss", 1)[0])
    try:
        value, *gradient = (one.value for one in substitute([found, *reverse(found, symbols)], symbols, end))
    except (ValueError, ArithmeticError) as error:
        raise ArgumentError(f"motion_gradient: loss has no value or no gradient at the end of the motion: {error}") from None
    return float(value), np.array(gradient)
