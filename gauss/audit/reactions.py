"""Reactions of joints along a motion."""

import warnings
from typing import NamedTuple

import numpy as np

from gauss.assembly import assemble
from gauss.backends import solve
from gauss.errors import NonUniqueReactionWarning, SimulationError
from gauss.shapes import Shaped
from gauss.simulation import Trajectory
from gauss.system import State, System


class Reaction(NamedTuple):
    """What the parent exerts on the child through a joint, drive included, world axes.

    Attributes
    ----------
    force : ndarray, shape (k, 3)
        Force [N].
    moment : ndarray, shape (k, 3)
        Moment about the joint point, which is fixed in the child [N m].
    """

    force: Shaped[np.ndarray, "k 3"]
    moment: Shaped[np.ndarray, "k 3"]


def reactions(trajectory: Trajectory, joint: str, backend: str = "auto") -> Reaction:
    """Reaction of a joint at every sample of a trajectory: moment −λ_ω and force −λ_v of its six rows.

    Parameters
    ----------
    trajectory : Trajectory
        The motion.
    joint : str
        Name of the joint.
    backend : str
        How each instant is solved.

    Returns
    -------
    Reaction
        ``force`` and ``moment``, each (k, 3).

    Warns
    -----
    NonUniqueReactionWarning
        If redundant constraints leave the reaction open; what is returned is then one of many.

    Raises
    ------
    SimulationError
        If an instant cannot be solved with a certificate.
    """
    system = trajectory.system
    system.joint(joint)
    found = [_multipliers(system, trajectory.state(i), joint, backend) for i in range(len(trajectory))]
    if any(loose for _, loose in found):
        warnings.warn(
            f"the reaction of joint {joint!r} is not unique: redundant rows let other joints share it. "
            "What is returned has the least norm of many that give the same motion; do not use it to size the joint.",
            NonUniqueReactionWarning,
            stacklevel=2,
        )
    rows = 0.0 - np.array([multipliers for multipliers, _ in found])
    return Reaction(force=rows[:, 3:], moment=rows[:, :3])


def _multipliers(system: System, state: State, joint: str, backend: str):
    solution = solve(assemble(system, state), backend)
    if not solution.status.certified:
        raise SimulationError(f"t = {state.t:.6g} s, backend {solution.backend!r}: {solution.status}.")
    rows = next(c.rows for c in system.structure.constraints if c.name == joint)
    return solution.multipliers[rows], joint in solution.certificate.not_unique
