"""What is recorded of a motion besides its samples: statistics, events, energies."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from gauss.dynamics.rules import Plan
from gauss.errors import listed

MOST_NAMED = 5  # bodies that a line names; the attributes hold all


class SleepRecord(NamedTuple):
    """Sleeping of bodies in a motion.

    Attributes
    ----------
    able, never : tuple of str
        Bodies that may sleep, and those that never do, as a law of time or a prescribed motion acts on them.
    steps : dict of str to int
        Number of steps after which each body slept first; of those that slept.
    asleep : tuple of str
        Bodies asleep at the end.
    woken : int
        How often a body was woken.
    """

    able: tuple[str, ...]
    never: tuple[str, ...]
    steps: dict[str, int]
    asleep: tuple[str, ...]
    woken: int

    def __repr__(self):
        never = f"; never: {listed(self.never, MOST_NAMED)}" if self.never else ""
        asleep = f": {listed(self.asleep, MOST_NAMED)}" if self.asleep else ""
        woken = f"; {self.woken} times woken" if self.woken else ""
        counts = f"{len(self.steps)} of {len(self.able)} able bodies slept, {len(self.asleep)} at the end"
        return f"SleepRecord({counts}{asleep}{woken}{never})"


class Stats(NamedTuple):
    """Statistics of a simulation.

    Attributes
    ----------
    evaluations, steps, rejected : int
        Evaluations of the accelerations, accepted and rejected steps.
    factorisations : int
        Matrices factored for the equations of implicit methods.
    wall_time : float
        Time taken [s].
    worst_error : float
        Largest relative error of the accelerations, from checks and certificates.
    method : str
        Source of the accelerations.
    rescued : int
        Solutions for which the first solver failed, and another one was certified.
    global_error : tuple of float, optional
        Largest error of coordinates [rad, m] and of rates [rad/s, m/s] in any sample, estimated on request.
    unseen : int
        Steps that may have passed a condition of a law undetected.
    opaque : str
        Names of loads with opaque laws that were evaluated too seldom to detect short features.
    plan : Plan or None
        Driver and dynamics of the motion.
    handed_over : float or None
        Time from which the fallback of the plan continued [s]; None if it was not needed.
    sleep : SleepRecord or None
        Which bodies slept, of a motion with ``sleeping=``.
    law_error : float or None
        Largest residual of the laws of contact and friction in time stepping, relative; None of other motions.
    """

    evaluations: int
    steps: int
    rejected: int
    factorisations: int
    wall_time: float
    worst_error: float
    method: str
    rescued: int = 0
    global_error: tuple[float, float] | None = None
    unseen: int = 0
    opaque: str = ""
    plan: Plan | None = None
    handed_over: float | None = None
    sleep: SleepRecord | None = None
    law_error: float | None = None

    def __repr__(self):
        rejected = f" and {self.rejected} rejected" if self.rejected else ""
        plan = "" if self.plan is None else f", {self.plan.driver}, {self.plan.dynamics} dynamics"
        sleep = "" if self.sleep is None else f", {self.sleep}"
        laws = "" if self.law_error is None else f", laws of contact met to {self.law_error:.0e}"
        cost = f"{self.steps} steps{rejected}, {self.evaluations} evaluations, {self.wall_time:.3g} s"
        return f"Stats({cost}{plan}{laws}{sleep})"


SUMMED = "evaluations", "steps", "rejected", "factorisations", "wall_time", "rescued", "unseen"


def joined_stats(parts: Sequence[Stats]) -> Stats:
    """Statistics of a motion in parts: sums of counts and times, the worst error, and the rest as of the last part."""
    sums = {name: sum(getattr(part, name) for part in parts) for name in SUMMED}
    return parts[-1]._replace(**sums, worst_error=max(part.worst_error for part in parts))


@dataclass(frozen=True)
class Event:
    """Impact, or change of the contact mode: of closed unilateral constraints and of sticking elements.

    Parameters
    ----------
    t : float
        When [s].
    kind : str
        "impact": a gap closes with a velocity, in time stepping of a contact that was open at all its points, or a
        prescribed velocity jumps; "opens" or "closes" without impact; "slips" or "holds" of contacts, joint friction and
        limited drives; "power reversal", "starts", "stuck" of links with losses; "contact" or "separate" of backlash
        sides; "sleeps" or "wakes" of bodies.
    gaps : tuple of str
        Names of the gaps, elements or bodies, and of drives and constraints whose velocity jumps.
    loss : float
        Kinetic energy lost, the work of prescribed motions included [J].
    impulses : dict of str to tuple of float
        At an impact: impulses of prescribed motions and of all other constraints beyond the joints, along each residual [N
        s, N m s], signed as :func:`gauss.drive_forces` and :func:`gauss.constraint_forces`.
    """

    t: float
    kind: str
    gaps: tuple[str, ...]
    loss: float = 0.0
    impulses: dict[str, tuple[float, ...]] = field(default_factory=dict, hash=False)


class EnergyRecord(NamedTuple):
    """Energies along a motion, for its energy balance; numbers, or arrays (batch,) of a batch."""

    kinetic: float  # kinetic, lowest, highest: largest kinetic energy, least and largest potential energy [J]
    lowest: float
    highest: float
    # size that the rounding of the potential energy is relative to [J], see
    # :func:`gauss.dynamics.energies.look_at_energies`
    magnitude: float
    # initial, balance, off: T + V − work + dissipated at the start; its change up to the last point, and the largest change
    # in size [J]
    initial: float
    balance: float
    off: float
    jump: float  # jump, when: largest change of the balance from one point to the next [J], and the time of the latter [s]
    when: float

    @property
    def scale(self):
        """Energy that the balance is compared with [J]."""
        return np.maximum(self.kinetic, self.highest - self.lowest)
