"""Simulation under servos: consistent start, projection through the actuators after each step, loss of rank as an event."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from gauss.arguments import named_arguments
from gauss.codegen import one_tier
from gauss.dynamics.laws.constraint_modes import refuse_surfaces
from gauss.dynamics.laws.switching import Switching
from gauss.errors import SimulationError, require
from gauss.integrators import FixedStep, Integrator, Library, Point, Taylor, Tolerance
from gauss.interruption import interruption_keeps
from gauss.servo.dynamics import AVOID, ServoEngine
from gauss.servo.instant import number
from gauss.servo.plan import RelationPlan
from gauss.servo.project import CONSISTENT_START, initial_state, residuals, worst
from gauss.servo.realisable import planned, realisable
from gauss.servo.servo import Servo
from gauss.servo.switching import servo_switching
from gauss.servo.tracking import Tracking
from gauss.servo.verdict import UnrealisableError, Verdict
from gauss.simulation import Trajectory
from gauss.simulation.arguments import check_arguments, check_breaks, chosen, refuse_without_step, sample_times
from gauss.simulation.energy_balance import watch_balance
from gauss.simulation.python_run import PythonRun
from gauss.simulation.tolerances import shares_of_scale, tolerance
from gauss.simulation.undetected_switching import warn_of_switching
from gauss.system import State

LOST_RANK = 1e-3  # of the smallest singular value, or a row, at the start: below it a motion that breaks off has lost rank
DEFAULT_ATOL = 1e-10  # of the scale of the scene
JUMP = 1e3  # errors allowed: a residual beyond this is a discontinuity of the relation, not drift


@named_arguments
@interruption_keeps("trajectory")
@one_tier()
def simulate(
    servo: Servo,
    duration: float,
    *,
    integrator: str = "dop853",
    step: float | None = None,
    rtol: float = 1e-8,
    atol: float | tuple[float, float] | dict | None = None,
    state: State | None = None,
    times=None,
    breaks=(),
    progress: bool = True,
) -> Tracking:
    """Simulate a motion whose relations are held by servos.

    Parameters
    ----------
    servo : Servo
        The servo.
    duration : float
        Duration [s].
    integrator, step, rtol, times, breaks, progress
        As in :func:`gauss.simulate`.
    atol : float, pair or mapping, optional
        The same; 1e-10 of the scale of the scene when not given.
    state : State, optional
        Start; the scene's own when not given. It is made consistent by :func:`gauss.servo.initial_state`.

    Returns
    -------
    Tracking
        Motion, efforts and work of each effort.

    Warns
    -----
    SwitchingWarning, BalanceWarning
        As :func:`gauss.simulate`.

    Raises
    ------
    UnrealisableError
        If the relations cannot be held at the start or from some instant on, as where a reference position or speed jumps,
        which adaptive steps locate to rounding; its ``trajectory`` is the Tracking so far.
    SimulationError
        If the motion cannot go on for another reason.
    KeyboardInterrupt
        On Ctrl-C; its ``trajectory`` is the Tracking so far, None before the first step.
    """
    require(servo, (Servo,), "servo.simulate")
    if state is not None:
        require(state, (State,), "servo.simulate: state")
    refuse_without_step(check_arguments(duration, integrator, step, rtol, atol), step, "a motion under servos")
    refuse_surfaces(servo.system, "a motion under servos")
    method = chosen(integrator)
    if isinstance(method, Library | Taylor) or (isinstance(method, FixedStep) and method.mechanical):
        raise SimulationError(f"integrator {method.name!r} does not support servos; use 'dop853', 'radau5' or 'rk4'.")
    start = initial_state(servo, state)
    plan, verdict = planned(servo, start), realisable(servo, start)
    samples = sample_times(times, number(start.t), duration)
    dynamics, end = ServoEngine(servo, plan), start.t + duration
    allowed = tolerance(servo.system, rtol, shares_of_scale(servo.system, DEFAULT_ATOL) if atol is None else atol)
    switching = servo_switching(servo, plan, start, end, check_breaks(breaks, number(start.t), duration))
    run = ServoRun(dynamics, method, allowed, step, end, switching)
    try:
        found = run.collect(start, samples, progress)
        warn_of_switching(found, method)
        watch_balance(found, start)
        return _tracking(dynamics, found, verdict)
    except KeyboardInterrupt as error:
        reached = getattr(error, "trajectory", None)
        tracked = None if reached is None else _tracking(dynamics, reached, verdict)
        error.trajectory = tracked  # type: ignore[attr-defined]  # kept on the interruption for the caller
        raise
    except SimulationError as error:
        reached = _tracking(dynamics, error.trajectory, verdict)
        if isinstance(error.__cause__, UnrealisableError):
            raise UnrealisableError(str(error), error.__cause__.verdict, reached) from error
        lost = run.rank_loss()
        if lost is not None:
            raise UnrealisableError(*lost, reached) from error
        raise SimulationError(str(error), reached) from error


class ServoRun(PythonRun):
    """Run whose states are projected onto contacts and relations."""

    def __init__(
        self, dynamics: ServoEngine, method: Integrator, tolerance: Tolerance, step, end: float, switching: Switching
    ):
        super().__init__(dynamics.servo.system, method, dynamics, tolerance, step, end, switching=switching)
        self.servo_engine = dynamics
        self.powers = 3 + len(dynamics.servo.efforts)
        self.points: list[Point] = []

    def steps_of(self, point: Point, samples) -> Iterator:
        """Points reached; the first and the last are kept."""
        self.points = [point, point]
        for reached in super().steps_of(point, samples):
            self.points[1] = reached[0]
            yield reached

    def rank_loss(self) -> tuple[str, Verdict] | None:
        """Message and verdict of a motion that broke off near a loss of rank of S; None elsewhere."""
        if not self.points:
            return None
        dynamics, last = self.servo_engine, self.points[1]
        here, first = dynamics.instant(last.state), dynamics.instant(self.points[0].state)
        now, before = (np.linalg.svd(one.cosines, compute_uv=False).min(initial=1.0) for one in (here, first))
        lost = np.flatnonzero(here.lengths < LOST_RANK * first.lengths)
        is_faster = self.system.scale.fastest(last.state.v) > self.system.scale.fastest(self.points[0].state.v) / LOST_RANK
        if lost.size and is_faster:
            verdict = dynamics.without_motion(here, lost)
            share = (here.lengths[lost] / first.lengths[lost]).min()
            return (
                f"t = {last.state.t:.9g} s: {verdict.reason}; the row falls to {share:.1e} of that at the start, and rates "
                f"grow to {np.abs(last.state.v).max():.1e}. {AVOID}",
                verdict,
            )
        if not now < LOST_RANK * before:
            return None
        verdict = dynamics.lost(here)
        held = ", ".join(map(repr, verdict.relations))
        return (
            f"t = {last.state.t:.9g} s: the efforts lose their hold on {held}: rank {verdict.rank} of "
            f"{len(verdict.relations)} is left, {verdict.reason}; the smallest singular value falls from {before:.2g} to "
            f"{now:.1e}, and rates grow to {np.abs(last.state.v).max():.1e}. {AVOID}",
            verdict,
        )

    def crossed_to(self, point: Point, t: float) -> Point:
        """Point across a switching time; relations that jump there are refused."""
        self._refuse_jump(replace(point.state, t=t), CONSISTENT_START)
        return super().crossed_to(point, t)

    def _advance(self, method: FixedStep, point: Point, t: float) -> Point:
        """One fixed step; none across a switching time."""
        return self.crossed_to(point, t) if t in self._after else super()._advance(method, point, t)

    def fixed(self, method: FixedStep, point: Point, samples):
        """Points reached by steps of fixed length, with off-grid steps to samples and switching times."""
        stops = self.switching.times.stops(number(point.state.t), self.end)
        self._after = {after for before, after in stops if before < after}
        yield from super().fixed(method, point, samples)

    def _projected(self, point: Point, t: float | None) -> Point:
        """Point projected onto contacts and relations; residuals far beyond the error of a step are jumps.

        UnrealisableError if a relation jumps.
        """
        if not isinstance(self.method, FixedStep):
            self._refuse_jump(point.state, JUMP * self._allowed(point.state))
        return super()._projected(point, t)

    def _allowed(self, state: State) -> float:
        """Largest error of a step, in units of the scene; of rates relative to the rates."""
        scale = self.system.scale
        assert self.tolerance is not None
        places, rates = np.split(self.tolerance.scale(self.system, state), 2)
        return float(max((places / scale.coordinates).max(), (rates / scale.coordinates).max() / scale.fastest(state.v)))

    def _refuse_jump(self, state: State, allowed: float):
        """Raise an UnrealisableError if a relative residual exceeds what is allowed."""
        name, share, size = worst(self.servo_engine.servo, self.servo_engine.plan, state)
        if share > allowed:
            raise UnrealisableError(
                f"t = {state.t:.9g} s: relation {name!r} jumps by {size:.3g} in position or speed, which no effort can "
                "follow: masses keep their speeds. Let the reference be continuous with as many derivatives as it takes "
                "(gauss.math.where between pieces that meet, a profile, gauss.math.tanh)."
            )


def _tracking(dynamics: ServoEngine, found: Trajectory, verdict: Verdict) -> Tracking:
    servo, plan = dynamics.servo, dynamics.plan
    motion = Trajectory(
        found.system, found.t, found.q, found.v, found.work[:, :3], found.stats._replace(plan=dynamics.route)
    )
    states = [motion.state(i) for i in range(len(motion))]
    instants = [dynamics.instant(state) for state in states]
    efforts = [dynamics.efforts(here, number(state.t)) for here, state in zip(instants, states, strict=True)]
    return Tracking(
        servo,
        motion,
        np.array(efforts).reshape(len(states), len(servo.efforts)),
        found.work[:, 3:],
        np.array([_residuals(servo, plan, state) for state in states]).reshape(len(states), len(servo.held)),
        np.array([np.linalg.svd(here.cosines, compute_uv=False).min(initial=1.0) for here in instants]),
        verdict,
    )


def _residuals(servo: Servo, plan: RelationPlan, state: State) -> np.ndarray:
    """Residual (r,) of each relation of the servos, at its own level; zero at acceleration level."""
    here = slice(servo.n_contacts, servo.n_contacts + len(servo.held))
    position, velocity = residuals(servo, plan, state)
    return np.where([s.level == "position" for s in servo.scalars[here]], position[here], velocity[here])
