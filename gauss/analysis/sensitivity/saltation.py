"""Saltation matrices: how an event carries small changes of the state before it to those after it.

An event at the time t of g(t, x) = 0, with x⁺ = I(t, x⁻) there, comes later by dt = −g_x dx⁻ / (g_x f⁻ + g_t), and

    dx⁺ = I_x dx⁻ + I_p dp + (I_x f⁻ + I_t − f⁺) dt

at the same time, with ẋ = f⁻ before and f⁺ after, and −g_p dp / (g_x f⁻ + g_t) of dt for parameters of the gap (Aizerman and
Gantmakher 1958; Leine and Nijmeijer, Dynamics and Bifurcations of Non-Smooth Mechanical Systems, 2004, ch. 7). Where rates
and accelerations are continuous nothing changes: a gap that opens as its force ends, a sticking element that begins to slip
as its force reaches its limit. Where no derivative exists, as two gaps close at once or one is grazed, the event is refused
by name.
"""

from typing import NamedTuple

import numpy as np

from gauss.analysis.sensitivity.event_derivatives import EventDerivatives
from gauss.analysis.sensitivity.event_parameters import gap_by_parameters, rates_by_restitution
from gauss.analysis.sensitivity.phase_record import RecordedPhase, packed, smooth_system
from gauss.dynamics.constraint_scales import gap_scales
from gauss.dynamics.motion_step import MotionStep
from gauss.dynamics.parameter_terms import OF_JOINTS
from gauss.errors import SimulationError
from gauss.scene import Stop
from gauss.system import System, sides

CONTINUOUS = 1e-6  # change of the accelerations, relative to the largest, below which they are continuous: bisected times
GRAZING = 1e-4  # closing rate of a gap over its scale and the fastest rate, below which derivatives grow beyond all use
SUPPRESSED = 1e-3  # rate after an impact, relative to that with restitution, below which gauss suppressed the rebound


class Saltation(NamedTuple):
    """Linear map of small changes over an event."""

    # (n_x, n_x + n_u + n_p) changes of the state after it by those of the state before, of inputs and of parameters
    matrix: np.ndarray

    def change(self, directions: np.ndarray) -> np.ndarray:
        """Changes (n_x, k) of the state after it along directions (n_given, k)."""
        return self.matrix @ directions

    def gradient(self, weights: np.ndarray) -> np.ndarray:
        """Gradient (n_given,) of weights · state after it."""
        return weights @ self.matrix


