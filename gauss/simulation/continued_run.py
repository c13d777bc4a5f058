"""A motion whose compiled loop has stopped early: its fallback dynamics continue it from the last confirmed point."""

from collections.abc import Callable

import numpy as np

from gauss.codegen.kernels import LoopStatus
from gauss.errors import SimulationError
from gauss.integrators import Point
from gauss.simulation.compiled_run import CompiledRun
from gauss.simulation.motion_records import joined_stats
from gauss.simulation.step_limits import unsolved
from gauss.simulation.trajectory import Trajectory
from gauss.system import State


def continued(run: CompiledRun, fallback: Callable[[State, np.ndarray | None], Trajectory]) -> Trajectory:
    """Trajectory of a run, continued by ``fallback(start, samples)``.

    SimulationError if the motion cannot continue; its ``trajectory`` holds the motion so far.
    """
    first = run.trajectory()
    if run.control.status == LoopStatus.UNSOLVED:
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
    last = rest.stats
    method = last.method
    if len(rest):
        method = f"{last.method}, from t = {rest.t[0]:.6g} s on: the compiled recursion is too inaccurate there"
    stats = joined_stats([first.stats, last])._replace(
        worst_error=last.worst_error,  # that of the first part has been found out
        method=method,
        handed_over=float(first.t[-1]) if len(first) else begin.state.t,
    )
    whole_work = np.concatenate([first.work, rest.work[skip] + begin.work])
    return Trajectory(first.system, t, q, v, whole_work, stats, (*first.events, *rest.events))
