"""Task: a scene with inputs and outputs, a reward, and when an episode ends; of one motion or of many."""

from collections.abc import Callable
from dataclasses import dataclass
from numbers import Real

import numpy as np

from gauss.errors import ArgumentError, extra
from gauss.scene import Scene

with extra("gym"):
    import gymnasium


def _never(q, v, u, y) -> np.ndarray:
    """No episode ends before its time."""
    return np.zeros(np.shape(q)[:-1], dtype=bool)


@dataclass(frozen=True)
class Task:
    """Scene, reward and end of an environment.

    Functions take arrays of one motion or of many, so that one source serves both: q (…, n_q), v (…, n_v), u (…, n_u) and a
    dict y of the outputs of the scene, (…, m) each.

    Parameters
    ----------
    scene : Scene
        Scene whose inputs all have limits; its outputs are the observation, coordinates and rates where it has none.
    reward : callable
        (q, v, u, y) at the end of a step → reward (…).
    terminated : callable
        (q, v, u, y) → whether the episode ends (…).
    rate : float
        Actions in a second [Hz].
    duration : float
        Length of an episode [s], after which it is truncated.
    step : float
        Step of the integrator [s]; a divisor of 1 / rate.
    spread : float
        Largest random change of the coordinates [rad, m] and rates [rad/s, m/s] of the start.

    Raises
    ------
    ArgumentError
        If the scene has no inputs, or one without limits, a time is not positive, or the step does not divide that of an
        action.

    Examples
    --------
    >>> import gauss
    >>> from gauss.gym import Task
    >>> scene = gauss.load("pendulum")
    >>> torque = scene.input("torque", "A", limits=(-5.0, 5.0))
    >>> task = Task(scene, reward=lambda q, v, u, y: -v[..., 0] ** 2, rate=50.0)
    >>> task.actions, task.hold
    (500, 10)
    """

    scene: Scene
    reward: Callable[..., np.ndarray]
    terminated: Callable[..., np.ndarray] = _never
    rate: float = 50.0
    duration: float = 10.0
    step: float = 2e-3
    spread: float = 0.05

    def __post_init__(self):
        """Check the inputs and the step."""
        if not (isinstance(self.scene, Scene) and callable(self.reward) and callable(self.terminated)):
            raise ArgumentError("task: expected a gauss.Scene and functions (q, v, u, y) for reward and end.")
        if not self.scene.inputs:
            raise ArgumentError(f"task: scene {self.scene.name!r} has no inputs; declare some with scene.input.")
        for given in self.scene.inputs.values():
            if given.limits is None:
                raise ArgumentError(f"task: input {given.name!r} has no limits; actions need them.")
        for name in ("rate", "duration", "step"):
            if not isinstance(getattr(self, name), Real) or not 0.0 < getattr(self, name) < np.inf:
                raise ArgumentError(f"task: {name}: expected a positive number, got {getattr(self, name)!r}.")
        if self.hold < 1 or abs(self.hold * self.step * self.rate - 1.0) > 1e-9:
            raise ArgumentError(f"task: the step of {self.step} s does not divide the time of an action, {1 / self.rate} s.")

    @property
    def hold(self) -> int:
        """Steps for each action."""
        return round(1.0 / (self.rate * self.step))

    @property
    def actions(self) -> int:
        """Actions in an episode."""
        return round(self.duration * self.rate)

    @property
    def action_space(self) -> gymnasium.spaces.Box:
        """Box of the inputs [N m, N]."""
        low, high = np.array([given.bounds for given in self.scene.inputs.values()]).T
        return gymnasium.spaces.Box(low, high, dtype=np.float64)

    def observation_space(self, size: int) -> gymnasium.spaces.Box:
        """Box of an observation of a number of values."""
        return gymnasium.spaces.Box(-np.inf, np.inf, (size,), dtype=np.float64)