class Transition(NamedTuple):
    """Event between two phases."""

    whole: System  # the system with events
    before: RecordedPhase  # before, after: the phases
    after: RecordedPhase
    steps: tuple[MotionStep, MotionStep]  # their smooth dynamics
    inputs: np.ndarray  # (n_u,) inputs at the event

    def saltation(self) -> Saltation:
        """Saltation matrix; SimulationError if the motion has no derivative at the event, by the names of its elements."""
        one, end, start = self.steps[0], self.before.end, self.after.start
        n, found = one.n_x, np.zeros((one.n_x, one.n_given))
        found[:, :n] = np.eye(n)
        first = one.rate(end.t, packed(end), self.inputs)
        last = self.steps[1].rate(start.t, packed(start), self.inputs)
        if self.before.struck or self.before.other:
            self._impact(found, first, last)
        elif np.abs(last - first).max() > CONTINUOUS * np.abs([first, last]).max():
            found[:, :n] += np.outer(first - last, self._later(*self._stopping(first), first))
        return Saltation(found)

    def _impact(self, found: np.ndarray, first: np.ndarray, last: np.ndarray):
        """Write derivatives of the state after an impact."""
        whole, before, one, n = self.whole, self.before, self.steps[0], self.steps[0].n_x
        names = [sides(whole.scene)[i].name for i in before.struck]
        if before.other or len(names) != 1:
            self._refuse("takes part in an impact with others at once", [*names, *before.other])
        (gap,) = before.struck
        by_state, by_time = (part[gap] for part in EventDerivatives(whole, before.end).gaps())
        if -(by_state @ first + by_time) < GRAZING * gap_scales(whole)[gap] * whole.scale.fastest(before.end.v):
            self._refuse("is grazed", names)
        self._refuse_places(gap)
        closed = smooth_system(whole, before.phase, tuple(sorted({gap, *before.bearing})))
        derivatives, n_q = EventDerivatives(closed, before.end), whole.n_q
        restitution = self._restitution(gap, by_state)
        by_x, by_t = derivatives.rates_after(restitution)
        I_x, I_t = np.eye(n), np.zeros(n)
        I_x[n_q:], I_t[n_q:] = by_x, by_t
        jump = I_x @ first + I_t - last
        found[:, :n] = I_x + np.outer(jump, self._later(by_state, by_time, first))
        if one.n_p:
            change, own = self.after.start.v - before.end.v, found[:, n + len(one.inputs) :]
            own[n_q:] = derivatives.rates_after_by(one.sizes, change)
            own[n_q:] += rates_by_restitution(whole, gap, one.sizes, change, restitution)
            own += np.outer(jump, self._later(gap_by_parameters(whole, gap, one.sizes), by_time, first, by_state))

    def _restitution(self, gap: int, by_state: np.ndarray) -> float:
        """Coefficient that held in the impact: 0 where a slow rebound was suppressed."""
        own = sides(self.whole.scene)[gap].whole.restitution
        after = EventDerivatives(self.whole, self.after.start).gaps()
        rates = [
            by_x[gap] @ self.steps[k].rate(state.t, packed(state), self.inputs) + by_t[gap]
            for k, state, (by_x, by_t) in (
                (0, self.before.end, EventDerivatives(self.whole, self.before.end).gaps()),
                (1, self.after.start, after),
            )
        ]
        return own if rates[1] > -SUPPRESSED * own * rates[0] else 0.0

    def _stopping(self, first: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives by state and time of the rate of the sliding element that comes to rest.

        Of the velocity residuals of the phase in which it sticks only its own changes along the motion.
        """
        old, new = self.before.phase.mode.set_valued, self.after.phase.mode.set_valued
        stopped = [name for name, way in old.items() if way and new[name] != way]
        if len(stopped) != 1:
            held = [sides(self.whole.scene)[i].name for i in {*self.before.phase.case[0]} ^ {*self.after.phase.case[0]}]
            slipping = [name for name, way in new.items() if way != old[name]]
            self._refuse("changes forces by a jump", [*held, *slipping] or ["a law of time"])
        sticking = smooth_system(
            self.whole, self.before.phase, self.before.phase.case[0], set_valued=dict.fromkeys(stopped, 0)
        )
        by_state, by_time = EventDerivatives(sticking, self.before.end).velocity_residuals()
        along = by_state @ first + by_time
        return along @ by_state, along @ by_time

    def _later(self, slopes: np.ndarray, by_time, first: np.ndarray, by_state=None) -> np.ndarray:
        """Derivatives of the time of the event by what g has the slopes of: the state when ``by_state`` is not given."""
        return -slopes / ((slopes if by_state is None else by_state) @ first + by_time)

    def _refuse_places(self, gap: int):
        """Raise a SimulationError for derivatives by places on which the gap function or loops depend."""
        placed = [name for name in self.steps[0].parameters if name.partition(":")[0] in OF_JOINTS]
        side = sides(self.whole.scene)[gap]
        if placed and (self.whole.has_closures or not isinstance(side.whole, Stop)):
            raise SimulationError(f"derivatives by {', '.join(placed)} through impacts of {side.name!r} are not available.")

    def _refuse(self, what: str, names: list[str]):
        named = " and ".join(map(repr, names))
        raise SimulationError(f"the motion has no derivative at t = {self.before.end.t:.6g} s: {named} {what}.")
