"""Moreau–Jean time stepping in machine code that calls opaque laws, one evaluation a step."""

from gauss.dynamics.laws.traced_laws import Laws
from gauss.simulation.called_runs import CalledFixedRun
from gauss.simulation.moreau.compiled_run import CompiledMoreauRun
from gauss.simulation.problem import Problem


class CalledMoreauRun(CalledFixedRun, CompiledMoreauRun):
    """One motion by Moreau–Jean time stepping in machine code that calls opaque laws.

    Parameters
    ----------
    problem : Problem
        As of :class:`gauss.simulation.moreau.compiled_run.CompiledMoreauRun`.
    laws : Laws
        Loads of the system without unilateral and set-valued elements.
    removal : float
        As of the same.
    """

    def __init__(self, problem: Problem, laws: Laws, removal: float = 0.0):
        CompiledMoreauRun.__init__(self, problem, laws, "callbacks", removal)
        self._receive()
