"""What holds at an instant: which closed gaps stay closed, which grips hold, and which slip and how.

While a grip does not slide, the compulsion has the term limit · |q̈ − ẇ|: its force is a multiplier within the limit. The
case of every grip (held, pushed one way, pushed the other) is found by changing the first that is wrong, until none is; this
ends for problems with one answer (Murty, Note on a Bard-type scheme, 1974). Each trial is a compulsion with the held grips
as rows, the others as loads, and the closed gaps as rows G x ≤ h.
"""

from typing import NamedTuple

import numpy as np

from gauss.assembly import Applied, assemble_motion, closed, gaps, grip_rows, kinematics, with_gaps
from gauss.compulsion import Solution
from gauss.dynamics.dynamics import OnDemand
from gauss.dynamics.impact import LEAVING, certified, resting
from gauss.errors import SimulationError
from gauss.system import State, System, build, phase_scene

MOST_CHANGES = 100  # of what grips do, until nothing is wrong
BEYOND = 1e-9  # of its limit: a force within it counts as the limit


class Holding(NamedTuple):
    """What holds.

    Attributes
    ----------
    gaps : tuple of int
        Gaps that stay closed.
    grips : tuple of int
        Of every grip 0 where it holds, and the sign of its force where it slips.
    forces : ndarray, shape (g,)
        Forces of the grips along their coordinates [N m, N].
    solution : Solution
        What shows it.
    """

    gaps: tuple[int, ...]
    grips: tuple[int, ...]
    forces: np.ndarray
    solution: Solution

    @property
    def case(self) -> tuple:
        """What tells one phase of a motion from another."""
        return self.gaps, self.grips


class Holder:
    """Decides what holds in states of one system.

    Parameters
    ----------
    system : System
        With one-sided constraints or grips.
    """

    def __init__(self, system: System):
        self.system, self.names = system, tuple(system.scene.grips)
        self.limits = np.array([grip.limit for grip in system.scene.grips.values()])
        self.cases: dict[tuple, System] = {} if self.names else {(): system}

    def system_of(self, grips: tuple[int, ...]) -> System:
        """System in which the grips do as they are told, and without one-sided constraints."""
        if grips not in self.cases:
            told = dict(zip(self.names, grips, strict=True))
            self.cases[grips] = build(phase_scene(self.system.scene, (), told), OnDemand())
        return self.cases[grips]

    def rates(self, state: State) -> np.ndarray:
        """Rates (g,) with which the grips slide."""
        grips = self.system.scene.grips.values()
        return np.array([state.v[self.system.column(grip.joint)] - float(grip.rate(state.t)) for grip in grips])

    def choose(self, state: State, touching: np.ndarray, backend: str) -> Holding:
        """What holds when the gaps ``touching`` may stay closed.

        Raises
        ------
        SimulationError
            If an answer is not certified, or no case is right.
        """
        whole = kinematics(self.system, state)
        found, (_, J, D) = gaps(whole), grip_rows(whole)
        rates = self.rates(state)
        rests = np.abs(rates) <= resting(state)
        grips = np.where(rests, 0, -np.sign(rates)).astype(int)
        what = f"what holds at t = {state.t:.6g} s"
        for _ in range(MOST_CHANGES):
            motion = kinematics(self.system_of(tuple(grips.tolist())), state)
            problem = with_gaps(assemble_motion(motion, Applied(motion)), found, touching)
            solution = certified(problem, backend, what)
            x = np.concatenate([solution.a, solution.qdd])
            scale = max(np.abs(part).max(initial=0.0) for part in (x, problem.a_free, found.D[touching]))
            force = grip_forces(motion.system, self.names, grips, self.limits, solution)
            over = np.abs(force) > self.limits * (1.0 + BEYOND)
            returns = rests & (grips * (J @ x - D) > LEAVING * scale)
            wrong = np.flatnonzero(over | returns)
            if not wrong.size:
                stays = found.J[touching] @ x - found.D[touching] <= LEAVING * scale * np.abs(found.J[touching]).max(axis=1)
                return Holding(tuple(touching[stays].tolist()), tuple(grips.tolist()), force, solution)
            first = wrong[0]
            grips[first] = 0 if returns[first] else int(np.sign(force[first]))
        names = ", ".join(repr(self.names[i]) for i in wrong)
        raise SimulationError(f"t = {state.t:.6g} s: no forces of {names} within their limits were found.")

    def touching(self, state: State) -> np.ndarray:
        """Gaps of a state that touch and do not open."""
        return closed(gaps(kinematics(self.system, state)), np.abs(state.v).max(initial=0.0))


def grip_forces(system: System, names, grips, limits, solution: Solution) -> np.ndarray:
    """Forces (g,) of grips along their coordinates: multipliers of those that hold, limits of those that slip."""
    rows = {constraint.name: constraint.rows.start for constraint in system.structure.constraints}
    held = [-solution.multipliers[rows[name]] if not grip else 0.0 for name, grip in zip(names, grips, strict=True)]
    return np.asarray(held) + np.asarray(grips) * limits
