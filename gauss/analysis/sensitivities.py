"""Sensitivities of a motion: how its states change with the start, the inputs and the parameters; forward and adjoint.

Forward, X₊ = F′ (X, du, dp) along the motion, a column for each direction; adjoint, λ = F′ᵀ λ₊ back along it, for the
gradient of one number at the cost of some motions, whatever the number of inputs. Both are exact derivatives of the computed
steps (:mod:`gauss.analysis.motion_step`); with loops, those by parameters to the order of the method, for stages are off the
constraints.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from gauss.analysis.motion_step import MotionStep
from gauss.analysis.tangents import Tangents
from gauss.arguments import named_arguments
from gauss.codegen import Graph, reverse, substitute
from gauss.dynamics import compile_scene
from gauss.errors import ArgumentError, SimulationError, require
from gauss.scene import Scene
from gauss.simulation.tolerances import check_tolerances
from gauss.system import State, System, coordinate_rates

WHOLE = 1e-9  # share of a step by which the duration may differ from a whole number of steps


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
        Gradient by the inputs held in each step.
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
        The system, without contacts and friction.
    duration : float
        Duration, a whole number of steps [s].
    step : float
        Step [s].
    state : State, optional
        Consistent start; that of the scene when not given.
    inputs : array_like, shape (steps, n_u), optional
        Inputs held in each step, in the order of the scene; zero when not given.
    parameters : sequence of str
        Parameters, as "mass:arm" or "stiffness:spring"; see :meth:`gauss.System.parameter_derivatives`.
    integrator : str
        Explicit Runge–Kutta method with fixed steps: "rk4", "dopri5" or "dop853".

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
        If the system has no smooth dynamics in machine code, by the names of its elements; the duration or the step is no
        positive number; or the motion is not finite.

    Examples
    --------
    >>> import gauss
    >>> gauss.sensitivities(gauss.load("pendulum"), 0.1, step=0.01, parameters=["mass:rod"]).start.shape
    (11, 2, 2)
    """
    motion = _Motion(system, duration, step, state, inputs, parameters, integrator)
    one, columns, names = motion.step, *motion.directions()
    n_u, m = len(one.inputs), columns.shape[1]
    held = np.concatenate([np.zeros((n_u, m + one.n_p)), np.zeros((one.n_p, m + one.n_p))])
    held[n_u:, m:] = np.eye(one.n_p)
    along = [np.concatenate([columns, np.zeros((one.n_x, one.n_p))], axis=1)]
    for k in range(motion.steps):
        directions = np.concatenate([along[-1], held])
        along.append(one.change(motion.t[k], motion.h, motion.x[k], motion.inputs[k], directions))
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
        If the system has no smooth dynamics in machine code, by the names of its elements; the duration or the step is no
        positive number; or the motion is not finite.

    Examples
    --------
    >>> import gauss
    >>> swing = gauss.motion_gradient(gauss.load("pendulum"), 0.1, lambda q, v: q[0] ** 2, step=0.01)
    >>> swing.states
    ('A', 'A rate')
    """
    motion = _Motion(system, duration, step, state, inputs, parameters, integrator)
    one, columns, names = motion.step, *motion.directions()
    value, weights = _loss(loss, one.system, motion.x[-1])
    by_inputs, by_parameters = np.zeros_like(motion.inputs), np.zeros(one.n_p)
    ends = [one.n_x, one.n_x + len(one.inputs)]
    for k in reversed(range(motion.steps)):
        found = one.gradient(motion.t[k], motion.h, motion.x[k], motion.inputs[k], weights)
        weights, by_inputs[k], own = np.split(found, ends)
        by_parameters += own
    parts = np.split(by_parameters, np.cumsum(list(one.sizes.values()))[:-1]) if one.sizes else []
    of_parameters = dict(zip(one.sizes, parts, strict=True))
    return MotionGradient(value, columns.T @ weights, names, by_inputs, of_parameters, *motion.states)


class _Motion:
    """Motion of fixed steps, before its derivatives."""

    def __init__(self, system, duration, step, state, inputs, parameters, integrator):
        require(system, (System, Scene), "sensitivities")
        system = compile_scene(system) if isinstance(system, Scene) else system
        check_tolerances(duration=duration, step=step)
        self.steps = round(duration / step)
        if self.steps < 1 or abs(self.steps * step - duration) > WHOLE * step:
            raise ArgumentError(f"sensitivities: duration {duration} s is no whole number of steps of {step} s.")
        self.h, self.start = step, system.initial_state() if state is None else state
        require(self.start, (State,), "sensitivities: state")
        self.step = MotionStep(system, integrator, (parameters,) if isinstance(parameters, str) else parameters)
        shape = self.steps, len(self.step.inputs)
        self.inputs = np.zeros(shape) if inputs is None else np.array(inputs, dtype=float)
        if self.inputs.shape != shape:
            raise ArgumentError(f"sensitivities: inputs: expected shape {shape}, got {self.inputs.shape}.")
        self.t = self.start.t + step * np.arange(self.steps + 1)
        self.x = np.empty((self.steps + 1, self.step.n_x))
        self.x[0] = np.concatenate([self.start.q, self.start.v])
        for k in range(self.steps):
            self.x[k + 1] = self.step.after(self.t[k], step, self.x[k], self.inputs[k])
        if not np.isfinite(self.x).all():
            late = self.t[np.flatnonzero(~np.isfinite(self.x).all(axis=1))[0]]
            raise SimulationError(f"sensitivities: the motion is not finite at t = {late:.6g} s; take shorter steps.")

    @property
    def states(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Times, coordinates and rates."""
        n_q = self.step.system.n_q
        return self.t, self.x[:, :n_q], self.x[:, n_q:]

    def directions(self) -> tuple[np.ndarray, tuple[str, ...]]:
        """Changes (n_x, m) of the start along independent coordinates and rates, and their names."""
        system, tangents = self.step.system, Tangents(self.step.system, self.start)
        N, D, rate = tangents.position, tangents.change, tangents.rate
        moved = (
            np.array([coordinate_rates(system, self.start.q, column) for column in N.T]).reshape(N.shape[1], system.n_q).T
        )
        still = np.zeros((system.n_q, rate.shape[1]))
        names = [system.coordinates[k] for k in tangents.independent_coordinates]
        names += [f"{system.coordinates[k]} rate" for k in tangents.independent_rates]
        return np.block([[moved, still], [D, rate]]), tuple(names)


def _loss(loss: Callable, system: System, end: np.ndarray) -> tuple[float, np.ndarray]:
    """Value of a function of (q, v), and its gradient (n_q + n_v,)."""
    symbols = Graph().symbols("x", system.n_q + system.n_v)
    q, v = np.split(symbols, [system.n_q])
    try:
        found = symbols[0].graph.lift(loss(q, v))
    except TypeError as error:
        raise ArgumentError(f"motion_gradient: loss cannot be traced: {error}") from None
    try:
        value, *gradient = (one.value for one in substitute([found, *reverse(found, symbols)], symbols, end))
    except (ValueError, ArithmeticError) as error:
        raise ArgumentError(f"motion_gradient: loss has no value or no gradient at the end of the motion: {error}") from None
    return float(value), np.array(gradient)
