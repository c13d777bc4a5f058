"""Solution of the compulsion at one sample of a motion, and the certificate of its forces.

Near singular configurations multipliers lose digits although accelerations are certified.
"""

import numpy as np

from gauss.backends import solve
from gauss.backends.solution import Solution
from gauss.codegen import Scalar
from gauss.dynamics.assemble import assemble
from gauss.dynamics.contact.mode_selection import active_mode
from gauss.errors import SimulationError
from gauss.simulation.moreau.moreau_jean import steps_at, with_forces
from gauss.simulation.trajectory import Trajectory


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
