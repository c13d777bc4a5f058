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
    the trajectories of all that have any.

    Warns
    -----
    BalanceWarning
        If there are any.
    """
    failed: dict[int, str] = {}
    trajectories: dict[int, Trajectory] = {}
    for k in map(int, doubtful):
        start = State(0.0, *np.split(starts[:, k], [system.n_q]))
        held = {} if control is None else {"control": control[k], "rate": control.shape[1] / duration}
        try:
            with imbalances() as found:
                again = simulate(system, duration, state=start, progress=False, **run, **held)
        except SimulationError as error:
            failed[k], again = str(error), error.trajectory
            samples[k], share[k] = np.nan, 0.0
            samples[k, run["times"] == 0.0] = starts[:, k]
            if again is not None and len(again):
                reached = np.searchsorted(again.t, run["times"]).clip(max=len(again) - 1)
                rows = np.flatnonzero(again.t[reached] == run["times"])
                samples[k, rows] = np.concatenate([again.q, again.v], axis=1)[reached[rows]]
                trajectories[k] = again
            continue
        samples[k], share[k] = np.concatenate([again.q, again.v], axis=1), found[-1].share
        trajectories[k] = again
    warn_of_many(system, share, lambda k: f"number {k}", run)
    return failed, trajectories


def tell_of_divergence(system: System, batch: int, reasons: dict[int, str], trajectories: dict[int, Trajectory]):
    """Warn of motions that cannot continue, by their number and reason.

    Warns
    -----
    DivergenceWarning
        If there are some, and others reach the end.

    Raises
    ------
    SimulationError
        If none reaches the end; its ``trajectory`` is the first motion so far.
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
