"""Event-driven integration of a network: smooth phases by an integrator of scipy, each left at a located event.

A step is accepted if the margins of its phase stay positive and no torque law switches unseen within it. Explicit steps keep
h |λ| ≤ 1/2 for the fastest decay λ: nearer to the limit of stability the error estimate of DOP853 fails. Where that asks for
too many steps, Radau IIA takes over (Hairer and Wanner, Solving ODEs II, IV.2 and IV.8).

The loop is not that of :mod:`gauss.simulation.phases`, which gives the same motions of ``to_scene(network)``, to 2e-10 of
the largest speed, but has no implicit steps, no limit by the decay, and machine code for each phase: the shipped networks
took it 2.6 to 40 times the CPU time (``parallel_branches`` 0.92 s for 0.36 s, ``hoist`` 4.1 s for 0.14 s, second runs),
and ``harvester`` more than 170 s for 0.3 s of motion, which take 0.4 s here.
"""

import time
import warnings
from typing import NamedTuple

import numpy as np
from scipy.integrate import DOP853, OdeSolver, Radau

from gauss.dynamics.laws.switching import endless
from gauss.errors import SimulationError
from gauss.rotors.events import RotorEvent, backward_with_slip, changes
from gauss.rotors.jacobian import Jacobian
from gauss.rotors.landing import land
from gauss.rotors.laws import ROLES
from gauss.rotors.margins import margins
from gauss.rotors.mechanics import NetworkEquations
from gauss.rotors.mode_search import find_phase
from gauss.rotors.phase import NetworkPhase
from gauss.rotors.reduced import REST_SPEED
from gauss.rotors.switching import NetworkSwitching, StepEnd, resolved_share

METHODS: dict[str, type[OdeSolver]] = {"dop853": DOP853, "radau": Radau}
STABLE_STEP = 0.5  # largest explicit step times the fastest decay: nearer to the limit of stability the error estimate fails
STEPS_PER_ESTIMATE = 20  # accepted steps between two estimates of the fastest decay
MOST_EXPLICIT_STEPS = 2_000  # to the next mandatory end of a step; where more are needed the implicit method takes over
SMALLEST_RTOL = 100 * np.finfo(float).eps  # that scipy accepts
MOST_STEPS = 500_000  # of a run: about a minute of a small network
MOST_REFUSALS = 40  # in a row: 40 halvings are below the resolution of time
HOP_RESOLUTIONS = 4.0  # resolutions of time: a discontinuity of a law as near as this is crossed by one Euler step
MOST_CROSSINGS = 100  # of discontinuities in a row, while a law chatters
CHATTER_SHARE = 0.1  # of the run: a law chatters if MOST_STEPS crossings at its rate take no more
POWER_ITERATIONS, DIFFERENCE = 8, 1e-3  # of the fastest decay, and its step of differences relative to v_0
REMEDY = " Of shafts: the law Dry, or a clutch."


class BeltSlipWarning(UserWarning):
    """A belt of constant slip is driven backward: use a friction drive if it matters.

    Examples
    --------
    >>> from gauss import rotors
    >>> issubclass(rotors.BeltSlipWarning, UserWarning)
    True
    """


class Sample(NamedTuple):
    """State of a run at one time, with the accelerations and torques just after it."""

    t: float
    y: np.ndarray
    acceleration: np.ndarray
    torque: np.ndarray
    elastic: np.ndarray
    forward: np.ndarray
    phase: NetworkPhase


