"""Reactions of joints, forces of constraints and drives along a motion, from the multipliers −λ of each sample."""

import warnings
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from gauss.analysis.load_sharing import shared
from gauss.analysis.sample_forces import kept_with, sample_forces
from gauss.analysis.sample_solution import refuse_doubtful, solution_at
from gauss.backends import Backend
from gauss.dynamics.contact.mode_selection import mode_selector
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.loads import Applied
from gauss.dynamics.mobility import row_name
from gauss.errors import NonUniqueReactionWarning, StateError, did_you_mean, require
from gauss.scene import Drive, LimitedDrive, Prescribed
from gauss.shapes import Shaped
from gauss.simulation import Trajectory
from gauss.simulation.moreau.moreau_jean import steps_at
from gauss.system import System


class Reaction(NamedTuple):
    """Force and moment of the parent on the child through a joint, with its drives, world axes.

    Attributes
    ----------
    force : ndarray, shape (k, 3)
        Force [N].
    moment : ndarray, shape (k, 3)
        Moment about the joint point, which is fixed in the child [N m].
    """

    force: Shaped[np.ndarray, "k 3"]
    moment: Shaped[np.ndarray, "k 3"]


def reactions(
    trajectory: Trajectory,
    joint: str,
    backend: str | Backend | type = "auto",
    axes: str = "world",
    compliance: dict | None = None,
) -> Reaction:
    """Reaction of a joint at every sample of a trajectory: moment −λ_ω and force −λ_v of its six rows.

    Parameters
    ----------
    trajectory : Trajectory
        The motion.
    joint : str
        Name of the joint.
    backend : str, Backend or class
        Solver of each sample, see :func:`gauss.solve`; its certificate must cover the forces.
    axes : str
        "world", or the body or frame whose axes the components refer to.
    compliance : dict, optional
        By joint, six compliances along its axes, of rotation [rad/(N m)] and translation [m/N]: redundant joints share
        loads by least elastic energy. Other joints are rigid.

    Returns
    -------
    Reaction
        ``force`` and ``moment``, each (k, 3).

    Warns
    -----
    NonUniqueReactionWarning
        If the reaction is not unique, by redundant constraints; one of many is returned.

    Raises
    ------
    SimulationError
        If a sample has no solution with a certificate that covers these forces.
    """
    require(trajectory, (Trajectory,), "reactions")
    trajectory.system.joint(joint)
    rows = -multipliers(trajectory, joint, backend, compliance)
    moment, force = rows[:, :3], rows[:, 3:]
    if axes != "world":
        R = np.array([motion.rotation(axes) for motion in trajectory.motions])
        moment, force = (np.einsum("kji,kj->ki", R, part) for part in (moment, force))
    return Reaction(force=force + 0.0, moment=moment + 0.0)


def constraint_forces(
    trajectory: Trajectory, name: str, backend: str | Backend | type = "auto"
) -> Shaped[np.ndarray, "k m"]:
    """Forces −λ of a constraint at every sample, one for each of its residuals.

    A residual c has the force that does the work −λ dc: pushing along growing c where it is positive. Of a distance it is
    the force that drives the two points apart [N], of a prescribed coordinate the effort of the drive [N m, N].

    Parameters
    ----------
    trajectory : Trajectory
        The motion.
    name : str
        Name of a coupling or of a constraint beyond the joints.
    backend : str, Backend or class
        Solver of each sample, see :func:`gauss.solve`; its certificate must cover the forces.

    Returns
    -------
    ndarray, shape (k, m)
        [N] for residuals in m, [N m] for residuals in rad.

    Warns
    -----
    NonUniqueReactionWarning
        If the force is not unique, by redundant constraints.

    Raises
    ------
    StateError
        If there is no such constraint; the six reactions of a joint come from :func:`gauss.reactions`.
    SimulationError
        If a sample has no solution with a certificate that covers these forces.
    """
    require(trajectory, (Trajectory,), "constraint_forces")
    scene = trajectory.system.scene
    beyond = [*scene.couplings, *scene.relations]
    if name not in beyond:
        raise StateError(
            f"no constraint {name!r} beyond the joints. {did_you_mean(name, beyond)} For a joint use gauss.reactions."
        )
    return 0.0 - multipliers(trajectory, name, backend)


def drive_forces(trajectory: Trajectory, joint: str, backend: str | Backend | type = "auto") -> Shaped[np.ndarray, " k *n"]:
    """Generalised force of all drives of a joint at every sample: given ones, and those of prescribed motions.

    Parameters
    ----------
    trajectory : Trajectory
        The motion.
    joint : str
        Name of the joint.
    backend : str, Backend or class
        Solver of each sample, see :func:`gauss.solve`; its certificate must cover the forces.

    Returns
    -------
    ndarray, shape (k,) or (k, n)
        Torque [N m] or force [N] along each rate of the joint, at an impact just before and just after it; impulses of
        prescribed motions are in ``impulses`` of the event in ``trajectory.events``.

    Raises
    ------
    StateError
        If the joint has no drive.
    """
    require(trajectory, (Trajectory,), "drive_forces")
    system = trajectory.system
    places = system.joint(joint).v
    given = [bound for bound in system.loads if isinstance(bound.load, Drive) and bound.load.joint == joint]
    motions = _rates_of(system, joint, system.scene.relations, Prescribed)
    limited = _rates_of(system, joint, system.scene.set_valued, LimitedDrive)
    if not given and not motions and not limited:
        raise StateError(f"nothing drives joint {joint!r}; add a drive with scene.drive({joint!r}, …).")
    efforts = _given_efforts(trajectory, given, places)
    for name, rate in motions.items():
        efforts[:, rate] += constraint_forces(trajectory, name, backend)[:, 0]
    for name, rate in limited.items():
        efforts[:, rate] += set_valued_forces(trajectory, name, backend)
    return efforts[:, 0] if efforts.shape[1] == 1 else efforts


