"""Motions of many systems of one kind, each with numbers and a start of its own, by one piece of machine code."""

import numpy as np

from gauss.dynamics.consistent_states import RESIDUAL_TOLERANCE
from gauss.dynamics.error_scale import ACCELERATION_TOLERANCE
from gauss.dynamics.laws.switching_functions import switching
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.parametrised_system import family
from gauss.dynamics.plan import BATCHES
from gauss.dynamics.rules import Question
from gauss.dynamics.traced_system import Program
from gauss.errors import SimulationError
from gauss.simulation.batch.adaptive_batch import AdaptiveBatch, Streaming
from gauss.simulation.batch.fixed_step_batch import Batch
from gauss.simulation.batch.rollout import OWN_STEPS, STEPS
from gauss.simulation.compiled_steps.explicit_stages import memory
from gauss.simulation.compiled_steps.loop_functions import many
from gauss.simulation.energy_balance import shares
from gauss.simulation.tolerances import tolerance
from gauss.simulation.undetected_switching import warn_of_passages, warn_of_times
from gauss.system import State, System


class Ensemble:
    """Machine code for systems of one kind.

    Parameters
    ----------
    pattern : System
        One of them.
    members : ndarray, shape (batch, n)
        Numbers of some, see :func:`gauss.dynamics.parameters.numbers`: what differs among them may differ.
    integrator : str
        "dop853" or "dopri5", whose steps are chosen for each motion; "rk4" or "semi_implicit_euler".
    step : float, optional
        Largest step [s].
    rtol : float
        Local error of steps that are chosen, relative to coordinates and rates.
    atol : float, pair or mapping
        Absolute part of it, as for :func:`gauss.simulate`.

    Raises
    ------
    SimulationError
        If the systems cannot be compiled, with the reasons, or not with this integrator.
    """

    def __init__(self, pattern: System, members: np.ndarray, integrator: str, step: float | None, rtol: float, atol):
        laws = Laws(pattern)
        if integrator not in STEPS | OWN_STEPS:
            raise SimulationError(f"integrator {integrator!r} moves one system at a time.")
        BATCHES.plan(Question(pattern, laws))
        self.integrator, self.laws = integrator, laws
        self.family, self.step, self.tolerance = family(pattern, members), step, tolerance(pattern, rtol, atol)
        self.known = np.array([members[0], _differing(members)])
        system, given = self.family.system, {"family": self.family}
        if integrator in STEPS:
            self.code = many(Program(system, laws, **given), STEPS[integrator])
        else:
            program = Program(system, laws, memory=memory(pattern), **given)
            self.code = Streaming(program, OWN_STEPS[integrator], self.tolerance.shares)

    def covers(self, members: np.ndarray) -> bool:
        """Whether systems with these numbers (batch, n) differ in nothing but the parameters."""
        same = np.ones(members.shape[1], dtype=bool)
        same[self.family.varied] = False
        return bool((members[:, same] == self.known[0, same]).all())

    def move(self, starts, members, times, threads: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Make motions.

        Parameters
        ----------
        starts : ndarray, shape (n_q + n_v, batch)
            Consistent starts at t = 0.
        members : ndarray, shape (batch, n)
            Numbers of each system.
        times : ndarray, shape (k,)
            Samples [s], equally spaced from 0 on.
        threads : int
            Threads that share the motions.

        Returns
        -------
        samples : ndarray, shape (batch, k, n_q + n_v)
            States.
        doubtful : ndarray of bool, shape (batch,)
            Motions that could not be confirmed: accelerations are checked on the way by inverse dynamics, loops by gaps; all
            where steps of one length pass switching times, or prescribed speeds jump.
        share : ndarray, shape (batch,)
            What their energy balance is off by, relative to their largest energy.

        Raises
        ------
        SimulationError
            If a prescribed position jumps.
        """
        system, duration = self.family.pattern, float(times[-1])
        start = State(0.0, *np.split(starts[:, 0], [system.n_q]))
        heeded = switching(system, self.laws, start, duration)
        warn_of_times(system, heeded.times)
        if heeded.jumps or (heeded.times.switches.size and not isinstance(self.code, Streaming)):
            alone = np.ones(starts.shape[1], dtype=bool)
            return np.full((alone.size, len(times), len(starts)), np.nan), alone, np.zeros(alone.size)
        parameters = members[:, self.family.varied].T
        if isinstance(self.code, Streaming):
            batch = AdaptiveBatch(self.code, starts, self.tolerance, parameters)
            found = batch.run(times, self.step, threads, heeded.times)
            return (
                found.samples,
                ~(found.error <= ACCELERATION_TOLERANCE),
                shares(system, found.looked, starts, found.samples, duration),
            )
        batch = Batch(self.code, starts, parameters)
        between = max(1, int(np.ceil((times[1] - times[0]) / self.step - 1e-9)))
        step = (times[1] - times[0]) / between
        samples = batch.run(between * (len(times) - 1), step, between, threads)
        warn_of_passages(system, batch.unseen + heeded.times.unresolved(0.0, duration, step), self.integrator)
        finite = np.isfinite(samples).all(axis=(1, 2))
        doubtful = ~((batch.error <= ACCELERATION_TOLERANCE) & (batch.gap <= RESIDUAL_TOLERANCE) & finite)
        return samples, doubtful, shares(system, batch.looked, starts, samples, duration)


def _differing(members: np.ndarray) -> np.ndarray:
    """Row that differs from the first one wherever any does."""
    return members[np.argmax(members != members[0], axis=0), np.arange(members.shape[1])]
