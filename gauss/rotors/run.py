"""One run: from event to event by an integrator of scipy, landing on each event, each switch and each sample."""

import time
import warnings

import numpy as np
from scipy.integrate import DOP853, Radau
from scipy.optimize import brentq

from gauss.dynamics.laws.switching import endless
from gauss.errors import SimulationError
from gauss.rotors.events import Event, backward_with_slip, changes
from gauss.rotors.jacobian import Jacobian
from gauss.rotors.laws import ROLES
from gauss.rotors.mechanics import Equations
from gauss.rotors.mode_search import settle
from gauss.rotors.phase import Phase
from gauss.rotors.reduced import REST
from gauss.rotors.stops import Stop
from gauss.rotors.switching import Switching

METHODS = {"dop853": DOP853, "radau": Radau}
CAP = 0.5  # largest step times the fastest decay: at the limit of stability the error estimate is fooled
RECHECKED = 20  # steps after which the fastest decay is estimated again
PATIENCE = 2_000  # steps of dop853 to the next stop beyond which the implicit method takes over
FINEST = 100 * np.finfo(float).eps  # rtol that scipy accepts
MOST = 500_000  # steps of a run; more would look as if it hung
CHATTER, PROGRESS = 100, 1e-12  # events without progress in time; of the run: what is none
DECIDED = 4.0  # slacks beyond an event where it is plain what follows
LANDINGS = 6  # corrections of the time of an event
REFUSED = 40  # steps in a row, after which a passage is shorter than time can tell
HOP = 4.0  # times the shortest time that is resolved: so near to a surface at which a law jumps it is crossed at once
CROSSING, PACE = 100, 0.1  # surfaces crossed so fast that a run would cross MOST over PACE of them: it comes to no end
# Opaque laws: dense output y is sampled, and y' − f(t, y) must not change the speeds by far more than the error allowed.
DEFECTS, NEAR = (0.187, 0.431, 0.569, 0.813), 1e-4  # where in a step, and how far from there y' is found by differences
UNSEEN, HALF, SHORT = 1e5, 0.5, 1e-6  # times the error allowed; of the step; of the run: in shorter steps none is sought
REMEDY = " Of shafts: the law Dry, or a clutch."


class BeltSlipWarning(UserWarning):
    """A belt of constant slip is driven backward: use a friction drive if it matters."""


