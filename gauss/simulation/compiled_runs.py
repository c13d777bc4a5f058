"""Which run makes the compiled steps that a :class:`gauss.dynamics.rules.Plan` has chosen.

Each is imported where it is asked for: one motion needs one of them.
"""

from typing import TYPE_CHECKING

from gauss.dynamics.conditions import smooth_question
from gauss.dynamics.programs import program_of
from gauss.integrators import FixedStep
from gauss.simulation.problem import Problem

if TYPE_CHECKING:
    from gauss.simulation.compiled_adaptive_run import CompiledAdaptiveRun
    from gauss.simulation.compiled_fixed_run import CompiledFixedRun
    from gauss.simulation.moreau.compiled_run import CompiledMoreauRun


def fixed_run(problem: Problem, dynamics: str) -> "CompiledFixedRun":
    """Fixed steps of a problem in machine code, of time stepping too."""
    assert isinstance(problem.method, FixedStep)
    if problem.method.nonsmooth:
        return moreau_run(problem)
    if problem.laws.called:
        from gauss.simulation.called_runs import CalledFixedRun

        return CalledFixedRun(problem, program_of(dynamics))
    from gauss.simulation.compiled_fixed_run import CompiledFixedRun

    return CompiledFixedRun(problem, program_of(dynamics))


def adaptive_run(problem: Problem, dynamics: str) -> "CompiledAdaptiveRun":
    """Adaptive steps of a problem in machine code."""
    if problem.laws.called:
        from gauss.simulation.called_runs import CalledAdaptiveRun

        return CalledAdaptiveRun(problem, program_of(dynamics))
    from gauss.simulation.compiled_adaptive_run import CompiledAdaptiveRun

    return CompiledAdaptiveRun(problem, program_of(dynamics))


def moreau_run(problem: Problem, removal: float = 0.0) -> "CompiledMoreauRun":
    """Moreau–Jean steps of a problem in machine code; penetration is removed in a time ``removal`` [s], zero: in a step."""
    laws = smooth_question(problem.question).laws
    if laws.called:
        from gauss.simulation.moreau.called_run import CalledMoreauRun

        return CalledMoreauRun(problem, laws, removal)
    from gauss.simulation.moreau.compiled_run import CompiledMoreauRun

    return CompiledMoreauRun(problem, laws, removal=removal)
