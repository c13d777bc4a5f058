"""Machine code of a large scene with loops: calls of small functions, in rounds until the closing rows are met."""

from threading import Lock

import numpy as np

from gauss.codegen.kernels import CallRecorder, Vector
from gauss.dynamics.call_graph import DAMPED, CallGraph
from gauss.dynamics.constrained_aba import MU
from gauss.dynamics.error_scale import acceleration_scale
from gauss.dynamics.kinematics import Kinematics
from gauss.dynamics.loads import Applied
from gauss.dynamics.mechanism import loop_constraint_scales
from gauss.dynamics.projection import CLOSED
from gauss.system import State, System, retract

ROUNDS = 6  # at most, of the proximal method
PLAIN = 3  # rounds that are made in any case, as many as small systems take
LIVE = 0.1  # by less than this a round shrinks what is wrong where some row has all but faded: more rounds would revive it
MET = 1e-15  # change of accelerations, relative to the largest, at which rounding is reached
STEPS = 4  # of Newton's method after an integration step, at most, on one factorisation


class CallGraphKernels:
    """Forward dynamics, their check and projection, called as :class:`gauss.dynamics.traced_system.Kernels` are.

    Parameters
    ----------
    system : System
        One with loops, without couplings and relations.
    gains : tuple of float, optional
        α and β [1/s] with which motions are drawn back to the constraints, −2α ċ − β² c.
    """

    def __init__(self, system: System, gains: tuple[float, float] | None = None):
        self.system, self.gains, self._lock, cells = system, gains, Lock(), CallRecorder()
        sizes = {"q": system.n_q, "v": system.n_v, "effort": system.n_v, "rates": system.n_v}
        given = {name: cells.keep(np.zeros(size)) for name, size in sizes.items()}
        parts = [CallGraph(part, cells, given["q"][part.q], given["v"][part.v]) for part in system.parts]
        scales = _joined([part.scales for part in parts])
        given |= {name: cells.keep(np.zeros(scales.size)) for name in ("multipliers", "gap")}
        ends = np.cumsum([part.scales.size for part in parts], dtype=int)
        rows = [slice(end - part.scales.size, end) for part, end in zip(parts, ends, strict=True)]
        here = [call_graph_kernels.subsystem.v for call_graph_kernels in parts]

        def written(section: str, ask) -> tuple[Vector, Vector]:
            """Write a section; what it finds along rates (n_v,), and row by row."""
            cells.section(section)
            found = [ask(call_graph_kernels, v, own) for call_graph_kernels, v, own in zip(parts, here, rows, strict=True)]
            whole = np.zeros(system.n_v).astype(object)
            for v, (along, _) in zip(here, found, strict=True):
                whole[v] = along
            return Vector(whole), Vector(_joined([across for _, across in found]))

        effort, multipliers, rates = given["effort"], given["multipliers"], given["rates"]
        self._found = {
            "motion": written("motion", lambda part, v, own: part.motion(effort[v], multipliers[own], still=False)),
            "response": written("response", lambda part, v, own: part.motion(effort[v], multipliers[own], still=True)),
            "residual": written("residual", lambda part, v, own: part.residual(rates[v], multipliers[own], effort[v])),
            "slip": written("slip", lambda part, v, own: part.slip()),
            "closure": written("closure", lambda part, v, own: part.closure()[::-1]),
        }
        self._met = {}
        for section, mu in (("multipliers", MU), ("damped", DAMPED)):
            cells.section(section)
            found = [part.multipliers(given["gap"][own], mu) for part, own in zip(parts, rows, strict=True)]
            self._met[section] = Vector(_joined(found))
        self._scales, self._sizes = Vector(scales), loop_constraint_scales(system)
        self._given = {name: Vector(places) for name, places in given.items()}
        self._memory = cells.compiled()

    def refined(self, inputs: np.ndarray, loads=()) -> np.ndarray:
        """(q, v, τ, t) → as :meth:`gauss.dynamics.traced_system.Program.refined`, under loads that are called."""
        q, v, effort, (t,) = np.split(inputs, np.cumsum([self.system.n_q, self.system.n_v, self.system.n_v]))
        effort = effort + Applied(Kinematics(self.system, State(t, q, v)), loads).P
        with self._lock:
            self._at(q, v)
            found, multipliers, _ = self._held("motion", effort, 0.0)
            change, _, left = self._held("response", *self._lacking(found, multipliers, effort, 0.0))
            left, gap = left / self._scales.read(self._memory) / self._sizes, self._gap(v)
        lacking = np.abs(change / self.system.scale.coordinates).max() + np.abs(left).max(initial=0.0)
        error = self._share(lacking, found)
        return np.concatenate([found + change, [error, gap, np.abs(inputs).sum()]])

    def forward(self, inputs: np.ndarray) -> np.ndarray:
        """(t, q, v, generalised forces) → (q̈, no power)."""
        q, v, effort = np.split(inputs[1:], np.cumsum([self.system.n_q, self.system.n_v]))
        with self._lock:
            self._at(q, v)
            target, along = self._pull(v)
            found, _, _ = self._held("motion", effort, target)
        return np.concatenate([found + along, np.zeros(3)])

    def check(self, inputs: np.ndarray) -> np.ndarray:
        """(point, generalised forces) → error of the accelerations of the point.

        Rows below √MU hold so little that accelerations along them are not determined: what these lack does not count.
        """
        n_q, n_v = self.system.n_q, self.system.n_v
        q, v, _, found, _, effort = np.split(inputs[1:], np.cumsum([n_q, n_v, 3, n_v, 3]))
        with self._lock:
            self._at(q, v)
            target, along = self._pull(v)
            _, multipliers, _ = self._held("motion", effort, target)
            lacking, gap = self._lacking(found - along, multipliers, effort, target)
            for _ in range(2):
                gap = gap - DAMPED * self._multipliers("damped", gap)
            change, _, _ = self._held("response", lacking, gap)
        return np.array([self._share(np.abs(change / self.system.scale.coordinates).max(), found)])

    def settle(self, inputs: np.ndarray) -> np.ndarray:
        """(t, q, v) → (q and v on the constraints, gap that is left), moved in the mass metric as little as needed."""
        q, v = np.split(inputs[1:], [self.system.n_q])
        with self._lock:
            self._at(q, v)
            (slack, gap), last = self._run("closure"), np.inf
            for _ in range(STEPS):
                step, _, _ = self._held("response", np.zeros_like(v), -self._scales.read(self._memory) * gap, rounds=1)
                q = retract(self.system, q, step + slack)
                self._given["q"].write(self._memory, q)
                slack, gap = self._run("closure")
                size = self._size(slack, gap)
                if not CLOSED < size < last / 2:
                    break
                last = size
            self._at(q, v)
            followed, slip = self._run("slip")
            change, _, _ = self._held("response", np.zeros_like(v), -slip)
        return np.concatenate([q, followed + change, [size]])

    def _at(self, q, v):
        """Factor everything in a state."""
        self._given["q"].write(self._memory, q)
        self._given["v"].write(self._memory, v)
        self._memory.run("factor")

    def _run(self, section: str) -> tuple[np.ndarray, np.ndarray]:
        self._memory.run(section)
        return tuple(vector.read(self._memory) for vector in self._found[section])

    def _pull(self, v):
        """What draws the state back to the constraints: right sides of the scaled rows, and along closing joints (n_v,)."""
        if self.gains is None:
            return 0.0, 0.0
        alpha, beta = self.gains
        (slack, gap), (followed, slip) = self._run("closure"), self._run("slip")
        rows = -2.0 * alpha * slip - beta**2 * self._scales.read(self._memory) * gap
        return rows, beta**2 * slack + 2.0 * alpha * (followed - v)

    def _held(self, section: str, effort, target, rounds: int = ROUNDS):
        """Motion under forces whose scaled rows are set to a target, in rounds: accelerations, multipliers, what is left."""
        given = self._given
        given["effort"].write(self._memory, effort)
        multipliers, last = np.zeros(self._scales.constants.size), np.inf
        given["multipliers"].write(self._memory, multipliers)
        rates, rows = self._run(section)
        for done in range(1, rounds + 1):
            multipliers = multipliers + self._multipliers("multipliers", rows - target)
            given["multipliers"].write(self._memory, multipliers)
            before, (rates, rows) = rates, self._run(section)
            change = np.abs(rates - before).max()
            if not change > MET * np.abs(rates).max() or (done >= PLAIN and change > LIVE * last):
                break
            last = change
        return rates, multipliers, rows - target

    def _multipliers(self, section: str, gap) -> np.ndarray:
        self._given["gap"].write(self._memory, gap)
        self._memory.run(section)
        return self._met[section].read(self._memory)

    def _lacking(self, found, multipliers, effort, target):
        """What the equations of motion (n_v,) and the scaled rows lack, by inverse dynamics."""
        for name, numbers in (("rates", found), ("multipliers", multipliers), ("effort", effort)):
            self._given[name].write(self._memory, numbers)
        lacking, rows = self._run("residual")
        return lacking, target - rows

    def _gap(self, v) -> float:
        """By how much the state is off its constraints."""
        slack, gap = self._run("closure")
        followed, slip = self._run("slip")
        scale = self.system.scale
        q = self._given["q"].read(self._memory)
        units = sum(abs(q[place] @ q[place] - 1.0) for place in self.system.quaternions.values())
        off = np.concatenate([(followed - v) / scale.coordinates, slip / self._scales.read(self._memory) / self._sizes])
        return units + max(self._size(slack, gap), np.abs(off).max() / scale.fastest(v))

    def _size(self, slack, gap) -> float:
        """Largest of what closing joints are off along free axes (n_v,) and of residuals of the rows, beside their sizes."""
        return float(np.abs(np.concatenate([slack / self.system.scale.coordinates, gap / self._sizes])).max())

    def _share(self, change: float, found) -> float:
        return change / max(np.abs(found / self.system.scale.coordinates).max(), acceleration_scale(self.system))


def call_graph_kernels(system: System, gains: tuple[float, float] | None = None) -> CallGraphKernels:
    """Machine code of a large scene with loops, made when it is first asked for; gains as for :class:`CallGraphKernels`."""
    return system.dynamics.on_demand((CallGraphKernels, gains), lambda: CallGraphKernels(system, gains))


def _joined(parts) -> np.ndarray:
    return np.concatenate([np.zeros(0, dtype=object), *parts])