def _given_efforts(trajectory: Trajectory, given, places: slice) -> np.ndarray:
    """Efforts (k, n) of given drives along some rates; of many samples by machine code, where laws can be traced."""
    if not given:
        return np.zeros((len(trajectory), places.stop - places.start))
    names = [bound.load.name for bound in given]
    if any(bound.load.name in names for bound in Laws(trajectory.system).called):
        return np.array([Applied(motion, given).P[places] for motion in trajectory.motions])
    return trajectory.sampled(f"drives {names}", lambda motion: Applied(motion, given).P[places])


def _rates_of(
    system: System, joint: str, elements: Mapping[str, Any], kind: type[Prescribed | LimitedDrive]
) -> dict[str, int]:
    """Elements of a kind that act on a joint, by name, with the index of their rate among those of the joint."""
    acting = {name: system.coordinate(element.joint) for name, element in elements.items() if isinstance(element, kind)}
    return {name: rate or 0 for name, (placed, rate) in acting.items() if placed.name == joint}


def set_valued_forces(trajectory: Trajectory, name: str, backend: str | Backend | type = "auto") -> Shaped[np.ndarray, " k"]:
    """Torque [N m] or force [N] of a joint friction, limited drive, clutch, freewheel or lossy gear, at every sample.

    It acts along the coordinate of its joint; for links between two joints, of the driven one.

    Parameters
    ----------
    trajectory : Trajectory
        The motion.
    name : str
        Name of the element.
    backend : str, Backend or class
        Solver of each sample, see :func:`gauss.solve`; its certificate must cover the forces.

    Returns
    -------
    ndarray, shape (k,)
        Torque [N m] or force [N].

    Raises
    ------
    StateError
        If there is no such element.
    SimulationError
        If a sample has no solution with a certificate that covers these forces.
    """
    scene = trajectory.system.scene
    elements = scene.set_valued | scene.losses
    if name not in elements:
        raise StateError(f"nothing of the name {name!r} holds up to a limit or loses power. {did_you_mean(name, elements)}")
    if trajectory.step is not None:
        which = list(scene.set_valued).index(name) - len(scene.set_valued)
        return np.array([step.force[which] for step in map(steps_at(trajectory), range(len(trajectory)))])
    return np.array([forces[name] for forces in _mode_forces(trajectory, backend)])


def _mode_forces(trajectory: Trajectory, backend) -> list[dict]:
    """Forces of all set-valued elements and losses at every sample, by name."""

    def found():
        selector = mode_selector(trajectory.system)
        states = (trajectory.state(i) for i in range(len(trajectory)))
        return [selector.choose(state, selector.touching(state), backend).forces for state in states]

    return kept_with(trajectory, "forces of modes", backend, found)


def unique_reactions(
    trajectory: Trajectory, joint: str, backend: str | Backend | type = "auto"
) -> tuple[Reaction, list[str]]:
    """Reaction of a joint in world axes, its non-unique components set to zero, and their names."""
    trajectory.system.joint(joint)
    constraint, rows, open_rows = _found(trajectory, joint, backend, None)
    kept = np.where(open_rows, 0.0, -rows)
    return Reaction(kept[:, 3:] + 0.0, kept[:, :3] + 0.0), [row_name(constraint, int(k)) for k in np.flatnonzero(open_rows)]


def multipliers(trajectory: Trajectory, name: str, backend, compliance=None) -> Shaped[np.ndarray, "k m"]:
    """Multipliers (k, m) of a constraint at every sample; a warning where they are not unique."""
    constraint, values, open_rows = _found(trajectory, name, backend, compliance)
    if open_rows.any():
        components = ", ".join(row_name(constraint, int(k)) for k in np.flatnonzero(open_rows))
        warnings.warn(
            f"the reaction of {name!r} is not unique in {components}: redundant rows let others share it. "
            "What is returned there has the least norm of many that give the same motion; do not size anything by it.",
            NonUniqueReactionWarning,
            stacklevel=3,
        )
    return values


def _found(trajectory: Trajectory, name: str, backend, compliance):
    """Constraint, its multipliers (k, m) at every sample, and which of them are not unique (m,)."""
    if not compliance:
        return sample_forces(trajectory, backend).of(trajectory, name)
    constraint = next(c for c in trajectory.system.structure.constraints if c.name == name)
    found = [_shared(trajectory, i, constraint.rows, backend, compliance) for i in range(len(trajectory))]
    return constraint, np.array([values for values, _ in found]), np.any([loose for _, loose in found], axis=0)


def _shared(trajectory: Trajectory, index: int, rows: slice, backend, compliance):
    """Multipliers of some rows at a sample, shared by compliances, and which of them are not unique."""
    solution = solution_at(trajectory, index, backend)
    constraints = solution.compulsion.structure.constraints
    place = next(i for i, constraint in enumerate(constraints) if constraint.rows == rows)
    refuse_doubtful(solution, place, constraints[place].name, trajectory.t[index])
    values, loose = shared(solution, trajectory.motions[index], compliance)
    return values[rows], loose[rows] if loose.size else np.zeros(rows.stop - rows.start, dtype=bool)
