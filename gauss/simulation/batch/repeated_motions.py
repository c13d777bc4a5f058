"""Motions of a batch that are repeated one by one: those that a check of the batch does not confirm."""

import warnings

import numpy as np

from gauss.errors import DivergenceWarning, SimulationError, listed, user_level
from gauss.simulation.energy_balance import imbalances, warn_of_many
from gauss.simulation.simulate import simulate
from gauss.simulation.trajectory import Trajectory
from gauss.system import State, System


def repeat(
    system: System, starts, samples: np.ndarray, share: np.ndarray, doubtful, duration: float, run: dict, control=None
) -> tuple[dict[int, str], dict[int, Trajectory]]:
    """Repeat motions by :func:`gauss.simulate` with the settings ``run``, and warn of energy balances.

    Samples and imbalances are changed. Returned are why motions cannot continue, whose samples are NaN from there on, and
    the trajectories of all that have any. An interruption has the samples so far as its ``samples``, NaN behind them, and
    the trajectories as its ``again``.
    """
    failed: dict[int, str] = {}
    trajectories: dict[int, Trajectory] = {}
    every = list(map(int, doubtful))
    for place, k in enumerate(every):
        start = State(0.0, *np.split(starts[:, k], [system.n_q]))
        held = {} if control is None else {"control": control[k], "rate": control.shape[1] / duration}
        try:
            with imbalances() as found:
                again = simulate(system, duration, state=start, progress=False, **run, **held)
        except SimulationError as error:
            failed[k], share[k] = str(error), 0.0
            _keep(samples[k], starts[:, k], run["times"], error.trajectory)
            if error.trajectory is not None and len(error.trajectory):
                trajectories[k] = error.trajectory
            continue
        except KeyboardInterrupt as error:
            samples[every[place:]], so_far = np.nan, getattr(error, "trajectory", None)
            _keep(samples[k], starts[:, k], run["times"], so_far)
            trajectories |= {} if so_far is None else {k: so_far}
            error.samples, error.again = samples, trajectories  # type: ignore[attr-defined]
            raise
        samples[k], share[k] = np.concatenate([again.q, again.v], axis=1), found[-1].share
        trajectories[k] = again
    warn_of_many(system, share, lambda k: f"number {k}", run)
    return failed, trajectories


def _keep(samples: np.ndarray, start: np.ndarray, times: np.ndarray, so_far: Trajectory | None):
    """Keep the samples (k, n_q + n_v) of a motion so far; those behind are NaN."""
    samples[:] = np.nan
    samples[times == 0.0] = start
    if so_far is not None and len(so_far):
        reached = np.searchsorted(so_far.t, times).clip(max=len(so_far) - 1)
        rows = np.flatnonzero(so_far.t[reached] == times)
        samples[rows] = np.concatenate([so_far.q, so_far.v], axis=1)[reached[rows]]


def tell_of_divergence(system: System, batch: int, reasons: dict[int, str], trajectories: dict[int, Trajectory]):
    """Warn of motions that cannot continue, by their number and reason, if others reach the end.

    SimulationError if none does; its ``trajectory`` is the first motion so far.
    """
    if not reasons:
        return
    first = min(reasons)
    if len(reasons) == batch:
        raise SimulationError(f"motion {first}: {reasons[first]}", trajectories.get(first))
    warnings.warn(
        f"scene {system.scene.name!r}: {len(reasons)} of {batch} motions do not reach the end: "
        f"{listed(sorted(reasons))}. Number {first}: {reasons[first]}",
        DivergenceWarning,
        stacklevel=user_level(),
    )
