"""Ensemble: motions of systems that differ in parameters and initial states, by one piece of machine code."""

import numpy as np

from gauss.codegen import one_tier
from gauss.codegen.gpu.batches import DeviceFixedStepLoop
from gauss.codegen.kernels import FixedStepBatchLoop
from gauss.dynamics.consistent_states import RESIDUAL_TOLERANCE
from gauss.dynamics.error_scale import ACCELERATION_TOLERANCE
from gauss.dynamics.laws.constraint_modes import constraint_modes
from gauss.dynamics.laws.switching import switching
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.parameters import parametrised
from gauss.dynamics.plan import BATCHES
from gauss.dynamics.rules import Question
from gauss.dynamics.traced_system import Program
from gauss.errors import SimulationError
from gauss.simulation.batch.adaptive_batch import AdaptiveBatch, AdaptiveBatchCode
from gauss.simulation.batch.fixed_step_batch import DeviceFixedStepBatch, FixedStepBatch
from gauss.simulation.batch.machine_code import FIXED
from gauss.simulation.batch.rollout import ADAPTIVE
from gauss.simulation.compiled_steps.loop_functions import fixed_batch
from gauss.simulation.energy_balance import shares
from gauss.simulation.tolerances import tolerance
from gauss.simulation.undetected_switching import warn_of_passages, warn_of_times
from gauss.system import State, System


class Ensemble:
    """Machine code of a parametrised system: one of the systems, and the numbers in which some members (batch, n) differ.

    Numbers: see :func:`gauss.dynamics.parameters.numbers`. Integrators: "dop853" or "dopri5", with steps of each motion, up
    to ``step`` [s]; "rk4" or "semi_implicit_euler". ``atol``: as for :func:`gauss.simulate`. SimulationError if the systems
    cannot be compiled, with the reasons, or not with this integrator.
    """

    def __init__(
        self,
        pattern: System,
        members: np.ndarray,
        integrator: str,
        step: float | None,
        rtol: float,
        atol,
        device: str | None = None,
    ):
        laws = Laws(pattern)
        if integrator not in FIXED | ADAPTIVE:
            raise SimulationError(f"integrator {integrator!r} moves one system at a time.")
        BATCHES.plan(Question(pattern, laws))
        self.integrator, self.laws = integrator, laws
        self.family, self.step, self.tolerance = parametrised(pattern, members), step, tolerance(pattern, rtol, atol)
        self.known = np.array([members[0], _differing(members)])
        system = self.family.system
        self.code: FixedStepBatchLoop | DeviceFixedStepLoop | AdaptiveBatchCode
        if integrator in FIXED:
            self.code = fixed_batch(Program(system, laws, family=self.family), FIXED[integrator], device)
        else:
            method = ADAPTIVE[integrator]
            program = Program(system, laws, memory=method.state_size(pattern), family=self.family)
            self.code = AdaptiveBatchCode(program, method, self.tolerance.shares, device)

    def covers(self, members: np.ndarray) -> bool:
        """Whether systems with these numbers (batch, n) differ in the parameters only."""
        same = np.ones(members.shape[1], dtype=bool)
        same[self.family.varied] = False
        return bool((members[:, same] == self.known[0, same]).all())

    @one_tier()
    def move(self, starts, members, times, threads: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Samples (batch, k, n_q + n_v) of members, which of them fail a check (batch,), and their imbalances (batch,).

        Consistent starts are (n_q + n_v, batch) at t = 0, numbers of members (batch, n), times of samples (k,) equally
        spaced from 0 on [s]. Accelerations are checked by inverse dynamics, loops by constraint residuals; all members fail
        where fixed steps cross switching times, or prescribed velocities or constraints jump. The imbalance is the residual
        of the energy balance, relative to the largest energy. SimulationError if a prescribed position jumps.
        """
        system, duration = self.family.pattern, float(times[-1])
        start = State(0.0, *np.split(starts[:, 0], [system.n_q]))
        switched = switching(system, self.laws, start, duration)
        warn_of_times(system, switched.times)
        divided = bool(switched.jumps) or constraint_modes(system) is not None
        if divided or (switched.times.switches.size and not isinstance(self.code, AdaptiveBatchCode)):
            singly = np.ones(starts.shape[1], dtype=bool)
            return np.full((singly.size, len(times), len(starts)), np.nan), singly, np.zeros(singly.size)
        parameters = members[:, self.family.varied].T
        if isinstance(self.code, AdaptiveBatchCode):
            adaptive = AdaptiveBatch(self.code, starts, self.tolerance, parameters)
            found = adaptive.run(times, self.step, threads, switched.times)
            return (
                found.samples[:, :, : len(starts)],
                ~(found.error <= ACCELERATION_TOLERANCE),
                shares(system, found.energies, starts, found.samples[:, :, : len(starts)], duration),
            )
        kind = DeviceFixedStepBatch if isinstance(self.code, DeviceFixedStepLoop) else FixedStepBatch
        batch = kind(self.code, starts, parameters)
        between = max(1, int(np.ceil((times[1] - times[0]) / self.step - 1e-9)))
        step = (times[1] - times[0]) / between
        samples = batch.run(between * (len(times) - 1), step, between, threads)
        warn_of_passages(system, batch.unseen + switched.times.unresolved(0.0, duration, step), self.integrator)
        finite = np.isfinite(samples).all(axis=(1, 2))
        doubtful = ~((batch.error <= ACCELERATION_TOLERANCE) & (batch.residual <= RESIDUAL_TOLERANCE) & finite)
        return samples, doubtful, shares(system, batch.energies, starts, samples, duration)


def _differing(members: np.ndarray) -> np.ndarray:
    """Row that differs from the first one wherever any does."""
    return members[np.argmax(members != members[0], axis=0), np.arange(members.shape[1])]
