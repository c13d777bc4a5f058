"""Drivers: functions from a problem to its trajectory, selected by the :class:`gauss.dynamics.rules.Plan`.

Each imports what it runs: one motion needs one of them.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, TypeVar

from gauss.dynamics import engines
from gauss.dynamics.conditions import smooth_question
from gauss.dynamics.consistent_states import project
from gauss.dynamics.load_forces import LoadForces
from gauss.dynamics.plan import plan_of
from gauss.dynamics.rules import Plan
from gauss.dynamics.store import cached_on_disk
from gauss.dynamics.traced_system import Program
from gauss.errors import SimulationError
from gauss.integrators import FixedStep, Library
from gauss.simulation.compiled_run import CompiledRun
from gauss.simulation.problem import Problem
from gauss.simulation.trajectory import Trajectory

if TYPE_CHECKING:
    from gauss.simulation.compiled_adaptive_run import CompiledAdaptiveRun
    from gauss.simulation.compiled_fixed_run import CompiledFixedRun
    from gauss.simulation.moreau.compiled_run import CompiledMoreauRun

T = TypeVar("T")


def engine(dynamics: str, problem: Problem) -> "engines.Engine":
    """Engine of a kind of dynamics."""
    system, laws, gains = problem.system, problem.laws, problem.drift.gains
    beside = lambda: LoadForces(system, laws.called, laws)  # noqa: E731
    match dynamics:
        case "call graph":
            return engines.CompiledEngine(system, engines.call_graph_kernels(system, gains), beside(), laws.reasons, gains)
        case "tree recursion":
            return engines.CompiledEngine(system, engines.tree_recursion_kernels(system), beside(), laws.reasons, gains)
        case "compiled":
            loads = LoadForces(system, laws.called)
            return engines.CompiledEngine(system, _cached(problem, Program.kernels), loads, laws.reasons, gains)
        case "refined":
            return engines.RefinedEngine(system, laws)
        case _:
            return engines.CertifiedEngine(problem.backend, gains)


def fixed_run(problem: Problem, dynamics: str) -> "CompiledFixedRun":
    """Fixed steps of a problem in machine code, of time stepping too."""
    assert isinstance(problem.method, FixedStep)
    if problem.method.nonsmooth:
        return moreau_run(problem)
    if problem.laws.called:
        from gauss.simulation.called_runs import CalledFixedRun

        return CalledFixedRun(problem, dynamics)
    from gauss.simulation.compiled_fixed_run import CompiledFixedRun

    return CompiledFixedRun(problem, dynamics)


def adaptive_run(problem: Problem, dynamics: str) -> "CompiledAdaptiveRun":
    """Adaptive steps of a problem in machine code."""
    if problem.laws.called:
        from gauss.simulation.called_runs import CalledAdaptiveRun

        return CalledAdaptiveRun(problem, dynamics)
    from gauss.simulation.compiled_adaptive_run import CompiledAdaptiveRun

    return CompiledAdaptiveRun(problem, dynamics)


def moreau_run(problem: Problem, removal: float = 0.0) -> "CompiledMoreauRun":
    """Moreau–Jean steps of a problem in machine code; penetration is removed in a time ``removal`` [s], zero: in a step."""
    laws = smooth_question(problem.question).laws
    if laws.called:
        from gauss.simulation.moreau.called_run import CalledMoreauRun

        return CalledMoreauRun(problem, laws, removal)
    from gauss.simulation.moreau.compiled_run import CompiledMoreauRun

    return CompiledMoreauRun(problem, laws, removal=removal)


def _constant(problem: Problem, plan: Plan) -> Trajectory:
    from gauss.simulation.constant_motion import constant

    return constant(problem)


def _compiled_loop(problem: Problem, plan: Plan) -> Trajectory:
    made = fixed_run if isinstance(problem.method, FixedStep) else adaptive_run
    run: CompiledRun = made(problem, plan.dynamics)
    run.run()
    return run.finished(lambda start, samples: _fallback(problem._replace(start=start, samples=samples), plan))


def _samples(problem: Problem, plan: Plan) -> Trajectory:
    from gauss.simulation.held_motion import held_motion

    chosen: list[Plan] = []

    def drive(alone: Problem) -> Trajectory:
        chosen[:] = chosen or [plan_of(alone.question)]
        return DRIVERS[chosen[0].driver](alone, chosen[0])

    return held_motion(problem, drive)


def _fallback(problem: Problem, plan: Plan) -> Trajectory:
    """Motion by the fallback dynamics, which give accelerations only if they are not compiled."""
    if plan.fallback == "compiled":
        return _compiled_loop(problem, plan_of(problem.question, replace(plan, dynamics=plan.fallback)))
    if problem.method.mechanical:
        raise SimulationError(
            f"Integrator {problem.method.name!r} needs the equations of motion in machine code; use 'dop853' here."
        )
    if problem.held is not None:
        from gauss.simulation.held_motion import held_motion

        return held_motion(problem, lambda alone: _stepped(alone, plan.fallback))
    return _stepped(problem, plan.fallback)


def _python_loop(problem: Problem, plan: Plan) -> Trajectory:
    return _stepped(problem, plan.dynamics)


def _stepped(p: Problem, dynamics: str) -> Trajectory:
    from gauss.simulation.python_run import PythonRun

    run = PythonRun(p.system, p.method, engine(dynamics, p), p.tolerance, p.step, p.end, p.drift.projects, p.switching)
    return run.collect(p.start, p.samples, p.progress)


def _events(problem: Problem, plan: Plan) -> Trajectory:
    from gauss.simulation.phases.event_driven_run import EventDrivenRun

    return EventDrivenRun(problem).collect(problem.start, problem.samples, problem.progress)


def _time_stepping(problem: Problem, plan: Plan) -> Trajectory:
    if problem.step is None:
        from gauss.simulation.moreau.error_control import controlled_motion

        return controlled_motion(problem, plan)
    if plan.dynamics in ("compiled", "callbacks"):
        return moreau_run(problem).collect()
    if plan.dynamics == "pair kernels":
        from gauss.simulation.moreau.pair_kernel_run import PairKernelRun

        return PairKernelRun(problem).collect(problem.start, problem.samples, problem.progress)
    from gauss.simulation.moreau.moreau_jean import MoreauRun

    run = MoreauRun(problem.system, problem.backend, problem.step, problem.end, problem.switching)
    return run.collect(problem.start, problem.samples, problem.progress)


def _library(problem: Problem, plan: Plan) -> Trajectory:
    from gauss.dynamics.engines.compiled import projected
    from gauss.dynamics.gear_trains import on_trains
    from gauss.simulation.library_run import certified_rates, compiled_rates, library_run, projection_kernel, rates_kernel
    from gauss.simulation.residual_run import ResidualEquations

    p, method = problem, problem.method
    if plan.dynamics == "compiled":
        if isinstance(method, Library) and method.implicit:
            method = _cached(p, ResidualEquations).by(method)
        rates, kernel = compiled_rates(p.system, _cached(p, rates_kernel)), None
        if p.drift.projects and p.system.closes:
            kernel = _cached(p, projection_kernel)
        follow = lambda state: on_trains(p.system, state) if p.drift.projects else state  # noqa: E731
        project_state = lambda state: follow(state) if kernel is None else projected(p.system, kernel, state)  # noqa: E731
    else:
        rates = certified_rates(p.system, engine(plan.dynamics, p))
        project_state = lambda state: project(p.system, state) if p.drift.projects else state  # noqa: E731
    return library_run(p._replace(method=method), rates, project_state)


DRIVERS: dict[str, Callable[[Problem, Plan], Trajectory]] = {
    "constant": _constant,
    "time stepping": _time_stepping,
    "events": _events,
    "library": _library,
    "compiled loop": _compiled_loop,
    "Python loop": _python_loop,
    "samples": _samples,
}


def _cached(problem: Problem, make: Callable[[Program], T]) -> T:
    """Machine code of a problem's program, cached with the system."""
    system, laws, drift = problem.system, problem.laws, problem.drift
    return cached_on_disk(system, (make, drift, laws.key), lambda: make(Program(system, laws, drift)))
