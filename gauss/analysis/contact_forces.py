"""Forces of unilateral constraints along a motion: multipliers λ ≥ 0 of the closed gaps, and friction."""

import warnings
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from gauss.analysis.sample_forces import kept_with
from gauss.analysis.sample_solution import refuse_doubtful
from gauss.backends import Backend, solve
from gauss.backends.certificate import UNDETERMINED_SHARE
from gauss.backends.closure import Factor
from gauss.backends.solution import Solution
from gauss.dynamics.assemble import assemble_motion
from gauss.dynamics.contact.contact_stepper import lent_stepper
from gauss.dynamics.contact.mode_selection import ModeSelector, mode_selector
from gauss.dynamics.gap_functions import gaps, with_gaps
from gauss.dynamics.kinematics import Kinematics, kinematics
from gauss.dynamics.loads import Applied
from gauss.errors import NonUniqueReactionWarning, SimulationError, StateError, did_you_mean, require
from gauss.shapes import Shaped
from gauss.simulation import Trajectory
from gauss.simulation.moreau.moreau_jean import contact_parts, steps_at
from gauss.system import sides

NOT_UNIQUE = (
    "the forces of {} are not unique: more gaps are closed than it takes to bear the load. Single forces are those of least "
    "norm, one of many distributions; do not size anything by them. Their sum and moment are right."
)


def contact_forces(trajectory: Trajectory, name: str, backend: str | Backend | type = "auto") -> Shaped[np.ndarray, "k m"]:
    """Forces of the gaps of a unilateral constraint at every sample; zero where a gap is open.

    Of a contact it is the normal force [N], of a rope the tension [N], of a stop the torque or force on the joint, away from
    the stop [N m, N]. Impulses of impacts are not included; with time stepping, forces are means over the next step, with
    impulses.

    Parameters
    ----------
    trajectory : Trajectory
        The motion.
    name : str
        Name of a stop, rope or contact.
    backend : str, Backend or class
        Solver of each sample, see :func:`gauss.solve`; its certificate must cover the forces.

    Returns
    -------
    ndarray, shape (k, m)
        One column for each gap, in the order of their names in ``sides`` of the constraint.

    Warns
    -----
    NonUniqueReactionWarning
        If the contact forces are not unique, as under a box with four feet: single forces are then those of least norm
        among all λ ≥ 0 that give the same motion (with time stepping, one of them); their sum and moment are unique.

    Raises
    ------
    StateError
        If there is no such constraint.
    SimulationError
        If a sample has no solution with a certificate that covers these forces.
    """
    require(trajectory, (Trajectory,), "contact_forces")
    mine = _gaps_of(trajectory, name)
    if trajectory.step is not None:
        return _of_steps(trajectory).of(mine)[0]
    found = kept_with(trajectory, "contact forces", backend, lambda: _of_all(trajectory, backend))
    for k, (solution, which) in found.solutions.items():
        if np.isin(which, mine).any():
            _require_certified(solution, which, mine, name, trajectory.t[k])
    if found.ambiguous[:, mine].any():
        warnings.warn(NOT_UNIQUE.format(repr(name)), NonUniqueReactionWarning, stacklevel=2)
    return found.values[:, mine]


class GapForces(NamedTuple):
    """Forces of all gaps along a motion."""

    values: np.ndarray  # values, ambiguous (k, g): forces, and whether they are not unique
    ambiguous: np.ndarray
    # solution of each sample with closed gaps, and these gaps, by its index
    solutions: dict[int, tuple[Solution, np.ndarray]]


def _of_all(trajectory: Trajectory, backend) -> GapForces:
    """Forces of all gaps at all samples."""
    shape = len(trajectory), len(trajectory.system.contacts.placed)
    found, selector = GapForces(np.zeros(shape), np.zeros(shape, dtype=bool), {}), mode_selector(trajectory.system)
    for k, motion in enumerate(trajectory.motions):
        sample = _of_sample(selector, motion, backend)
        if sample is None:
            continue
        found.solutions[k], (solution, which) = sample, sample
        if solution.status.certified:
            found.values[k, which], found.ambiguous[k, which] = _least_of(solution)
    return found


def _least_of(solution: Solution) -> tuple[np.ndarray, np.ndarray]:
    """Forces of least norm of the closed gaps of a solution, and which of them are not unique."""
    free = Factor(solution.compulsion, np.arange(solution.inequality_multipliers.size)).free_active()
    sizes = np.linalg.norm(free, axis=1)
    return _least(solution.inequality_multipliers, free), sizes > UNDETERMINED_SHARE * sizes.max(initial=0.0)


def _of_sample(selector: ModeSelector, motion: Kinematics, backend) -> tuple[Solution, np.ndarray] | None:
    """Solution of a sample with closed gaps, and these gaps; None if all are open."""
    instant, held = gaps(motion), selector.choose(motion.state, selector.touching(motion.state), backend)
    which = np.array(held.gaps, dtype=int)
    if not which.size:
        return None
    moved = kinematics(held.system, motion.state)
    return solve(with_gaps(assemble_motion(moved, Applied(moved), held.load), instant, which), backend), which


def forces_at(trajectory: Trajectory, index: int, backend: str | Backend | type) -> tuple[np.ndarray, np.ndarray, bool]:
    """Normal forces (g,) and friction forces (g, 3) of all gaps at one sample [N], and whether single ones are not unique.

    SimulationError if the sample has no certified solution.
    """
    system = trajectory.system
    if trajectory.step is not None:
        ((normal, friction),) = _parts(trajectory, [index])
        return normal, friction, False
    normal, ambiguous = np.zeros(len(system.contacts.placed)), False
    sample = _of_sample(mode_selector(system), kinematics(system, trajectory.state(index)), backend)
    if sample is not None:
        solution, which = sample
        if not solution.status.certified:
            raise _uncertified(solution, trajectory.t[index])
        normal[which], loose = _least_of(solution)
        ambiguous = bool(loose.any())
    return normal, np.zeros((normal.size, 3)), ambiguous


