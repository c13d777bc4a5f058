"""Machine code of a large scene with loops: a call graph of kernels, with proximal iterations for the multipliers."""

from threading import Lock

import numpy as np

from gauss.codegen.kernels import CallRecorder, Vector
from gauss.dynamics.call_graph import DAMPED, CallGraph
from gauss.dynamics.constrained_aba import MU
from gauss.dynamics.error_scale import acceleration_scale
from gauss.dynamics.load_forces import LoadForces
from gauss.dynamics.mechanism import loop_constraint_scales
from gauss.dynamics.projection import RESIDUAL_ROUNDOFF
from gauss.dynamics.store import cached
from gauss.system import State, System, retract

MOST_ITERATIONS = 6  # of the proximal method
LEAST_ITERATIONS = 3  # of it, as many as straight-line code takes
CONTRACTION = 0.1  # of an iteration: above, further ones only amplify a near-null constraint direction
CONVERGED = 1e-15  # change of accelerations relative to the largest, the round-off
MOST_NEWTON_STEPS = 4  # in position after an integration step, on one factorisation


class CallGraphKernels:
    """Forward dynamics, their check and projection, called as :class:`gauss.dynamics.traced_system.Kernels` are.

    Parameters
    ----------
    system : System
        One with loops, without couplings and relations.
    gains : tuple of float, optional
        Gains α and β [1/s] of the Baumgarte feedback −2α φ̇ − β² φ.
    """

    def __init__(self, system: System, gains: tuple[float, float] | None = None):
        self.system, self.gains, self._lock, recorder = system, gains, Lock(), CallRecorder()
        sizes = {"q": system.n_q, "v": system.n_v, "effort": system.n_v, "rates": system.n_v}
        given = {name: recorder.keep(np.zeros(size)) for name, size in sizes.items()}
        graphs = [CallGraph(one, recorder, given["q"][one.q], given["v"][one.v]) for one in system.subsystems]
        scales = _joined([graph.scales for graph in graphs])
        given |= {name: recorder.keep(np.zeros(scales.size)) for name in ("multipliers", "gap")}
        ends = np.cumsum([graph.scales.size for graph in graphs], dtype=int)
        rows = [slice(end - graph.scales.size, end) for graph, end in zip(graphs, ends, strict=True)]
        here = [graph.subsystem.v for graph in graphs]

        def written(section: str, ask) -> tuple[Vector, Vector]:
            """Record a section; its results along rates (n_v,), and by row."""
            recorder.section(section)
            found = [ask(graph, v, own) for graph, v, own in zip(graphs, here, rows, strict=True)]
            whole = np.zeros(system.n_v).astype(object)
            for v, (along, _) in zip(here, found, strict=True):
                whole[v] = along
            return Vector(whole), Vector(_joined([across for _, across in found]))

        tau, multipliers, rates = given["effort"], given["multipliers"], given["rates"]
        self._found = {
            "motion": written("motion", lambda graph, v, own: graph.motion(tau[v], multipliers[own], still=False)),
            "response": written("response", lambda graph, v, own: graph.motion(tau[v], multipliers[own], still=True)),
            "residual": written("residual", lambda graph, v, own: graph.residual(rates[v], multipliers[own], tau[v])),
            "slip": written("slip", lambda graph, v, own: graph.velocity_residual()),
            "closure": written("closure", lambda graph, v, own: graph.loop_residual()[::-1]),
        }
        self._solved = {}
        for section, mu in (("multipliers", MU), ("damped", DAMPED)):
            recorder.section(section)
            found = [graph.multipliers(given["gap"][own], mu) for graph, own in zip(graphs, rows, strict=True)]
            self._solved[section] = Vector(_joined(found))
        self._scales, self._sizes = Vector(scales), loop_constraint_scales(system)
        self._given = {name: Vector(places) for name, places in given.items()}
        self._memory = recorder.compiled()

    def refined(self, inputs: np.ndarray, loads: LoadForces | None = None) -> np.ndarray:
        """(q, v, τ, t) → as :func:`gauss.dynamics.traced_refinement.refined_once`, under loads."""
        q, v, effort, (t,) = np.split(inputs, np.cumsum([self.system.n_q, self.system.n_v, self.system.n_v]))
        effort = effort if loads is None else effort + loads(State(t, q, v))[0]
        with self._lock:
            self._at(q, v)
            found, multipliers, _ = self._constrained("motion", effort, 0.0)
            change, _, left = self._constrained("response", *self._residual(found, multipliers, effort, 0.0))
            left, residual = left / self._scales.read(self._memory) / self._sizes, self._state_residual(v)
        size = np.abs(change / self.system.scale.coordinates).max() + np.abs(left).max(initial=0.0)
        return np.concatenate([found + change, [self._relative(size, found), residual, np.abs(inputs).sum()]])

    def forward(self, inputs: np.ndarray) -> np.ndarray:
        """(t, q, v, generalised forces) → (q̈, no power)."""
        q, v, effort = np.split(inputs[1:], np.cumsum([self.system.n_q, self.system.n_v]))
        with self._lock:
            self._at(q, v)
            target, along = self._feedback(v)
            found, _, _ = self._constrained("motion", effort, target)
        return np.concatenate([found + along, np.zeros(3)])

    def check(self, inputs: np.ndarray) -> np.ndarray:
        """(point, generalised forces) → error of the accelerations of the point.

        Along rows with pivots below √MU accelerations are undetermined: their part of the residual is damped.
        """
        n_q, n_v = self.system.n_q, self.system.n_v
        q, v, _, found, _, effort = np.split(inputs[1:], np.cumsum([n_q, n_v, 3, n_v, 3]))
        with self._lock:
            self._at(q, v)
            target, along = self._feedback(v)
            _, multipliers, _ = self._constrained("motion", effort, target)
            residual, rows = self._residual(found - along, multipliers, effort, target)
            for _ in range(2):
                rows = rows - DAMPED * self._multipliers("damped", rows)
            change, _, _ = self._constrained("response", residual, rows)
        return np.array([self._relative(np.abs(change / self.system.scale.coordinates).max(), found)])

    def project(self, inputs: np.ndarray) -> np.ndarray:
        """(t, q, v) → (q and v on the constraints, position residual), by least changes in the mass metric."""
        q, v = np.split(inputs[1:], [self.system.n_q])
        with self._lock:
            self._at(q, v)
            (slack, phi), last = self._run("closure"), np.inf
            for _ in range(MOST_NEWTON_STEPS):
                target = -self._scales.read(self._memory) * phi
                step, _, _ = self._constrained("response", np.zeros_like(v), target, iterations=1)
                q = retract(self.system, q, step + slack)
                self._given["q"].write(self._memory, q)
                slack, phi = self._run("closure")
                size = self._size(slack, phi)
                if not RESIDUAL_ROUNDOFF < size < last / 2:
                    break
                last = size
            self._at(q, v)
            dependent, residual = self._run("slip")
            change, _, _ = self._constrained("response", np.zeros_like(v), -residual)
        return np.concatenate([q, dependent + change, [size]])

    def _at(self, q, v):
        """Set a state, and factor there."""
        self._given["q"].write(self._memory, q)
        self._given["v"].write(self._memory, v)
        self._memory.run("factor")

    def _run(self, section: str) -> tuple[np.ndarray, np.ndarray]:
        self._memory.run(section)
        along, across = self._found[section]
        return along.read(self._memory), across.read(self._memory)

    def _feedback(self, v):
        """Baumgarte feedback: targets of the scaled rows, and accelerations along loop joints (n_v,)."""
        if self.gains is None:
            return 0.0, 0.0
        alpha, beta = self.gains
        (slack, phi), (dependent, residual) = self._run("closure"), self._run("slip")
        rows = -2.0 * alpha * residual - beta**2 * self._scales.read(self._memory) * phi
        return rows, beta**2 * slack + 2.0 * alpha * (dependent - v)

    def _constrained(self, section: str, effort, target, iterations: int = MOST_ITERATIONS):
        """Accelerations, multipliers and residual under forces, with a target of the scaled rows, by proximal iterations."""
        given = self._given
        given["effort"].write(self._memory, effort)
        multipliers, last = np.zeros(self._scales.constants.size), np.inf
        given["multipliers"].write(self._memory, multipliers)
        rates, rows = self._run(section)
        for done in range(1, iterations + 1):
            multipliers = multipliers + self._multipliers("multipliers", rows - target)
            given["multipliers"].write(self._memory, multipliers)
            before, (rates, rows) = rates, self._run(section)
            change = np.abs(rates - before).max()
            if not change > CONVERGED * np.abs(rates).max() or (done >= LEAST_ITERATIONS and change > CONTRACTION * last):
                break
            last = change
        return rates, multipliers, rows - target

    def _multipliers(self, section: str, residual) -> np.ndarray:
        self._given["gap"].write(self._memory, residual)
        self._memory.run(section)
        return self._solved[section].read(self._memory)

    def _residual(self, found, multipliers, effort, target):
        """Residuals of the equations of motion (n_v,), by inverse dynamics, and of the scaled rows."""
        for name, numbers in (("rates", found), ("multipliers", multipliers), ("effort", effort)):
            self._given[name].write(self._memory, numbers)
        residual, rows = self._run("residual")
        return residual, target - rows

    def _state_residual(self, v) -> float:
        """Constraint residual of the state, in position and velocity, relative."""
        slack, phi = self._run("closure")
        dependent, residual = self._run("slip")
        scale = self.system.scale
        q = self._given["q"].read(self._memory)
        units = sum(abs(q[place] @ q[place] - 1.0) for place in self.system.quaternions.values())
        off = np.concatenate([(dependent - v) / scale.coordinates, residual / self._scales.read(self._memory) / self._sizes])
        return units + max(self._size(slack, phi), np.abs(off).max() / scale.fastest(v))

    def _size(self, slack, phi) -> float:
        """Largest error of the coordinates of loop joints (n_v,) and position residual, relative to their scales."""
        return float(np.abs(np.concatenate([slack / self.system.scale.coordinates, phi / self._sizes])).max())

    def _relative(self, change: float, found) -> float:
        return change / max(np.abs(found / self.system.scale.coordinates).max(), acceleration_scale(self.system))


def call_graph_kernels(system: System, gains: tuple[float, float] | None = None) -> CallGraphKernels:
    """Machine code of a large scene with loops, made on first request; gains as of :class:`CallGraphKernels`."""
    return cached(system, (CallGraphKernels, gains), lambda: CallGraphKernels(system, gains))


def _joined(parts) -> np.ndarray:
    return np.concatenate([np.zeros(0, dtype=object), *parts])