class RotorRun:
    """State of an event-driven integration, y = (θ, w, works of ROLES, heat of slip, heat of meshes).

    Parameters
    ----------
    method : str
        "auto", "dop853" or "radau".
    rtol : float
        Local error of angles and speeds, relative to them.
    atol : pair of float
        Absolute part of it [rad, rad/s].
    max_step : float
        Largest step [s].
    switching : NetworkSwitching
        Switching times and switching functions that the steps resolve.
    """

    def __init__(
        self,
        equations: NetworkEquations,
        method: str,
        rtol: float,
        atol: tuple[float, float],
        max_step: float,
        switching: NetworkSwitching,
    ):
        self.switching, self.refused, self.longest = switching, 0, 0.0
        self.crossings: tuple[int, float] = (0, 0.0)  # of discontinuities in a row, and the time of the first
        self.equations, self.reduced, self.method, self.max_step = equations, equations.reduced, method, max_step
        n_g, n_l = self.reduced.n_groups, len(self.reduced.links)
        self.n_g, self.n_l = n_g, n_l
        size = 2 * n_g + len(ROLES) + 2 * n_l
        share = np.sqrt(2 * n_g / size)  # scipy takes the mean over all entries, energies among them
        self.rtol, self.slack = max(rtol * share, SMALLEST_RTOL), max(1e-12, min(rtol, 1e-9))
        # energies follow from the motion; they are controlled against that of the network at its largest speed
        largest = 0.5 * float(self.reduced.inertia @ self.reduced.K**2) * self.reduced.largest**2
        self.atol = np.concatenate([np.repeat(atol, n_g) * share, np.full(size - 2 * n_g, rtol * largest)])
        self.t, self.y = 0.0, np.concatenate([np.zeros(n_g), self.reduced.speed, np.zeros(size - 2 * n_g)])
        self.events: list[RotorEvent] = []
        self.records: list[Sample] = []
        self.evaluations = self.steps = 0
        self.backward: dict[str, float] = {}  # gears of constant slip that were driven backward, and since when
        self._jacobian: Jacobian | None = None
        self.stalled = self._unchecked = 0
        self.elastic_at_start = 0.0  # [J]
        self.first_step: float | None = None  # of the next piece [s]
        self._rate: float | None = None  # fastest decay [1/s], None where it is to be estimated
        self.phase: NetworkPhase
        self.scale = 1.0  # of torques [N m]
        self._direction = np.random.default_rng(0).standard_normal(n_g)  # of the fastest decay

    # The differential equations of a phase.

    def rates(self, t: float, y: np.ndarray) -> np.ndarray:
        """Rates of y."""
        self.evaluations += 1
        found = self.phase.instant(t, y[: self.n_g], y[self.n_g : 2 * self.n_g])
        return np.concatenate([y[self.n_g : 2 * self.n_g], found.acceleration, found.power, found.slipped, found.meshed])

    def jacobian(self, t: float, y: np.ndarray):
        """Sparse Jacobian of the rates; works and heats have no influence."""
        if self._jacobian is None or self._jacobian.phase is not self.phase:
            self._jacobian = Jacobian(self.phase)
        return self._jacobian(self.rates, t, y)

    def options(self, kind: type[OdeSolver]) -> dict:
        """Options of an integrator: tolerances, and the Jacobian of an implicit one."""
        implicit = {"jac": self.jacobian} if kind is Radau else {}
        return implicit | {"rtol": self.rtol, "atol": self.atol}

    def decay(self) -> float:
        """Fastest decay of the speeds [1/s], by power iteration on ∂ω̇/∂ω."""
        (theta, w), v = self.split(self.y), self._direction
        size = DIFFERENCE * self.reduced.v_0
        rate = 0.0
        for _ in range(POWER_ITERATIONS):
            v = v / np.linalg.norm(v)
            ahead, back = (self.phase.instant(self.t, theta, w + sign * size * v).acceleration for sign in (1.0, -1.0))
            v = (ahead - back) / (2 * size)
            if self.switching.surfaces.names:  # a discontinuity nearby is no decay: it lies on one side only
                here = self.phase.instant(self.t, theta, w).acceleration
                v = min((ahead - here) / size, (here - back) / size, key=lambda slope: float(np.linalg.norm(slope)))
            rate = float(np.linalg.norm(v))
            if rate == 0.0:
                return 0.0
        self._direction = v
        return rate

    def split(self, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Angles and speeds of the roots."""
        return y[: self.n_g], y[self.n_g : 2 * self.n_g]

    def margins(self, t: float, y: np.ndarray) -> tuple[list, np.ndarray]:
        """Names and values of the margins of the phase."""
        return margins(self.phase, t, *self.split(y), self.scale)

    # Steps.

    def go(self, end: float, every_step: bool) -> None:
        """Integrate to a time, through all events before it."""
        while self.t < end:
            if self._rate is None:
                self._rate, self._unchecked = self.decay() if self.n_g else 0.0, 0
            name = self.method
            if name == "auto":
                name = "radau" if self._rate * (end - self.t) > STABLE_STEP * MOST_EXPLICIT_STEPS else "dop853"
            self._piece(METHODS[name], end, every_step, self._rate)

    def _piece(self, kind: type[OdeSolver], end: float, every_step: bool, rate: float) -> None:
        """Steps of one integrator: until the end, an event, a refusal, or the next estimate of the fastest decay."""
        cap = min(self.max_step, STABLE_STEP / rate if kind is DOP853 and rate else np.inf)
        first = None if self.first_step is None else min(self.first_step, cap, end - self.t)
        solver = kind(self.rates, self.t, self.y, end, max_step=cap, first_step=first, **self.options(kind))
        keys, before = self.margins(self.t, self.y)
        while solver.status == "running":
            self._step(solver, rate)
            dense, h = solver.dense_output(), solver.t - solver.t_old
            if self._refused(solver.t_old, solver.t, dense):
                return
            self.refused, self.longest = 0, max(self.longest, h)
            middle = 0.5 * (solver.t_old + solver.t)
            ends = (middle, self.margins(middle, dense(middle))[1]), (solver.t, self.margins(solver.t, solver.y)[1])
            for t, values in ends:
                negative = np.flatnonzero((values < -self.slack) & (values < before))
                if negative.size:
                    land(self, kind, dense, solver.t_old, t, keys, before, negative)
                    return
            self.t, self.y, before = solver.t, solver.y, ends[1][1]
            if self._sign_indicators():
                keys, before = self.margins(self.t, self.y)
            if every_step and self.t < end:
                self.record()
            self.first_step, self._unchecked = solver.h_abs, self._unchecked + 1
            if self._unchecked >= STEPS_PER_ESTIMATE:
                self._rate = None
                return

    def _step(self, solver: OdeSolver, rate: float) -> None:
        """One step of an integrator; SimulationError if steps become too many or too short, or the rates are not finite."""
        message = solver.step()
        self.steps += 1
        if self.steps > MOST_STEPS:
            raise SimulationError(
                f"at t = {self.t:.9g} s after {MOST_STEPS} steps the motion is too stiff (fastest decay {rate:.3g} 1/s): "
                "loosen rtol and atol, or replace the stiffest friction drive by a gear of constant slip."
            )
        if solver.status == "failed" and self.switching.surfaces.names:
            raise SimulationError(endless(self.t, self.switching.surfaces.names) + REMEDY)
        if solver.status == "failed" or not np.isfinite(solver.y).all():
            raise SimulationError(not_finite(self.t, message or "not finite"))

    def _refused(self, begin: float, end: float, dense) -> bool:
        """Whether a step is refused, for a law that switches in it; a discontinuity at its start is crossed."""
        share, jump = resolved_share(self, begin, end, dense)
        if jump is not None and jump - self.t <= HOP_RESOLUTIONS * self.switching.finest:
            self._hop(min(jump + self.switching.finest, end))
            return True
        if share < 1.0 and self.refused < MOST_REFUSALS:
            self.first_step, self.refused = share * (end - begin), self.refused + 1
            return True
        return False

    def _hop(self, until: float) -> None:
        """Cross a discontinuity of a law by an Euler step near the resolution of time, and find the phase beyond it.

        SimulationError if crossings follow each other so fast that the run would not come to an end.
        """
        (count, since), duration = self.crossings, self.switching.duration
        chatters = self.t - since <= (count + 1) * CHATTER_SHARE * duration / MOST_STEPS
        self.crossings = (count + 1, since) if chatters else (0, self.t)
        if count > MOST_CROSSINGS:
            raise SimulationError(endless(self.t, self.switching.surfaces.names) + REMEDY)
        self.y = self.y + (until - self.t) * self.rates(self.t, self.y)
        self.t, self.refused = until, 0
        self.change()

    # Phases and samples.

    def start(self) -> None:
        """Find the first phase."""
        self.phase = find_phase(self.equations, self.t, *self.split(self.y), slack=self.slack)
        self._arrive()
        self.elastic_at_start = float(self.phase.elastic(self.split(self.y)[0]).sum())

    def change(self, fired=(), probe=None) -> None:
        """Find the phase that follows, and record the events between the two."""
        old, (theta, w) = self.phase, self.split(self.y)
        self.phase = find_phase(
            self.equations, self.t, theta, w, previous=old, fired=fired, probe=probe, slack=2 * self.slack
        )
        self.events += changes(old, self.phase, self.t, self.reduced.K * w[self.reduced.group])
        for name in backward_with_slip(old, self.phase):
            self.backward.setdefault(name, self.t)
        self._arrive(old)

    def _arrive(self, old: NetworkPhase | None = None) -> None:
        """Begin a phase: project the speeds onto its locks; elastic energy of sides that separated becomes heat."""
        theta, w = self.split(self.y)
        y = self.y.copy()
        y[self.n_g : 2 * self.n_g] = self.phase.landed(w)
        if old is not None:
            heat = slice(2 * self.n_g + len(ROLES), 2 * self.n_g + len(ROLES) + self.n_l)
            y[heat] += old.elastic(theta) - self.phase.elastic(theta)
        self.y = y
        found = self.phase.instant(self.t, *self.split(y))
        if not np.isfinite(found.acceleration).all():  # no solver would come to an end from here
            raise SimulationError(not_finite(self.t, "not finite"))
        self.scale = self.phase.size(self.t, *self.split(y), found)
        self._direction = np.random.default_rng(0).standard_normal(self.n_g)
        self.first_step = self._rate = None

    def _sign_indicators(self) -> bool:
        """Give a sign to indicators that started at zero; whether there were any."""
        before, self.phase = self.phase, self.phase.signed(*self.split(self.y), self.slack / REST_SPEED)
        return self.phase is not before

    def record(self, t: float | None = None) -> None:
        """Keep the state as that of a time, with the accelerations and torques just after it."""
        found = self.phase.instant(self.t, *self.split(self.y))
        torque = self.phase.link_torques(found)
        elastic = self.phase.elastic(self.split(self.y)[0])
        t = self.t if t is None else t
        self.records.append(Sample(t, self.y, found.acceleration, torque, elastic, self.phase.mode.forward, self.phase))

    def collect(self, ends: list[StepEnd], every_step: bool) -> float:
        """Integrate from the start through all mandatory ends of steps; returns the wall time [s]."""
        begin = time.perf_counter()
        self.start()
        if every_step:
            self.record()
        for end in ends:
            self.go(end.before, every_step)
            self.t = max(self.t, end.after)  # a few units in the last place later
            if end.switches:
                self.change()
            if every_step:
                self.record()
            for t in end.samples:
                self.record(t)
        for name, since in self.backward.items():
            warnings.warn(
                f"gear {name!r} of constant slip is driven backward, first at t = {since:.6g} s: its slip keeps its sign; "
                "use a friction drive if it matters.",
                BeltSlipWarning,
                stacklevel=3,
            )
        return time.perf_counter() - begin


def not_finite(t: float, reason: str) -> str:
    """Message when laws or curves give no finite rates."""
    return f"at t = {t:.9g} s no step is small enough ({reason}); check laws and curves."
