"""Iterative LQR with limited inputs: optimal inputs of a motion of fixed steps, with the feedback gains about it.

Backward, the quadratic model of the cost to go, Q = ℓ + V⁺(F), with the exact first derivatives of compiled steps
(:mod:`gauss.dynamics.motion_step`) and exact ones of the cost; forward, u = û + α k + K (x − x̂) with a line search on α
(Li and Todorov 2004; Tassa, Mansard and Todorov, Control-limited differential dynamic programming, ICRA 2014).
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from gauss.analysis.optimal.box_qp import box_minimum
from gauss.analysis.optimal.cost_derivatives import CostDerivatives
from gauss.analysis.optimal.equations import unlimited
from gauss.arguments import named_arguments
from gauss.codegen import Kernel, forward, reverse
from gauss.dynamics.motion_step import MotionStep
from gauss.dynamics.rigid_loops import refuse_other_pose
from gauss.dynamics.scene_compilation import system_of
from gauss.errors import ArgumentError, SimulationError, judged_later, require
from gauss.scene import Scene
from gauss.simulation.passed_switching import examine_steps
from gauss.simulation.tolerances import WHOLE, check_tolerances, step_count
from gauss.simulation.trajectory import Trajectory
from gauss.system import State, System

SHARES = 0.5 ** np.arange(12)  # of the step that the line search tries
WORTH = 1e-4  # least reduction of the cost, as a share of the predicted one
LEAST, SMALL, LARGEST = 1e-12, 1e-4, 1e15  # regularisation, relative to the mean diagonal of Q_uu; small ones count as none
FACTOR = 4.0  # of it from one iteration to the next
SLOW_REDUCTION = 1e-2  # relative reduction of the cost below which second derivatives pay: far from the optimum they mislead
DOMINANT = 1.0  # regularisation from which steps are without feedback, which has kinks where inputs are at their limits


@dataclass(frozen=True)
class FeedbackMotion:
    """Motion of least cost, with its inputs and the feedback about it.

    Parameters
    ----------
    system : System
        The system.
    t : ndarray, shape (steps + 1,)
        Times [s].
    q, v : ndarray, shape (steps + 1, n_q), (steps + 1, n_v)
        Coordinates and rates.
    u : ndarray, shape (steps, n_u)
        Inputs held in each step [N m, N].
    gains : ndarray, shape (steps, n_u, n_q + n_v)
        Changes of the inputs for changes of (q, v); zero for inputs at their limits.
    cost : float
        Cost.
    gradient : float
        Largest change of an input that one more step would make, as a share of its range or of the largest input.
    iterations : int
        Iterations.
    costs : tuple of float
        Cost after each of them.
    """

    system: System = field(repr=False)  # as long as a scene
    t: np.ndarray
    q: np.ndarray
    v: np.ndarray
    u: np.ndarray
    gains: np.ndarray
    cost: float
    gradient: float
    iterations: int
    costs: tuple[float, ...] = field(repr=False)

    @property
    def start(self) -> State:
        """State at the start."""
        return State(float(self.t[0]), self.q[0], self.v[0])

    def control(self, t: float, q, v) -> np.ndarray:
        """Inputs (n_u,) at a time in a state, with feedback: a law for ``gauss.simulate(…, control=…, rate=…)``."""
        step = (self.t[-1] - self.t[0]) / len(self.u)
        k = int(np.clip(np.floor((t - self.t[0]) / step + WHOLE), 0, len(self.u) - 1))
        return self.u[k] + self.gains[k] @ (np.concatenate([q, v]) - np.concatenate([self.q[k], self.v[k]]))

    def trajectory(self) -> Trajectory:
        """The motion as a trajectory, for figures and films."""
        return Trajectory.from_coordinates(self.system, self.t, self.q, self.v)


@named_arguments
def ilqr(
    scene: Scene | System,
    duration: float,
    *,
    step: float,
    cost: Callable,
    final: Callable | None = None,
    start: State | None = None,
    inputs=None,
    second_order: bool = False,
    integrator: str = "rk4",
    iterations: int = 300,
    tolerance: float = 1e-9,
) -> FeedbackMotion:
    """Inputs of least cost of a motion from a state, by iterative LQR within the limits of the inputs.

    Parameters
    ----------
    scene : Scene or System
        Scene with inputs, without contacts and friction.
    duration : float
        Duration, a whole number of steps [s].
    step : float
        Step in which inputs are held [s].
    cost : callable
        (t, q, v, u) → cost per time, of arithmetic and :mod:`gauss.math`; its second derivatives by u are positive.
    final : callable, optional
        (q, v) → cost of the end.
    start : State, optional
        State at the start; that of the scene when not given.
    inputs : array_like, shape (steps, n_u), optional
        First guess; zero when not given. From a motion that has no gradient, as of a pole that hangs, it leads nowhere.
    second_order : bool
        Whether second derivatives of the steps are used, too (differential dynamic programming): few iterations also about
        unstable motions, for machine code that takes longer to make.
    integrator : str
        Explicit Runge–Kutta method: "rk4", "dopri5" or "dop853", with fixed steps.
    iterations : int
        Most iterations.
    tolerance : float
        Relative reduction of the cost below which it counts as least.

    Returns
    -------
    FeedbackMotion
        States, inputs, gains and cost. It is a local optimum, near the guess.

    Warns
    -----
    SwitchingWarning
        If a law of time jumps, or has a feature shorter than the steps.

    Raises
    ------
    ArgumentError
        If an argument does not fit, or a cost cannot be traced.
    SimulationError
        If the scene has no inputs or no smooth dynamics, if a prescribed motion jumps, if the first motion is not finite,
        if the cost is not convex in the inputs, or if the iterations do not suffice.

    Examples
    --------
    >>> import gauss
    >>> cart = gauss.load("cart_pole")
    >>> push = cart.input("push", "rail", limits=20.0)
    >>> upright = lambda q, v: 100 * (q @ q + v @ v)
    >>> motion = gauss.ilqr(cart, 1.2, step=0.02, cost=lambda t, q, v, u: 0.01 * u @ u, final=upright)
    >>> bool(abs(motion.q[-1]).max() < 0.05)
    True
    """
    system = system_of(scene, "ilqr")
    problem = _Ilqr(system, duration, step, cost, final, start, integrator, second_order)
    check_tolerances(tolerance=tolerance)
    if not isinstance(iterations, int) or isinstance(iterations, bool) or iterations < 1:
        raise ArgumentError(f"ilqr: iterations: expected a whole number from 1 on, got {iterations!r}.")
    return problem.solved(problem.first(inputs), iterations, tolerance)


@dataclass(frozen=True)
class _Gains:
    """Backward pass: steps k (N, n_u), gains K (N, n_u, n_x), and the predicted reduction −(α a + α² b)."""

    k: np.ndarray
    K: np.ndarray
    linear: float
    quadratic: float


class _Ilqr:
    """One problem."""

    def __init__(self, system: System, duration, step, cost, final, start, integrator, second_order):
        if not system.scene.inputs:
            raise SimulationError(f"ilqr: scene {system.scene.name!r} has no inputs; scene.input(name, joint) adds one.")
        self.count = step_count(duration, step, "ilqr")
        self.system, self.h = system, step
        self.start = system.initial_state() if start is None else start
        require(self.start, (State,), "ilqr: start")
        refuse_other_pose(system, self.start.q)
        self.step, self.second_order = CurvedStep(unlimited(system), integrator), second_order
        self.t = self.start.t + step * np.arange(self.count + 1)
        examine_steps(system, self.step.laws, self.start, float(self.t[-1]), step, "let laws of time be smooth")
        bounds = np.array([given.bounds for given in system.scene.inputs.values()])
        self.low, self.high, self.n_u, self.n_x = bounds[:, 0], bounds[:, 1], len(bounds), system.n_q + system.n_v
        for name, one in (("cost", cost), ("final", final)):
            if not callable(one) and not (name == "final" and one is None):
                raise ArgumentError(f"ilqr: {name}: expected a function, got {one!r}.")
        running = lambda t, q, v, u: step * cost(t[0], q, v, u)  # noqa: E731
        self.running = CostDerivatives(running, (1, system.n_q, system.n_v, self.n_u), "ilqr: cost")
        ending = (lambda _, q, v: final(q, v)) if final else (lambda _, q, v: 0.0 * q[0])
        self.final = CostDerivatives(ending, (1, system.n_q, system.n_v), "ilqr: final")

    def first(self, inputs) -> np.ndarray:
        """First inputs (N, n_u), within their limits."""
        shape = self.count, self.n_u
        try:
            u = np.zeros(shape) if inputs is None else np.array(inputs, dtype=float)
        except (TypeError, ValueError):
            raise ArgumentError(f"ilqr: inputs: expected numbers of shape {shape}.") from None
        if u.shape != shape or not np.isfinite(u).all():
            raise ArgumentError(f"ilqr: inputs: expected finite numbers of shape {shape}, got shape {u.shape}.")
        return np.clip(u, self.low, self.high)

    def solved(self, u: np.ndarray, iterations: int, tolerance: float) -> FeedbackMotion:
        """Optimum near inputs."""
        x = self.moved(u)
        total, regular, costs = self.cost(x, u), LEAST, list[float]()
        if not np.isfinite(total):
            raise SimulationError("ilqr: the first motion or its cost is not finite; give other inputs=, or shorter steps.")
        curved = False
        for _ in range(iterations):
            gains = self.backward(x, u, regular, curved)
            if regular <= SMALL and -gains.linear <= tolerance * max(abs(total), tolerance):
                return self._found(x, u, total, gains, costs)
            tried = self.searched(x, u, gains, total)
            if tried is not None:
                curved = self.second_order and total - tried[2] < SLOW_REDUCTION * abs(total)
                x, u, total, share = tried
                costs.append(total)
                regular = max(regular / (FACTOR**2 if share == 1.0 else FACTOR), LEAST)
            elif curved:
                curved = False
            elif regular > LARGEST:
                break
            else:
                regular = FACTOR**2 * max(regular, SMALL)
        raise SimulationError(
            f"ilqr: the cost {total:.6g} is not least after {len(costs)} steps; second_order=True needs fewer of them, more "
            "iterations= or inputs= near the optimum may help."
        )

    def _found(self, x: np.ndarray, u: np.ndarray, total: float, gains: _Gains, costs: list[float]) -> FeedbackMotion:
        """Result."""
        sizes = np.where(np.isfinite(self.high - self.low), self.high - self.low, max(np.abs(u).max(), 1e-300))
        q, v = np.split(x, [self.system.n_q], axis=1)
        left = float(np.abs(gains.k / sizes).max())
        return FeedbackMotion(self.system, self.t, q, v, u, gains.K, total, left, len(costs), tuple(costs))

    def moved(self, u: np.ndarray, about=None, gains: _Gains | None = None, share: float = 0.0) -> np.ndarray:
        """States (N + 1, n_x) under inputs; with gains about other states these are changed in place."""
        x = np.empty((self.count + 1, self.n_x))
        x[0] = np.concatenate([self.start.q, self.start.v])
        for k in range(self.count):
            if gains is not None:
                u[k] = np.clip(u[k] + share * gains.k[k] + gains.K[k] @ (x[k] - about[k]), self.low, self.high)
            x[k + 1] = self.step.after(self.t[k], self.h, x[k], u[k])
        return x

    def cost(self, x: np.ndarray, u: np.ndarray) -> float:
        """Cost of a motion; infinite where it is not a number."""
        with judged_later():
            found = self.running(self._columns(x, u))[0].sum() + self.final(np.concatenate([[0.0], x[-1]])[:, None])[0][0]
        return float(found) if np.isfinite(found) else np.inf

    def searched(self, x, u, gains: _Gains, total: float):
        """States, inputs, cost and share of the first step that is worth its prediction; None if there is none."""
        for share in SHARES:
            moved = u.copy()
            with judged_later():
                states = self.moved(moved, x, gains, share)
            found = self.cost(states, moved) if np.isfinite(states).all() else np.inf
            predicted = -(share * gains.linear + share**2 * gains.quadratic)
            if predicted > 0.0 and total - found >= WORTH * predicted:
                return states, moved, found, share
        return None

    def backward(self, x: np.ndarray, u: np.ndarray, regular: float, curved: bool) -> _Gains:
        """Steps and gains of the quadratic model, with a regularisation of Q_uu."""
        n = self.n_x
        slopes = self._slopes(x, u)
        _, by, H_cost = self.running(self._columns(x, u))
        _, (V,), (W,) = self.final(np.concatenate([[0.0], x[-1]])[:, None])
        k, K = np.zeros((self.count, self.n_u)), np.zeros((self.count, self.n_u, n))
        linear = quadratic = 0.0
        if curved:
            H_cost = H_cost + self._curvatures(x, u, slopes, by, V)
        for i in reversed(range(self.count)):
            F = slopes[i]
            g, H = by[i] + F.T @ V, H_cost[i] + F.T @ W @ F
            H_uu = H[n:, n:] + regular * max(np.trace(H[n:, n:]) / self.n_u, 1e-300) * np.eye(self.n_u)
            if np.linalg.eigvalsh(H_uu)[0] <= 0.0:
                H_uu = self._convex(H_uu)
            k[i], free = box_minimum(H_uu, g[n:], self.low - u[i], self.high - u[i])
            if free.any() and regular < DOMINANT:
                K[i, free] = -np.linalg.solve(H_uu[np.ix_(free, free)], H[n:, :n][free])
            linear += k[i] @ g[n:]
            quadratic += 0.5 * k[i] @ H[n:, n:] @ k[i]
            V = g[:n] + K[i].T @ g[n:]
            if regular <= SMALL:  # of a whole step; without it, short steps are certain to reduce the cost
                V = V + (K[i].T @ H[n:, n:] + H[n:, :n].T) @ k[i]
            W = H[:n, :n] + K[i].T @ H[n:, n:] @ K[i] + K[i].T @ H[n:, :n] + H[n:, :n].T @ K[i]
            W = (W + W.T) / 2.0
        return _Gains(k, K, linear, quadratic)

    @staticmethod
    def _convex(H: np.ndarray) -> np.ndarray:
        """Matrix with the sizes of the eigenvalues in their places."""
        values, vectors = np.linalg.eigh(H)
        if not np.abs(values).max() > 0.0:
            raise SimulationError("ilqr: the cost does not depend on the inputs; let it grow with u, as 1e-3 * u @ u does.")
        return (vectors * np.maximum(np.abs(values), 1e-8 * np.abs(values).max())) @ vectors.T

    def _columns(self, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        return np.ascontiguousarray(np.concatenate([self.t[:-1, None], x[:-1], u], axis=1).T)

    def _slopes(self, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        """∂F/∂(x, u) (N, n_x, n_x + n_u) of all steps."""
        m = self.n_x + self.n_u
        given = np.concatenate([self.t[:-1, None], np.full((self.count, 1), self.h), x[:-1]], axis=1)
        columns = [np.repeat(given, m, axis=0).T, np.tile(np.eye(m), self.count), np.repeat(u, m, axis=0).T]
        found = self.step.tangent(np.ascontiguousarray(np.concatenate(columns)))
        return np.moveaxis(found.reshape(self.n_x, self.count, m), 0, 1)

    def _curvatures(self, x: np.ndarray, u: np.ndarray, slopes: np.ndarray, by: np.ndarray, end: np.ndarray) -> np.ndarray:
        """Σ λ ∂²F (N, n_x + n_u, n_x + n_u) of all steps, λ being the gradient of the cost by their ends."""
        m, multipliers = self.n_x + self.n_u, np.empty((self.count, self.n_x))
        for i in reversed(range(self.count)):
            multipliers[i] = end
            end = (by[i] + slopes[i].T @ end)[: self.n_x]
        given = np.concatenate([self.t[:-1, None], np.full((self.count, 1), self.h), x[:-1], multipliers], axis=1)
        columns = [np.repeat(given, m, axis=0).T, np.tile(np.eye(m), self.count), np.repeat(u, m, axis=0).T]
        found = self.step.curvature(np.ascontiguousarray(np.concatenate(columns)))
        return np.moveaxis(found.reshape(m, self.count, m), 0, 1)


class CurvedStep(MotionStep):
    """Step with its second derivatives."""

    @cached_property
    def curvature(self) -> Kernel:
        """((t, h), q, v, weights, direction, u) → derivative of the gradient of weights · (q, v) after the step."""

        def change(time, inputs, q, v, _, weights, direction):
            given = [*q, *v, *inputs]
            return forward(reverse(weights @ self.moved(time, q, v, ()), given), given, direction)

        return self._kernel("curvature", change, self.n_x, self.n_given)
