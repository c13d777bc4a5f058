"""Motions of a batch that are repeated one by one: those that a check of the batch does not confirm."""

import numpy as np

from gauss.errors import SimulationError
from gauss.simulation.energy_balance import imbalances, warn_of_many
from gauss.simulation.simulate import simulate
from gauss.simulation.trajectory import Trajectory
from gauss.system import State, System


def repeat(
    system: System, starts, samples: np.ndarray, share: np.ndarray, doubtful, duration: float, run: dict, control=None
) -> tuple[dict[int, str], dict[int, Trajectory]]:
    """Repeat motions by :func:`gauss.simulate` with the settings ``run``, and warn of energy balances.

    Samples and imbalances are changed. Returned are why motions with inputs cannot continue, whose samples are NaN, and the
    trajectories of the others.

    Warns
    -----
    BalanceWarning
        If there are any.

    Raises
    ------
    SimulationError
        If a motion without inputs cannot continue.
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
            if control is None:
                raise SimulationError(f"motion {k}: {error}", error.trajectory) from error
            failed[k] = str(error)
            samples[k], share[k] = np.nan, 0.0
            continue
        samples[k], share[k] = np.concatenate([again.q, again.v], axis=1), found[-1].share
        trajectories[k] = again
    warn_of_many(system, share, lambda k: f"number {k}", run)
    return failed, trajectories
