"""Environments of many motions: all of them make their steps in one call, in the lanes of vector registers."""

import numpy as np

from gauss.dynamics.outputs import split
from gauss.dynamics.projection import within_limits
from gauss.errors import ArgumentError, SimulationError, extra, require
from gauss.io.gym.task import Task
from gauss.simulation import SimulatorBatch
from gauss.system import State, retract

with extra("gym"):
    from gymnasium.vector import AutoresetMode, VectorEnv
    from gymnasium.vector.utils import batch_space


class MechanismVectorEnv(VectorEnv):
    """Vector environment of Gymnasium for a task of a scene without laws of time; contacts and friction included.

    A motion that ended begins anew with the next action, which it ignores (``AutoresetMode.NEXT_STEP``). One that diverges
    terminates, with an observation of zeros; ``info["diverged"]`` marks it, and the others are not affected.

    Parameters
    ----------
    task : Task
        Scene, reward and end of an episode.
    num_envs : int
        Number of motions.
    integrator : str, optional
        Fixed-step method, see :class:`gauss.SimulatorBatch`.
    threads : int
        Threads that share the motions.

    Raises
    ------
    ArgumentError
        If the task is none.
    SimulationError
        If the scene cannot be compiled for batches, with the reasons: ``gymnasium.vector.SyncVectorEnv`` takes any
        :class:`gauss.gym.MechanismEnv`.
    """

    metadata = {"render_modes": [], "autoreset_mode": AutoresetMode.NEXT_STEP}  # noqa: RUF012 (as Gymnasium declares it)

    def __init__(self, task: Task, num_envs: int, integrator: str | None = None, threads: int = 1):
        require(task, (Task,), "MechanismVectorEnv")
        self.task, self.num_envs = task, num_envs
        self.simulators = SimulatorBatch(task.scene, task.step, num_envs, integrator, threads)
        self.system = system = self.simulators.system
        if self.simulators.has_time_laws:
            raise SimulationError(f"scene {task.scene.name!r} has laws of time or state; use SyncVectorEnv of MechanismEnv.")
        self._start = system.initial_state()
        self.single_action_space = task.action_space
        self.single_observation_space = task.observation_space(self._observed().shape[1])
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self._actions, self._ended = np.zeros(num_envs, dtype=int), np.zeros(num_envs, dtype=bool)

    def reset(self, *, seed: int | None = None, options: dict | None = None) -> tuple[np.ndarray, dict]:
        """Begin all episodes from the start of the scene, each changed at random."""
        super().reset(seed=seed)
        self._begin(np.ones(self.num_envs, dtype=bool))
        return self._observed(), {}

    def step(self, actions) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict]:
        """Hold the actions (num_envs, n_u): (observations, rewards, terminated, truncated, info).

        Raises
        ------
        ArgumentError, SimulationError
            If the actions are not a finite number for each input of each motion.
        """
        began, many = self._ended.copy(), self.simulators
        if actions is None:
            raise ArgumentError(f"step: expected finite numbers of shape {self.action_space.shape}, got None.")
        many.step(actions, n=self.task.hold)
        u = np.asarray(actions, dtype=float)
        diverged = many.diverged & ~began
        self._begin(began | diverged)  # nothing of a diverged motion is kept
        self._actions[~began] += 1
        given = many.q, many.v, u, split(many.output_vectors(), self.task.scene)
        rewards = np.where(began | diverged, 0.0, self.task.reward(*given))
        terminated = (np.asarray(self.task.terminated(*given), dtype=bool) & ~began) | diverged
        truncated = (self._actions >= self.task.actions) & ~began
        self._ended = terminated | truncated
        observed = self._observed()
        observed[diverged] = 0.0
        return observed, rewards, terminated, truncated, {"diverged": diverged} if diverged.any() else {}

    def _begin(self, which: np.ndarray):
        """Begin the episodes of some motions."""
        chosen, spread = np.flatnonzero(which), self.task.spread
        self._actions[chosen], self._ended[chosen] = 0, False
        if not chosen.size:
            return
        starts = []
        for change in self.np_random.uniform(-spread, spread, (chosen.size, 2, self.system.n_v)):
            q = retract(self.system, self._start.q, change[0])
            starts.append(self.system.projected(within_limits(self.system, State(0.0, q, self._start.v + change[1]))))
        self.simulators.restart(chosen, [start.q for start in starts], [start.v for start in starts])

    def _observed(self) -> np.ndarray:
        many = self.simulators
        return many.output_vectors() if self.task.scene.outputs else np.concatenate([many.q, many.v], axis=1)
