"""Environments of many motions: all of them make their steps in one call, in the lanes of vector registers."""

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from gauss.codegen import Kernel, one_tier
from gauss.dynamics.compile_scene import compile_scene
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.outputs import output_function, split
from gauss.dynamics.plan import BATCHES
from gauss.dynamics.rules import Question
from gauss.dynamics.store import cached_on_disk
from gauss.dynamics.traced_system import Program
from gauss.errors import SimulationError
from gauss.gym.task import Task
from gauss.simulation.batch.fixed_step_batch import FixedStepBatch
from gauss.simulation.batch.rollout import FIXED
from gauss.simulation.compiled_steps.loop_functions import fixed_batch
from gauss.system import State, retract


class MechanismVectorEnv(VectorEnv):
    """Vector environment of Gymnasium for a task of a smooth scene without laws of time.

    A motion that ended begins anew with the next action, which it ignores (``AutoresetMode.NEXT_STEP``). One that diverges
    terminates, with an observation of zeros; ``info["diverged"]`` marks it, and the others are not affected.

    Parameters
    ----------
    task : Task
        Scene, reward and end of an episode.
    num_envs : int
        Number of motions.
    integrator : str
        "rk4" or "semi_implicit_euler".
    threads : int
        Threads that share the motions.

    Raises
    ------
    SimulationError
        If the scene cannot be compiled for batches, with the reasons: ``gymnasium.vector.SyncVectorEnv`` takes any
        :class:`gauss.gym.MechanismEnv`.
    """

    metadata = {"render_modes": [], "autoreset_mode": AutoresetMode.NEXT_STEP}  # noqa: RUF012 (as Gymnasium declares it)

    def __init__(self, task: Task, num_envs: int, integrator: str = "rk4", threads: int = 1):
        self.task, self.num_envs, self.threads = task, num_envs, threads
        self.system = system = compile_scene(task.scene)
        laws, method = Laws(system), FIXED[integrator]
        BATCHES.plan(Question(system, laws))
        if laws.functions or system.relations.asks_time:
            raise SimulationError(f"scene {task.scene.name!r} has laws of time or state; use SyncVectorEnv of MechanismEnv.")
        with one_tier():
            program, key = Program(system, laws, inputs=True), (integrator, laws.key)
            self._loop = cached_on_disk(system, (fixed_batch, *key), lambda: fixed_batch(program, method))
            measure = lambda: Kernel(output_function(program, task.scene))  # noqa: E731
            self._measure = cached_on_disk(system, (output_function, *key), measure)
        self._start = system.initial_state()
        self._batch = FixedStepBatch(self._loop, np.tile(self._packed(self._start)[:, None], num_envs))
        self.single_action_space = task.action_space
        size = self._measure.n_out or system.n_q + system.n_v
        self.single_observation_space = task.observation_space(size)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self._actions, self._ended = np.zeros(num_envs, dtype=int), np.zeros(num_envs, dtype=bool)

    def reset(self, *, seed: int | None = None, options: dict | None = None) -> tuple[np.ndarray, dict]:
        """Begin all episodes from the start of the scene, each changed at random."""
        super().reset(seed=seed)
        self._begin(np.ones(self.num_envs, dtype=bool))
        return self._observed(), {}

    def step(self, actions) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict]:
        """Hold the actions (num_envs, n_u): (observations, rewards, terminated, truncated, info)."""
        u, began = np.require(actions, dtype=float, requirements=("C", "W")), self._ended.copy()
        if u.shape != self.action_space.shape or not np.isfinite(u).all():
            raise SimulationError(f"actions: expected finite numbers of shape {self.action_space.shape}, got {u.shape}.")
        states = self._batch.run(self.task.hold, self.task.step, self.task.hold, self.threads, u[:, None])[:, -1]
        self._batch.worst[:] = 0.0
        diverged = ~np.isfinite(states).all(axis=1) & ~began
        self._begin(began | diverged)  # nothing of a diverged motion is kept
        self._actions[~began] += 1
        states, vector = self._batch.reached.T, self._vector()
        given = *np.split(states, [self.system.n_q], axis=1), u, split(vector, self.task.scene)
        rewards = np.where(began | diverged, 0.0, self.task.reward(*given))
        terminated = (np.asarray(self.task.terminated(*given), dtype=bool) & ~began) | diverged
        truncated = (self._actions >= self.task.actions) & ~began
        self._ended = terminated | truncated
        observed = self._observed()
        observed[diverged] = 0.0
        return observed, rewards, terminated, truncated, {"diverged": diverged} if diverged.any() else {}

    def _begin(self, which: np.ndarray):
        """Begin the episodes of some motions."""
        points, n = self._batch.points, self.system.n_v
        for k in np.flatnonzero(which):
            change = self.np_random.uniform(-self.task.spread, self.task.spread, (2, n))
            q = retract(self.system, self._start.q, change[0])
            moved = self.system.projected(State(0.0, q, self._start.v + change[1]))
            points[:, k] = 0.0
            points[self._batch.states, k] = self._packed(moved)
            self._actions[k] = 0
        self._ended[which] = False

    def _packed(self, state: State) -> np.ndarray:
        return np.concatenate([state.q, state.v])

    def _vector(self) -> np.ndarray:
        """Outputs (num_envs, m) of the present states."""
        return self._measure(self._batch.points)[:, : self.num_envs].T.copy()

    def _observed(self) -> np.ndarray:
        return self._vector() if self.task.scene.outputs else self._batch.reached.T.copy()
