"""Accelerations of a servo-controlled motion: compiled where that is possible, confirmed at every accepted step."""

from typing import NamedTuple

import numpy as np

from gauss.dynamics.engines.engine import DistrustError, Engine
from gauss.dynamics.rules import Rule, RuleTable
from gauss.integrators import Point, Rates
from gauss.servo.allocate import allocate, require_tension
from gauss.servo.instant import Instant
from gauss.servo.kernels import untraced
from gauss.servo.plan import Plan
from gauss.servo.project import settle
from gauss.servo.realisable import instant
from gauss.servo.servo import Servo
from gauss.servo.solve import saddle
from gauss.servo.verdict import RANK, UnrealisableError, Verdict, rank_lost
from gauss.system import State, System

FLOOR = 1e-3  # of the terms that cancel: accelerations smaller than that are compared with it
AVOID = "Choose a motion that avoids this configuration, or add an actuator."
AGREEMENT = 1e-9  # of compiled accelerations with the saddle system, relative to the largest, times the conditioning


class ServoQuestion(NamedTuple):
    """A servo-controlled motion that is to be made.

    Attributes
    ----------
    servo : Servo
        The servo.
    stabilisation : str
        States are projected onto contacts and relations.
    """

    servo: Servo
    stabilisation: str = "projection"


SERVOS = RuleTable(
    (
        Rule("Python loop", "compiled", "certified", conditions=(lambda ask: untraced(ask.servo),)),
        Rule("Python loop", "certified"),
    ),
    lambda ask, why: why,
)


class Dynamics(Engine):
    """Evaluator of one servo-controlled motion.

    Parameters
    ----------
    servo : Servo
        The servo.
    plan : Plan
        How its relations are held.

    Attributes
    ----------
    route : gauss.Plan
        How the motion is made.
    evaluations : int
        How often accelerations were asked for.
    """

    def __init__(self, servo: Servo, plan: Plan):
        self.servo, self.plan = servo, plan
        self.worst = 0.0
        self.route = SERVOS.plan(ServoQuestion(servo))
        self.certified = self.route.dynamics == "certified"
        self.sign: float | None = None

    @property
    def name(self) -> str:
        """What was used, in words."""
        how = "certified saddle system at every evaluation" if self.certified else "compiled, each step confirmed"
        return f"{how}; relations differentiated {self.plan.degree} times"

    def instant(self, state: State) -> Instant:
        """Rows that fix the efforts, and responses.

        Raises
        ------
        UnrealisableError
            If the efforts lose their hold on the relations, or did so on the way here.
        SlackError
            If a cable would have to push.
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
        if not sigma[-1] > RANK or sign != self.sign:
            require_tension(here, self.servo, state.t)
            verdict = self.lost(here)
            how = f"the smallest singular value falls to {sigma[-1]:.1e}"
            if sign != self.sign:
                how = "what they do to the relations changes its sense, and rank is lost where it passes zero"
            held = ", ".join(map(repr, verdict.relations))
            raise UnrealisableError(
                f"t = {state.t:.9g} s: the efforts lose their hold on {held}: {how}; {verdict.reason}. {AVOID}", verdict
            )
        return here

    def lost(self, here: Instant) -> Verdict:
        """Verdict of an instant at which, or next to which, the rank is one less."""
        names = tuple(self.plan.scalars[self.servo.n_contacts + i].name for i in self.plan.active)
        return rank_lost(here, names, self.servo.efforts)

    def efforts(self, here: Instant, t: float) -> np.ndarray:
        """Efforts (j,) that hold the relations at a time [s]."""
        return allocate(here, self.servo, t)

    def rates(self, system: System, state: State, load=None) -> Rates:
        """Accelerations; power of drives and servos, of forces on bodies, lost in dampers, then of each effort."""
        self.evaluations += 1
        here = self.instant(state)
        u = self.efforts(here, state.t)
        x = here.free + here.X_W @ u
        power = u * here.speeds
        total = here.power + [power.sum(), 0.0, 0.0]
        return Rates(x[-system.n_v :], np.concatenate([total, power]))

    @property
    def error(self) -> float:
        """Largest estimated relative error of accelerations at accepted steps."""
        return self.worst

    def project(self, system: System, state: State) -> State:
        """State after a step, brought back to contacts and relations."""
        return settle(self.servo, self.plan, state)

    def check(self, point: Point, last: bool = False):
        """Compare with the saddle system in maximal coordinates, which is solved independently.

        Raises
        ------
        DistrustError
            If the two differ by more than the conditioning explains; from then on the latter is used.
        """
        found = saddle(self.servo, point.state, self.plan)
        exact = found.solve("saddle")
        here = found.instant
        terms = np.abs(here.free) + np.abs(here.X_W) @ np.abs(exact.efforts)  # what the accelerations are the sum of
        largest = np.maximum(np.abs(exact.qdd), FLOOR * terms[-exact.qdd.size :]).max(initial=0.0)
        error = np.abs(exact.qdd - point.rates.acceleration).max(initial=0.0)
        sigma = np.linalg.svd(here.cosines, compute_uv=False).min(initial=1.0)
        if not self.certified and not error <= AGREEMENT * largest / sigma:
            self.certified, self.handed_over = True, point.state.t
            raise DistrustError(f"t = {point.state.t:.6g} s: compiled accelerations are off by {error:.1e}.")
        self.worst = max(self.worst, exact.error, float(error / max(largest, np.finfo(float).tiny)))
