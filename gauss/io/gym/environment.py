"""Environment of one motion."""

import numpy as np

from gauss.arguments import real_numbers
from gauss.dynamics.outputs import split
from gauss.errors import ArgumentError, SimulationError, extra, require
from gauss.io.gym.task import Task
from gauss.simulation import Simulator

with extra("gym"):
    import gymnasium


class MechanismEnv(gymnasium.Env):
    """Environment of Gymnasium for a task; contacts and friction included.

    The observation (m,) is the outputs of the scene, or coordinates and rates where it has none; an action (n_u,) is held
    for 1 / rate. A motion that cannot continue terminates: ``info["failure"]`` says why.

    Parameters
    ----------
    task : Task
        Scene, reward and end of an episode.
    integrator : str, optional
        Fixed-step method, see :class:`gauss.Simulator`.

    Raises
    ------
    ArgumentError
        If the task is none.

    Examples
    --------
    >>> from gauss.gym import MechanismEnv, acrobot
    >>> environment = MechanismEnv(acrobot())
    >>> observation, info = environment.reset(seed=0)
    >>> observation, reward, terminated, truncated, info = environment.step(environment.action_space.sample())
    >>> terminated, truncated
    (False, False)
    """

    metadata: dict = {"render_modes": []}  # noqa: RUF012 (as Gymnasium declares it)

    def __init__(self, task: Task, integrator: str | None = None):
        require(task, (Task,), "MechanismEnv")
        self.task, self.simulator = task, Simulator(task.scene, task.step, integrator)
        self.action_space = task.action_space
        self._last = self._observed()
        self.observation_space = task.observation_space(self._last.size)
        self._actions = 0

    def reset(self, *, seed: int | None = None, options: dict | None = None) -> tuple[np.ndarray, dict]:
        """Begin an episode from the start of the scene, changed at random; ``options={"state": State}`` gives another."""
        super().reset(seed=seed)
        state = (options or {}).get("state")
        if state is None:
            self.simulator.reset(seed=int(self.np_random.integers(2**31)), spread=self.task.spread)
        else:
            self.simulator.reset(state)
        self._actions, self._last = 0, self._observed()
        return self._last, {}

    def step(self, action) -> tuple[np.ndarray, float, bool, bool, dict]:
        """Hold an action: (observation, reward, terminated, truncated, info).

        Raises
        ------
        ArgumentError
            If the action is not a finite number for each input.
        """
        simulator, given = self.simulator, real_numbers(action)
        if given is None or given.shape != self.action_space.shape or not np.isfinite(given).all():
            raise ArgumentError(f"step: expected {len(simulator.inputs)} finite numbers, one an input, got {action!r}.")
        try:
            simulator.step(given, n=self.task.hold)
        except SimulationError as error:
            return self._last, 0.0, True, False, {"failure": str(error)}
        self._actions += 1
        self._last = vector = self._observed()
        outputs = split(vector, self.task.scene) if simulator.output_names else {}
        end = *simulator.coordinates, given, outputs
        reward, ends = float(self.task.reward(*end)), bool(self.task.terminated(*end))
        return vector, reward, ends, self._actions >= self.task.actions, {}

    def _observed(self) -> np.ndarray:
        simulator = self.simulator
        return simulator.output_vector() if simulator.output_names else np.concatenate(simulator.coordinates)
