"""Forces of one-sided constraints along a motion."""

import warnings

import numpy as np

from gauss.assembly import Applied, assemble_motion, closed, gaps, with_gaps
from gauss.backends import solve
from gauss.backends.recursion import Factor
from gauss.errors import BackendError, NonUniqueReactionWarning, SimulationError, StateError, known
from gauss.shapes import Shaped
from gauss.simulation import Trajectory

OPEN = 1e-9  # share of the largest entry above which a force is open


def contact_forces(trajectory: Trajectory, name: str, backend: str = "auto") -> Shaped[np.ndarray, "k m"]:
    """Forces that the gaps of a one-sided constraint exert, at every sample; zero where a gap is open.

    Of a contact it is what presses the bodies apart [N], of a rope the tension [N], of a stop the torque or force on the
    joint, away from the stop [N m, N]. Impulses of impacts are no forces and are not among them.

    Parameters
    ----------
    trajectory : Trajectory
        The motion.
    name : str
        Name of a stop, rope or contact.
    backend : str
        How each instant is solved.

    Returns
    -------
    ndarray, shape (k, m)
        One column for each gap, in the order of their names in ``sides`` of the constraint.

    Warns
    -----
    NonUniqueReactionWarning
        If more gaps are closed than it takes, as under a box with four feet: single forces are then one of many
        distributions; their sum and moment are right.

    Raises
    ------
    StateError
        If there is no such constraint.
    SimulationError
        If an instant cannot be solved with a certificate.
    """
    system = trajectory.system
    contacts = system.scene.contacts
    if name not in contacts:
        raise StateError(f"no one-sided constraint {name!r}. {known(name, contacts)}")
    places = {placed.name: i for i, placed in enumerate(system.contacts.placed)}
    mine = [places[side] for side in contacts[name].sides(system.scene)]
    found, open_forces = np.zeros((len(trajectory), len(places))), False
    for sample, motion in zip(found, trajectory.motions, strict=True):
        instant = gaps(motion)
        which = closed(instant, np.abs(motion.state.v).max(initial=0.0))
        if not np.isin(which, mine).any():
            continue
        compulsion = with_gaps(assemble_motion(motion, Applied(motion)), instant, which)
        solution = solve(compulsion, backend)
        if not solution.status.certified:
            raise SimulationError(f"t = {motion.state.t:.6g} s, backend {solution.backend!r}: {solution.status}.")
        sample[which] = solution.inequality_multipliers
        open_forces = open_forces or _open(compulsion, np.isin(which, mine))
    if open_forces:
        warnings.warn(
            f"the forces of {name!r} are not unique: more gaps are closed than it takes to bear the load. Single forces are "
            "one of many distributions; do not size anything by them. Their sum and moment are right.",
            NonUniqueReactionWarning,
            stacklevel=2,
        )
    return found[:, mine]


def _open(compulsion, mine: np.ndarray) -> bool:
    try:
        basis = Factor(compulsion, np.arange(mine.size)).closure.free_active()
    except BackendError:
        return False
    return bool(basis.size and np.abs(basis[mine]).max() > OPEN * np.abs(basis).max())