class Run:
    """State of a run.

    Parameters
    ----------
    equations : Equations
        Equations of the network.
    method : str
        "auto", "dop853" or "radau".
    rtol : float
        Local error allowed of angles and speeds, relative to them.
    atol : pair of float
        Absolute part of it [rad, rad/s].
    max_step : float
        Largest step [s].
    switching : Switching
        What steps heed so that nothing acts between two evaluations.
    """

    def __init__(self, equations: Equations, method: str, rtol: float, atol, max_step: float, switching: Switching):
        self.switching, self.refused, self.hops, self.longest = switching, 0, (0, 0.0), 0.0
        self.equations, self.reduced, self.method, self.max_step = equations, equations.reduced, method, max_step
        n_g, n_l = self.reduced.n_groups, len(self.reduced.links)
        self.n_g, self.n_l = n_g, n_l
        size = 2 * n_g + len(ROLES) + 2 * n_l
        share = np.sqrt(2 * n_g / size)  # scipy takes the mean over all entries, energies among them
        self.rtol, self.slack = max(rtol * share, FINEST), max(1e-12, min(rtol, 1e-9))
        # energies follow from the motion; they are controlled against that of the network at its largest speed
        largest = 0.5 * float(self.reduced.inertia @ self.reduced.K**2) * self.reduced.largest**2
        self.atol = np.concatenate([np.repeat(atol, n_g) * share, np.full(size - 2 * n_g, rtol * largest)])
        self.t, self.y = 0.0, np.concatenate([np.zeros(n_g), self.reduced.speed, np.zeros(size - 2 * n_g)])
        self.phase: Phase | None = None
        self.events: list[Event] = []
        self.records: list[tuple] = []
        self.evaluations = self.steps = 0
        self.backward: dict[str, float] = {}  # gears of constant slip that were driven backward, and since when
        self._jacobian: tuple[Phase, Jacobian] | None = None
        self._crowd = self._unchecked = 0
        self._step: float | None = None  # to begin the next piece with
        self._rate: float | None = None  # fastest decay, None when it is to be looked for
        self._direction = np.random.default_rng(0).standard_normal(n_g)  # where the fastest decay was found

    # The differential equations of a phase.

    def rates(self, t, y):
        """Rates of (θ, w, work of motors, loads and losses, heat of slip, heat of meshes)."""
        self.evaluations += 1
        found = self.phase.instant(t, y[: self.n_g], y[self.n_g : 2 * self.n_g])
        return np.concatenate([y[self.n_g : 2 * self.n_g], found.acceleration, found.power, found.slipped, found.meshed])

    def jacobian(self, t, y):
        """Matrix of derivatives of the rates; works move nothing."""
        if self._jacobian is None or self._jacobian[0] is not self.phase:
            self._jacobian = self.phase, Jacobian(self.phase)
        return self._jacobian[1](self.rates, t, y)

    def decay(self) -> float:
        """Fastest rate [1/s] of the speeds, by power iteration on ∂ω̇/∂ω."""
        theta, w, v = self.y[: self.n_g], self.y[self.n_g : 2 * self.n_g], self._direction
        size = 1e-3 * self.reduced.v_0
        rate = 0.0
        for _ in range(8):
            v = v / np.linalg.norm(v)
            ahead, back = (self.phase.instant(self.t, theta, w + way * size * v).acceleration for way in (1.0, -1.0))
            v = (ahead - back) / (2 * size)
            if self.switching.surfaces.names:  # a jump nearby is no decay: it lies on one side only
                here = self.phase.instant(self.t, theta, w).acceleration
                v = min((ahead - here) / size, (here - back) / size, key=np.linalg.norm)
            rate = np.linalg.norm(v)
            if rate == 0.0:
                return 0.0
        self._direction = v
        return float(rate)

    # The way from stop to stop.

    def start(self):
        """Find the first phase."""
        self.phase = settle(self.equations, self.t, *self.split(self.y), slack=self.slack)
        self._arrive()

    def split(self, y):
        """Angles and speeds of the roots."""
        return y[: self.n_g], y[self.n_g : 2 * self.n_g]

    def go(self, stop: float, every_step: bool):
        """Move to a time, through all events on the way."""
        while self.t < stop:
            if self._rate is None:
                self._rate, self._unchecked = self.decay() if self.n_g else 0.0, 0
            name = self.method
            if name == "auto":
                name = "radau" if self._rate * (stop - self.t) > CAP * PATIENCE else "dop853"
            self._piece(METHODS[name], stop, every_step)

    def _piece(self, kind, stop: float, every_step: bool):
        """Some steps with one integrator: until the stop, an event, or the next look at the fastest decay."""
        rate, heeded = self._rate, self.switching
        cap = min(self.max_step, CAP / rate if kind is DOP853 and rate else np.inf)
        options = {"jac": self.jacobian} if kind is Radau else {}
        first = None if self._step is None else min(self._step, cap, stop - self.t)
        options |= {"max_step": cap, "rtol": self.rtol, "atol": self.atol, "first_step": first}
        solver = kind(self.rates, self.t, self.y, stop, **options)
        keys, before = self._margins(self.t, self.y)
        while solver.status == "running":
            message = solver.step()
            self.steps += 1
            if self.steps > MOST:
                raise SimulationError(
                    f"at t = {self.t:.9g} s after {MOST} steps the motion is too stiff (fastest decay {rate:.3g} 1/s): "
                    "loosen rtol and atol, or replace the stiffest friction drive by a gear of constant slip."
                )
            if solver.status == "failed" and heeded.surfaces.names:
                raise SimulationError(endless(self.t, heeded.surfaces.names) + REMEDY)
            if solver.status == "failed" or not np.isfinite(solver.y).all():
                raise SimulationError(not_finite(self.t, message or "not finite"))
            dense, h = solver.dense_output(), solver.t - solver.t_old
            share, jump = self._share(solver.t_old, solver.t, dense)
            if jump is not None and jump - self.t <= HOP * heeded.finest:
                self._hop(min(jump + heeded.finest, solver.t))
                return
            if share < 1.0 and self.refused < REFUSED:
                self._step, self.refused = share * h, self.refused + 1
                return
            self.refused, self.longest = 0, max(self.longest, h)
            middle, after = self._watch(solver, dense)
            for t, margins in ((0.5 * (solver.t_old + solver.t), middle), (solver.t, after)):
                left = np.flatnonzero((margins < -self.slack) & (margins < before))
                if left.size:
                    self._land(kind, solver, keys, before, t, left, dense)
                    return
            self.t, self.y, before = solver.t, solver.y, after
            if self._wake():
                keys, before = self._margins(self.t, self.y)
            if every_step and self.t < stop:
                self.record()
            self._step, self._unchecked = solver.h_abs, self._unchecked + 1
            if self._unchecked >= RECHECKED:
                self._rate = None
                return

    def _margins(self, t, y):
        return self.phase.margins(t, *self.split(y), self.scale)

    def _watch(self, solver, dense) -> tuple:
        """Margins in the middle of a step and at its end."""
        middle = 0.5 * (solver.t_old + solver.t)
        return self._margins(middle, dense(middle))[1], self._margins(solver.t, solver.y)[1]

    def _share(self, begin: float, end: float, dense) -> tuple[float, float | None]:
        """Share of a step that may be made without passing anything unseen, 1 for all of it; and when a law jumps [s]."""
        heeded, share, jump = self.switching, 1.0, None
        if heeded.surfaces and end - begin > heeded.finest:
            share, jump = heeded.surfaces.share(begin, end, lambda t: dense(t)[: 2 * self.n_g], heeded.finest)
            if jump is not None:
                share = min(share, (jump - begin - heeded.finest) / (end - begin))
        if share == 1.0 and heeded.opaque and end - begin > SHORT * heeded.duration:
            share = HALF if any(self._missed(begin, end, dense, place) for place in DEFECTS) else 1.0
        return share, jump

    def _hop(self, until: float):
        """Move across a surface at which a law jumps, in so short a time that any rates will do, and find the phase there.

        Raises
        ------
        SimulationError
            If it is crossed so often that the run would not come to an end.
        """
        heeded, (count, since) = self.switching, self.hops
        self.hops = (count + 1, since) if self.t - since <= (count + 1) * PACE * heeded.duration / MOST else (0, self.t)
        if count > CROSSING:
            raise SimulationError(endless(self.t, heeded.surfaces.names) + REMEDY)
        self.y = self.y + (until - self.t) * self.rates(self.t, self.y)
        self.t, self.refused = until, 0
        self.change()

    def _missed(self, begin: float, end: float, dense, place: float) -> bool:
        """Whether at a place in a step the dense output is far from the rates there."""
        h, speeds = end - begin, slice(self.n_g, 2 * self.n_g)
        times = begin + (place + NEAR * np.array([-1.0, 0.0, 1.0])) * h
        y = dense(times)
        slope = (y[speeds, 2] - y[speeds, 0]) / (times[2] - times[0])
        defect = slope - self.phase.instant(times[1], *self.split(y[:, 1])).acceleration
        return bool((h * np.abs(defect) > UNSEEN * (self.atol[speeds] + self.rtol * np.abs(y[speeds, 1]))).any())

    def _land(self, kind, solver, keys, before, until, left, dense):
        """Step from the start of the step again, to the first margin that is left, and find the new phase."""
        begin, y_begin = solver.t_old, self.y
        margin = lambda t, k: self._margins(t, dense(t) if t > begin else y_begin)[1][k]  # noqa: E731
        roots: dict[int, float] = {}
        for k in left:
            shift = 0.0 if before[k] > 0 else self.slack
            if before[k] + shift <= 0:
                roots[k] = begin
            else:
                roots[k] = brentq(
                    lambda t, k=k, s=shift: margin(t, k) + s, begin, until, xtol=self.switching.finest, rtol=1e-15
                )
        first = min(roots, key=roots.get)
        t, y = roots[first], y_begin
        for _ in range(LANDINGS):
            if t <= begin:
                t, y = begin, y_begin
                break
            y = self._reach(kind, begin, y_begin, t)
            value = self._margins(t, y)[1][first] + (0.0 if before[first] > 0 else self.slack)
            h = 1e-4 * (until - begin)
            slope = (margin(min(t + h, until), first) - margin(max(t - h, begin), first)) / (
                min(t + h, until) - max(t - h, begin)
            )
            if slope >= 0 or abs(value / slope) <= 4 * np.finfo(float).eps * max(t, until - begin):
                break
            t = min(max(t - value / slope, begin), until)
        self._crowd = self._crowd + 1 if t - self.t <= PROGRESS * self.switching.duration else 0
        if self._crowd > CHATTER:
            raise SimulationError(
                f"at t = {t:.9g} s more than {CHATTER} events follow each other without progress, the last of "
                f"{keys[first][0]} {keys[first][1]}; a discontinuity holds the motion: give the element a finite slope."
            )
        self.t, self.y = float(t), y
        at_zero = np.flatnonzero(self._margins(t, y)[1] <= self.slack)
        beyond = lambda t: margin(t, first) + DECIDED * self.slack  # noqa: E731
        probe = (
            t if beyond(t) <= 0 or beyond(until) >= 0 else brentq(beyond, t, until, xtol=self.switching.finest, rtol=1e-15)
        )
        if beyond(probe) > 0.5 * DECIDED * self.slack:  # as soon as time can be told apart it is past
            probe = until
        self.change({keys[k] for k in (first, *at_zero)}, (probe, *self.split(dense(probe))))
        self.record()

    def _reach(self, kind, t, y, stop):
        """Integrate over a part of a step that was accepted whole."""
        options = {"jac": self.jacobian} if kind is Radau else {}
        solver = kind(self.rates, t, y, stop, first_step=stop - t, rtol=self.rtol, atol=self.atol, **options)
        while solver.status == "running":
            solver.step()
        return solver.y

    def change(self, fired=(), probe=None):
        """Find the phase that follows, and say what happened."""
        old = self.phase
        theta, w = self.split(self.y)
        self.phase = settle(self.equations, self.t, theta, w, previous=old, fired=fired, probe=probe, slack=2 * self.slack)
        self.events += changes(old, self.phase, self.t, self.reduced.K * w[self.reduced.group])
        for name in backward_with_slip(old, self.phase):
            self.backward.setdefault(name, self.t)
        self._arrive(old)

    def _arrive(self, old: Phase | None = None):
        """Begin a phase: nothing creeps that holds, and energy of flanks that parted becomes heat."""
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
        self._step = self._rate = None

    def _wake(self) -> bool:
        """Give a sign to indicators that started at zero; whether there were any."""
        before, self.phase = self.phase, self.phase.woken(*self.split(self.y), self.slack / REST)
        return self.phase is not before

    def record(self, t: float | None = None):
        """Keep the state as that of a time, and what follows from it just afterwards."""
        found = self.phase.instant(self.t, *self.split(self.y))
        torque = self.phase.link_torques(found)
        elastic = self.phase.elastic(self.split(self.y)[0])
        t = self.t if t is None else t
        self.records.append((t, self.y, found.acceleration, torque, elastic, self.phase.mode.forward, self.phase))

    def collect(self, stops: list[Stop], every_step: bool) -> float:
        """Run from the start through all stops; returns the time it took [s]."""
        begin = time.perf_counter()
        self.start()
        if every_step:
            self.record()
        for stop in stops:
            self.go(stop.before, every_step)
            self.t = max(self.t, stop.after)  # a few units in the last place later
            if stop.switches:
                self.change()
            if every_step:
                self.record()
            for t in stop.samples:
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
