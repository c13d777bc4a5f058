"""Which run makes the compiled steps that a :class:`gauss.dynamics.rules.Plan` has chosen, and what goes on where it stops.

Each is imported where it is asked for: one motion needs one of them. Where a check of a compiled loop fails, the fallback
dynamics of the plan continue the motion.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from gauss.codegen.kernels import LoopStatus
from gauss.dynamics.conditions import smooth_question
from gauss.errors import SimulationError
from gauss.integrators import FixedStep, Point
from gauss.simulation.compiled_run import CompiledRun
from gauss.simulation.motion_records import Stats
from gauss.simulation.problem import Problem
from gauss.simulation.step_limits import unsolved
from gauss.simulation.trajectory import Trajectory
from gauss.system import State

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


def finished(run: CompiledRun, fallback: Callable[[State, np.ndarray | None], Trajectory]) -> Trajectory:
    """Trajectory of a run, continued by ``fallback(start, samples)`` where the compiled loop stopped early.

    Raises
    ------
    SimulationError
        If the motion cannot continue; its ``trajectory`` holds the motion so far.
    """
    status, first = LoopStatus(int(run.control.status)), run.trajectory()
    if status == LoopStatus.DONE:
        return first
    if status == LoopStatus.UNSOLVED:
        raise SimulationError(unsolved(run.point[0]), first)
    begin = run.layout.point(run.confirmed)
    samples = None if run.samples is None else run.samples[run.samples > begin.state.t]
    rest: Trajectory | None
    failure: BaseException | None
    try:
        rest, failure = fallback(begin.state, samples), None
    except (SimulationError, KeyboardInterrupt) as error:
        rest, failure = getattr(error, "trajectory", None), error
    whole = first if rest is None else _joined(first, rest, begin, run.samples is None)
    if isinstance(failure, KeyboardInterrupt):
        failure.trajectory = whole  # type: ignore[attr-defined]  # documented: Ctrl-C keeps the motion so far
        raise failure
    if rest is None:
        raise SimulationError(f"t = {begin.state.t:.6g} s: compiled accelerations are not confirmed. {failure}", first)
    if failure is not None:
        raise SimulationError(str(failure), whole) from failure
    return whole


def _joined(first: Trajectory, rest: Trajectory, begin: Point, repeated: bool) -> Trajectory:
    """Concatenation of two trajectories, the second from a point on; it may repeat the last sample of the first."""
    skip = slice(1 if repeated else 0, None)
    t, q, v = (np.concatenate([getattr(first, name), getattr(rest, name)[skip]]) for name in ("t", "q", "v"))
    one, two = first.stats, rest.stats
    method = two.method
    if len(rest):
        method = f"{two.method}, from t = {rest.t[0]:.6g} s on: the compiled recursion is too inaccurate there"
    stats = Stats(
        one.evaluations + two.evaluations,
        one.steps + two.steps,
        one.rejected + two.rejected,
        one.factorisations + two.factorisations,
        one.wall_time + two.wall_time,
        two.worst_error,
        method,
        two.rescued,
        unseen=one.unseen + two.unseen,
        opaque=two.opaque,
        handed_over=float(first.t[-1]) if len(first) else begin.state.t,
    )
    whole_work = np.concatenate([first.work, rest.work[skip] + begin.work])
    return Trajectory(first.system, t, q, v, whole_work, stats, (*first.events, *rest.events))
