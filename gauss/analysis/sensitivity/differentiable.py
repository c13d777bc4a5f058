"""Accelerations and motions as functions with a value and a pullback: what libraries of automatic differentiation ask for.

A pullback carries the weights of a result to those of the arguments, w ↦ wᵀ ∂result/∂argument: one solution for
accelerations, the adjoint equations for motions. Weights of a unit quaternion are tangent to the sphere.
"""

from dataclasses import replace

import numpy as np

from gauss.analysis.sensitivity.motion import Motion, smooth_motion
from gauss.dynamics.motion_step import MotionStep
from gauss.dynamics.scene_compilation import system_of
from gauss.errors import ArgumentError
from gauss.scene import Scene
from gauss.system import System, coordinate_rates


class DifferentiableDynamics:
    """Accelerations of states under the loads of the scene."""

    def __init__(self, system: System | Scene):
        self.system = system_of(system, "dynamics")

    def value(self, q: np.ndarray, v: np.ndarray, load: np.ndarray) -> np.ndarray:
        """Accelerations (…, n_v) of states (…, n_q), (…, n_v) with generalised forces (…, n_v) added."""
        rows = zip(*(np.reshape(part, (-1, part.shape[-1])) for part in (q, v, load)), strict=True)
        return np.array([self.system.forward_dynamics(*row) for row in rows]).reshape(v.shape)

    def pullback(self, q: np.ndarray, v: np.ndarray, load: np.ndarray, weights: np.ndarray) -> tuple[np.ndarray, ...]:
        """Weights of q, v and load, of those of the accelerations."""
        given = [np.reshape(part, (-1, part.shape[-1])) for part in (q, v, load, weights)]
        found = [self._row(*row) for row in zip(*given, strict=True)]
        return tuple(
            np.array(part).reshape(like.shape) for part, like in zip(zip(*found, strict=True), (q, v, load), strict=True)
        )

    def _row(self, q, v, load, weights) -> tuple[np.ndarray, ...]:
        by_q, by_v, by_load = self.system.acceleration_derivatives(q, v, load)
        along = weights @ by_q
        if self.system.n_q != self.system.n_v:
            T = np.array([coordinate_rates(self.system, q, unit) for unit in np.eye(self.system.n_v)]).T
            along = np.linalg.lstsq(T.T, along, rcond=None)[0]
        return along, weights @ by_v, weights @ by_load


class DifferentiableMotion:
    """Motions of fixed steps from a start, under inputs held in each step.

    Parameters
    ----------
    system : System or Scene
        The system; impacts, stick and slip are events, see :func:`gauss.sensitivities`.
    duration, step : float
        Duration, a whole number of steps, and step [s].
    integrator : str
        "rk4", "dopri5" or "dop853".
    """

    def __init__(self, system: System | Scene, duration: float, step: float, integrator: str = "rk4"):
        self.system = system_of(system, "motion")
        self.settings = {"duration": duration, "step": step, "parameters": (), "integrator": integrator}
        first = Motion(self.system, state=None, inputs=None, **self.settings)
        self.steps, self.n_u = first.steps, first.inputs.shape[1]
        self.smooth: MotionStep | None = None if self.system.scene.nonsmooth else first.step
        self.groups = [] if self.smooth is None else first.groups

    def run(self, q: np.ndarray, v: np.ndarray, inputs: np.ndarray) -> tuple[np.ndarray, list[list]]:
        """States (steps + 1, n_q + n_v) of a motion, and its linear maps by step."""
        if inputs.shape != (self.steps, self.n_u):
            raise ArgumentError(f"motion: inputs: expected shape {(self.steps, self.n_u)}, got {inputs.shape}.")
        if self.smooth is None:
            state = replace(self.system.initial_state(), q=q, v=v)
            motion = Motion(self.system, state=state, inputs=inputs, **self.settings)
            return motion.x, motion.pieces
        return smooth_motion(self.smooth, self.groups, np.concatenate([q, v]), inputs)

    def value(self, q: np.ndarray, v: np.ndarray, inputs: np.ndarray) -> np.ndarray:
        """States (steps + 1, n_q + n_v) of a motion."""
        return self.run(q, v, inputs)[0]

    def pullback(self, q: np.ndarray, v: np.ndarray, inputs: np.ndarray, weights: np.ndarray) -> tuple[np.ndarray, ...]:
        """Weights of q, v and inputs, of those (steps + 1, n_q + n_v) of the states."""
        return self.back(self.run(q, v, inputs)[1], weights)

    def back(self, pieces: list[list], weights: np.ndarray) -> tuple[np.ndarray, ...]:
        """The same along the linear maps of a motion."""
        now, by_inputs = np.array(weights[-1], dtype=float), np.zeros((self.steps, self.n_u))
        ends = [now.size, now.size + self.n_u]
        for k, before in zip(reversed(range(self.steps)), weights[-2::-1], strict=True):
            for piece in reversed(pieces[k]):
                now, own, _ = np.split(piece.gradient(now), ends)
                by_inputs[k] += own
            now = now + before
        by_q, by_v = np.split(now, [self.system.n_q])
        return by_q, by_v, by_inputs
