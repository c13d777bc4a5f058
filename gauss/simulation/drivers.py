"""Drivers: functions from a problem to its trajectory, selected by the :class:`gauss.dynamics.rules.Plan`."""

from gauss.dynamics.conditions import smooth_question
from gauss.dynamics.consistent_states import project
from gauss.dynamics.engines.call_graph import call_graph_kernels
from gauss.dynamics.engines.certified import CertifiedEngine
from gauss.dynamics.engines.compiled import CompiledEngine
from gauss.dynamics.engines.engine import Engine
from gauss.dynamics.engines.refined import RefinedEngine
from gauss.dynamics.engines.tree_recursion import tree_recursion_kernels
from gauss.dynamics.rules import Plan
from gauss.dynamics.traced_system import Program
from gauss.integrators import FixedStep
from gauss.simulation.compiled_run import CompiledRun, finished
from gauss.simulation.constant_motion import still
from gauss.simulation.library_run import certified_rates, compiled_rates, compiled_settling, library_run
from gauss.simulation.moreau.compiled_run import CompiledSteps
from gauss.simulation.moreau.moreau_jean import SteppedRun
from gauss.simulation.phases.event_driven_run import PhasedRun
from gauss.simulation.problem import Problem
from gauss.simulation.python_run import Run
from gauss.simulation.residual_run import ResidualEquations
from gauss.simulation.trajectory import Trajectory


def drive(problem: Problem, plan: Plan) -> Trajectory:
    """Trajectory of a problem by its plan.

    Raises
    ------
    SimulationError
        If the motion cannot continue; its ``trajectory`` holds the motion so far.
    """
    return DRIVERS[plan.driver](problem, plan)


def engine(dynamics: str, problem: Problem) -> Engine:
    """Engine of a kind of dynamics."""
    system, laws, gains = problem.system, problem.laws, problem.drift.gains
    match dynamics:
        case "call graph":
            return CompiledEngine(system, call_graph_kernels(system, gains), system.loads, (), gains)
        case "tree recursion":
            return CompiledEngine(system, tree_recursion_kernels(system), system.loads, (), gains)
        case "compiled":
            return CompiledEngine(system, _kept(problem, Program.kernels), laws.called, laws.reasons, gains)
        case "refined":
            return RefinedEngine(system, laws)
        case _:
            return CertifiedEngine(problem.backend, gains)


def _constant(problem: Problem, plan: Plan) -> Trajectory:
    return still(problem.system, problem.method, problem.step, problem.start, problem.end, problem.samples)


def _compiled_loop(problem: Problem, plan: Plan) -> Trajectory:
    p = problem
    run = CompiledRun(p.system, p.laws, p.start, p.end, p.samples, p.drift, p.method, p.switching)
    if isinstance(p.method, FixedStep):
        run.fixed(p.method, p.step, p.progress)
    else:
        run.adaptive(p.method, p.tolerance, p.step, p.progress)
    return finished(run, lambda start, samples: _stepped(p._replace(start=start, samples=samples), plan.fallback))


def _python_loop(problem: Problem, plan: Plan) -> Trajectory:
    return _stepped(problem, plan.dynamics)


def _stepped(p: Problem, dynamics: str) -> Trajectory:
    run = Run(p.system, p.method, engine(dynamics, p), p.tolerance, p.step, p.end, p.drift.projects, p.switching)
    return run.collect(p.start, p.samples, p.progress)


def _events(problem: Problem, plan: Plan) -> Trajectory:
    p = problem
    run = PhasedRun(p.system, p.method, p.backend, p.tolerance, p.step, p.end, p.switching)
    return run.collect(p.start, p.samples, p.progress)


def _time_stepping(problem: Problem, plan: Plan) -> Trajectory:
    p = problem
    if plan.dynamics == "compiled":
        laws = smooth_question(problem.question).laws
        return CompiledSteps(p.system, laws, p.start, p.end, p.step, p.samples, p.switching).run(p.progress)
    return SteppedRun(p.system, p.backend, p.step, p.end, p.switching).collect(p.start, p.samples, p.progress)


def _library(problem: Problem, plan: Plan) -> Trajectory:
    p, method = problem, problem.method
    if plan.dynamics == "compiled":
        method = _kept(p, ResidualEquations).by(method) if method.implicit else method
        rates, settle = _kept(p, compiled_rates), _kept(p, compiled_settling)
    else:
        rates = certified_rates(p.system, engine(plan.dynamics, p))
        settle = lambda state: project(p.system, state) if p.drift.projects else state  # noqa: E731
    return library_run(method, p.system, rates, settle, p.start, p.end, p.samples, p.tolerance, p.step, p.switching)


DRIVERS = {
    "constant": _constant,
    "time stepping": _time_stepping,
    "events": _events,
    "library": _library,
    "compiled loop": _compiled_loop,
    "Python loop": _python_loop,
}


def _kept(problem: Problem, make):
    """Machine code of a problem's program, cached with the system."""
    system, laws, drift = problem.system, problem.laws, problem.drift
    return system.dynamics.on_demand((make, drift, laws.key), lambda: make(Program(system, laws, drift)))