def _uncertified(solution: Solution, t: float) -> SimulationError:
    return SimulationError(f"t = {t:.6g} s, backend {solution.backend!r}: {solution.status}.")


def _require_certified(solution: Solution, which: np.ndarray, mine: list[int], name: str, t: float):
    """Raise a SimulationError if the forces of some gaps are not certified."""
    if not solution.status.certified:
        raise _uncertified(solution, t)
    places = len(solution.compulsion.structure.constraints) + np.flatnonzero(np.isin(which, mine))
    refuse_doubtful(solution, places, name, t)


def friction_forces(trajectory: Trajectory, name: str) -> Shaped[np.ndarray, "k m 3"]:
    """Friction forces on the first body of a contact, world axes [N]: means over the step that follows each sample.

    Parameters
    ----------
    trajectory : Trajectory
        A motion by time stepping.
    name : str
        Name of a contact.

    Returns
    -------
    ndarray, shape (k, m, 3)
        One column for each gap, in the order of :func:`contact_forces`.

    Raises
    ------
    StateError
        If there is no such contact, or the motion has no friction of contacts.
    """
    require(trajectory, (Trajectory,), "friction_forces")
    mine = _gaps_of(trajectory, name)
    if trajectory.step is None:
        raise StateError("only integrator='time_stepping' knows friction of contacts; this motion was made by another.")
    return _of_steps(trajectory).of(mine)[1]


def _gaps_of(trajectory: Trajectory, name: str) -> list[int]:
    system = trajectory.system
    contacts = system.scene.contacts
    if name not in contacts:
        raise StateError(f"no unilateral constraint {name!r}. {did_you_mean(name, contacts)}")
    places = {side.name: i for i, side in enumerate(sides(system.scene))}
    return [places[side] for side in contacts[name].sides(system.scene)]


class StepForces(NamedTuple):
    """Forces of the gaps that bear one, over the step that follows each sample; of n gaps in k samples."""

    samples: int  # k
    sample: np.ndarray  # sample, gap (n,): indices of the sample and of the gap
    gap: np.ndarray
    normal: np.ndarray  # (n,) [N]
    friction: np.ndarray  # (n, 3) [N], world axes

    def of(self, mine: list[int]) -> tuple[np.ndarray, np.ndarray]:
        """Normal forces (k, m) and friction forces (k, m, 3) of m gaps."""
        normal, friction = np.zeros((self.samples, len(mine))), np.zeros((self.samples, len(mine), 3))
        for column, gap in enumerate(mine):
            here = self.gap == gap
            normal[self.sample[here], column] = self.normal[here]
            friction[self.sample[here], column] = self.friction[here]
        return normal, friction


def _of_steps(trajectory: Trajectory) -> StepForces:
    """Forces of all gaps over all steps, found once for a motion: each step has the forces of all its contacts."""
    return kept_with(trajectory, "forces of steps", "auto", lambda: _solve_steps(trajectory))


def _solve_steps(trajectory: Trajectory) -> StepForces:
    sample, gap, normals, frictions = [np.zeros(0, dtype=int)], [np.zeros(0, dtype=int)], [np.zeros(0)], [np.zeros((0, 3))]
    for k, (normal, friction) in enumerate(_parts(trajectory, range(len(trajectory)))):
        bearing = np.flatnonzero((normal != 0.0) | (friction != 0.0).any(axis=1))
        sample.append(np.full(bearing.size, k))
        gap.append(bearing)
        normals.append(normal[bearing])
        frictions.append(friction[bearing])
    return StepForces(len(trajectory), *(np.concatenate(part) for part in (sample, gap, normals, frictions)))


def by_pair_kernels(trajectory: Trajectory) -> bool:
    """Whether the steps of a motion are those by kernels of pairs of shapes."""
    plan = trajectory.stats.plan
    return plan is not None and plan.dynamics == "pair kernels" and trajectory.step is not None


def _parts(trajectory: Trajectory, samples: Iterable[int]):
    """Normal forces (g,) and friction forces (g, 3) of all gaps, sample by sample."""
    if by_pair_kernels(trajectory) and trajectory.step is not None:
        with lent_stepper(trajectory.system, removal=trajectory.removal) as stepper:
            stepper.forget()
            for index in samples:
                yield stepper.forces_over(trajectory.state(index), trajectory.step)
        return
    step_at = steps_at(trajectory)
    for index in samples:
        motion = kinematics(trajectory.system, trajectory.state(index))
        yield contact_parts(motion, step_at(index).force)


def _least(forces: np.ndarray, free: np.ndarray) -> np.ndarray:
    """Least forces ≥ 0 among forces + free · z (Lawson, Hanson, Solving Least Squares Problems, 23.4: least distance)."""
    if not free.shape[1]:
        return forces
    from scipy.optimize import nnls  # a slow import

    N = np.linalg.svd(free, full_matrices=False)[0]
    fixed = forces - N @ (N.T @ forces)
    E = np.vstack([N.T, -fixed])
    unit = np.append(np.zeros(N.shape[1]), 1.0)
    residual = E @ nnls(E, unit)[0] - unit
    return np.maximum(fixed - N @ (residual[:-1] / residual[-1]), 0.0)
