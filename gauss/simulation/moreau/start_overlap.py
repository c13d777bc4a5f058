"""Largest penetration with which a motion by time stepping may begin: what such a motion leaves at its samples."""

from gauss.dynamics.contact.overlaps import START_OVERLAP, left_by_steps
from gauss.simulation.problem import Problem


def accepted_overlap(problem: Problem, controlled: bool = False) -> float:
    """Largest penetration at the start of a problem, relative to the scale of a gap.

    Parameters
    ----------
    problem : Problem
        Initial value problem.
    controlled : bool
        Whether the error of the steps is controlled: then they leave penetration within its tolerance.
    """
    system = problem.system
    if controlled or problem.step is None:
        return START_OVERLAP + problem.tolerance.share(system)
    return left_by_steps(system, problem.start.v, problem.step)
