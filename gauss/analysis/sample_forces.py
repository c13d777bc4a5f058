"""Multipliers of all constraints at all samples of a motion, in one pass: machine code of many samples, certified where not.

Kept with the motion, so that forces of further joints cost nothing. Near singular configurations multipliers lose digits
although accelerations are certified.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from gauss.backends import solve
from gauss.backends.solution import Solution
from gauss.codegen import Scalar
from gauss.dynamics.assemble import assemble
from gauss.dynamics.contact.mode_selection import active_mode
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.sample_multipliers import sample_multipliers
from gauss.errors import SimulationError
from gauss.simulation import Trajectory
from gauss.simulation.moreau.moreau_jean import steps_at, with_forces

MANY_SAMPLES = 1000  # above, machine code is made: certified solutions take about as long for so many
UNKNOWN = "machine code"  # in place of the name of a backend
T = TypeVar("T")


@dataclass
class SampleForces:
    """Multipliers of all constraints of a system along a motion."""

    values: np.ndarray  # (k, r) multipliers
    loose: np.ndarray  # (k, r) whether they are not unique
    errors: np.ndarray  # (k, c) estimated relative errors by constraint
    tolerances: np.ndarray  # (k,) largest errors that certificates accept
    backends: list[str]  # solver of each sample

    def of(self, trajectory: Trajectory, name: str):
        """Constraint of this name, its multipliers (k, m), and which of them are not unique (m,).

        SimulationError if those of some sample are not certified.
        """
        constraints = trajectory.system.structure.constraints
        place = next(i for i, constraint in enumerate(constraints) if constraint.name == name)
        for k in np.flatnonzero(self.errors[:, place] > self.tolerances):
            refuse_uncertain(self.errors[k, place], self.tolerances[k], self.backends[k], name, trajectory.t[k])
        rows = constraints[place].rows
        return constraints[place], self.values[:, rows], self.loose[:, rows].any(axis=0)


def sample_forces(trajectory: Trajectory, backend) -> SampleForces:
    """Multipliers of all constraints at every sample, found once for each backend that is given by its name.

    SimulationError if a sample has no certified solution.
    """
    return kept_with(trajectory, "multipliers", backend, lambda: _found(trajectory, backend))


def kept_with(trajectory: Trajectory, what: str, backend, find: Callable[[], T]) -> T:
    """Result of a function for all samples, kept with the motion for a backend that is given by its name.

    Laws of loads are compared: with another traced law it is found anew, with an opaque one, which may change, always.
    """
    laws = Laws(trajectory.system)
    if laws.called or not isinstance(backend, str):
        return find()
    kept = trajectory.__dict__.setdefault("_kept", {})
    trajectory.hold_samples()
    if (what, backend, laws.key) not in kept:
        kept[what, backend, laws.key] = find()
    return kept[what, backend, laws.key]


def _found(trajectory: Trajectory, backend) -> SampleForces:
    k, structure = len(trajectory), trajectory.system.structure
    size, count = structure.n_rows, len(structure.constraints)
    found = SampleForces(
        np.zeros((k, size)), np.zeros((k, size), dtype=bool), np.zeros((k, count)), np.full(k, np.inf), [UNKNOWN] * k
    )
    by_code = None
    if backend == "auto" and k >= MANY_SAMPLES and trajectory.step is None:
        by_code = sample_multipliers(trajectory.system, trajectory.t, trajectory.q, trajectory.v)
    if by_code is not None:
        found.values[:] = by_code[0]
    for index in range(k) if by_code is None else np.flatnonzero(~by_code[1]):
        _solve_sample(found, trajectory, int(index), backend)
    return found


def _solve_sample(found: SampleForces, trajectory: Trajectory, index: int, backend):
    """Certified multipliers of one sample."""
    constraints, solution = trajectory.system.structure.constraints, solution_at(trajectory, index, backend)
    places = {constraint.rows.start: i for i, constraint in enumerate(solution.compulsion.structure.constraints)}
    size, loose = found.values.shape[1], solution.certificate.undetermined
    found.values[index] = solution.multipliers[:size]
    found.loose[index] = loose[:size] if loose.size else False
    found.errors[index] = solution.certificate.dual.errors[[places[constraint.rows.start] for constraint in constraints]]
    found.tolerances[index], found.backends[index] = solution.status.tolerance, solution.backend


def solution_at(trajectory: Trajectory, index: int, backend="auto") -> Solution:
    """Solution at a sample; with time stepping, over the next step.

    Rows of joints, couplings and relations come first, as in the structure of the system; sticking elements follow.

    SimulationError if it is not certified.
    """
    system, state = trajectory.system, trajectory.state(index)
    if trajectory.step is not None:
        return with_forces(trajectory.motions[index], steps_at(trajectory)(index).force, backend)
    if system.set_valued.placed or system.losses:
        return active_mode(system, state, backend=backend).solution
    solution = solve(assemble(system, state), backend)
    if not solution.status.certified:
        raise SimulationError(f"t = {state.t:.6g} s, backend {solution.backend!r}: {solution.status}.")
    return solution


def refuse_doubtful(solution: Solution, places, name: str, t: Scalar):
    """Raise a SimulationError if some multipliers of a solution are not certified.

    Parameters
    ----------
    solution : Solution
        Solution of a sample.
    places : int or array of int
        Indices of constraints, then of inequality rows.
    name : str
        Name of the joint or constraint.
    t : float
        Time of the sample [s].
    """
    error = float(np.max(solution.certificate.dual.errors[places], initial=0.0))
    if error > solution.status.tolerance:
        refuse_uncertain(error, solution.status.tolerance, solution.backend, name, t)


def refuse_uncertain(error: float, tolerance: float, backend: str, name: str, t: Scalar):
    """Raise the SimulationError of forces with an estimated relative error above the tolerance."""
    raise SimulationError(
        f"t = {t:.6g} s, backend {backend!r}: the forces of {name!r} are not certified, though accelerations are: "
        f"estimated relative error {error:.1e}, expected at most {tolerance:.0e}. Near a singular "
        "configuration forces lose digits; take samples farther from it (times= of simulate)."
    )
