"""Engine of a servo-controlled motion: compiled where the system can be traced, checked at every accepted step."""

from typing import NamedTuple

import numpy as np

from gauss.dynamics.engines.engine import DistrustError, Engine
from gauss.dynamics.rules import Rule, RuleTable
from gauss.integrators import Point, Rates
from gauss.servo.allocate import allocate, require_tension
from gauss.servo.instant import ServoInstant, number
from gauss.servo.kernels import untraced
from gauss.servo.plan import RelationPlan
from gauss.servo.project import projected
from gauss.servo.realisable import instant
from gauss.servo.servo import Servo
from gauss.servo.solve import saddle
from gauss.servo.verdict import RANK_COSINE, UnrealisableError, Verdict, rank_lost, row_lost
from gauss.system import State, System

CANCELLATION = 1e-3  # of the terms that cancel: least scale of accelerations
AVOID = "Choose a motion that avoids this configuration, or add an actuator."
SADDLE_AGREEMENT = 1e-9  # relative difference of compiled accelerations and the saddle system, times the conditioning


class ServoQuestion(NamedTuple):
    """Question for the plan of a servo-controlled motion."""

    servo: Servo  # the servo
    stabilisation: str = "projection"  # states are projected onto contacts and relations


SERVOS = RuleTable(
    (
        Rule("Python loop", "compiled", "certified", conditions=(lambda ask: untraced(ask.servo),)),
        Rule("Python loop", "certified"),
    ),
    lambda ask, why: why,
)


class ServoEngine(Engine):
    """Engine of one servo-controlled motion, by the rows that hold its relations; ``route`` is the plan of the motion."""

    evaluations, rescued = 0, 0

    def __init__(self, servo: Servo, plan: RelationPlan):
        self.servo, self.plan = servo, plan
        self.worst = 0.0
        self.route = SERVOS.plan(ServoQuestion(servo))
        self.certified = self.route.dynamics == "certified"
        self.sign: float | None = None

    @property
    def name(self) -> str:
        """Method of solution."""
        how = "certified saddle system at every evaluation" if self.certified else "compiled, each step checked"
        return f"{how}; relations differentiated {self.plan.degree} times"

    def instant(self, state: State) -> ServoInstant:
        """Rows that determine the efforts, and responses.

        UnrealisableError if S loses rank, or did so since the start: the sign of its determinant changes.
        SlackError if a cable would be in compression.
        """
        if self.certified:
            here = saddle(self.servo, state, self.plan).instant
        else:
            here = instant(self.servo, state, self.plan).part(list(self.plan.active))
        if not here.b.size:
            return here
        sigma = np.linalg.svd(here.cosines, compute_uv=False)
        sign = np.sign(np.linalg.det(here.cosines)) if len(here.b) == len(self.servo.efforts) else 1.0
        self.sign = sign if self.sign is None else self.sign
        if not sigma[-1] > RANK_COSINE or sign != self.sign:
            require_tension(here, self.servo, number(state.t))
            verdict = self.lost(here)
            how = f"the smallest singular value falls to {sigma[-1]:.1e}"
            if sign != self.sign:
                how = "the determinant of S changes its sign, and rank is lost where it passes zero"
            held = ", ".join(map(repr, verdict.relations))
            raise UnrealisableError(
                f"t = {state.t:.9g} s: the efforts lose their hold on {held}: {how}; {verdict.reason}. {AVOID}", verdict
            )
        return here

    def lost(self, here: ServoInstant) -> Verdict:
        """Verdict of an instant at or next to which the rank of S is deficient by one."""
        return rank_lost(here, self._active, self.servo.efforts)

    def without_motion(self, here: ServoInstant, rows: np.ndarray) -> Verdict:
        """Verdict of an instant at or next to which some rows of the relations vanish."""
        return row_lost(here, rows, self._active, self.servo.efforts)

    @property
    def _active(self) -> tuple[str, ...]:
        """Names of the relations that servos hold."""
        return tuple(self.plan.scalars[self.servo.n_contacts + i].name for i in self.plan.active)

    def efforts(self, here: ServoInstant, t: float) -> np.ndarray:
        """Efforts (j,) that hold the relations at a time [s]."""
        return allocate(here, self.servo, t)

    def rates(self, system: System, state: State, load=None) -> Rates:
        """Accelerations; power of drives and servos, of forces on bodies, lost in dampers, then of each effort."""
        self.evaluations += 1
        here = self.instant(state)
        u = self.efforts(here, number(state.t))
        x = here.free + here.X_W @ u
        power = u * here.speeds
        total = here.power + [power.sum(), 0.0, 0.0]
        return Rates(x[-system.n_v :], np.concatenate([total, power]))

    @property
    def error(self) -> float:
        """Largest estimated relative error of accelerations at accepted steps."""
        return self.worst

    def project(self, system: System, state: State) -> State:
        """State projected onto contacts and relations."""
        return projected(self.servo, self.plan, state)

    def check(self, point: Point, last: bool = False):
        """Compare with the saddle system in maximal coordinates, an independent formulation.

        DistrustError if the two differ by more than the conditioning explains; then the saddle system is used.
        """
        found = saddle(self.servo, point.state, self.plan)
        exact = found.solve("saddle")
        here = found.instant
        terms = np.abs(here.free) + np.abs(here.X_W) @ np.abs(exact.efforts)  # of the accelerations
        largest = np.maximum(np.abs(exact.qdd), CANCELLATION * terms[-exact.qdd.size :]).max(initial=0.0)
        error = np.abs(exact.qdd - point.rates.acceleration).max(initial=0.0)
        sigma = np.linalg.svd(here.cosines, compute_uv=False).min(initial=1.0)
        if not self.certified and not error <= SADDLE_AGREEMENT * largest / sigma:
            self.certified, self.handed_over = True, number(point.state.t)
            raise DistrustError(f"t = {point.state.t:.6g} s: compiled accelerations are off by {error:.1e}.")
        self.worst = max(self.worst, exact.error, float(error / max(largest, np.finfo(float).tiny)))
