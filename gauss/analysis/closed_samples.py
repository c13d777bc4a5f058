"""Poses of loops for many samples of independent coordinates at once: Newton's method on φ(q) = 0, in compiled batches.

The samples start in one pose and go to their values in equal parts of the way, so that all of them stay on its branch.
"""

import numpy as np

from gauss.analysis.tangents import constraint_residuals
from gauss.codegen import Kernel, forward, write
from gauss.dynamics.store import cached
from gauss.system import State, System, coordinate_rates, retract

PARTS = 6  # of the way
NEWTON_STEPS = 8  # in each part, at most
CLOSED = 1e-9  # residual of a closed pose, in the unit of the scene; smaller singular values are zero
ON_THE_WAY = 1e-2  # residual that is left at the end of a part
ROUNDOFF = 1e-13  # residual at which the last part ends
LONGEST_STEP = 0.5  # in units of the coordinates


class ClosedSamples:
    """Poses of one system near its start.

    Parameters
    ----------
    system : System
        System with loops.
    start : State
        State that meets the constraints.
    places : sequence of int
        Places in v of the independent coordinates, which are no rotations about any axis.
    """

    def __init__(self, system: System, start: State, places):
        self.system, self.start, self.places = system, start, list(places)
        self.free = [k for k in range(system.n_v) if k not in self.places]
        self.entries = [system.entry(system.coordinates[k]) for k in self.places]
        self.residual, self.slopes = cached(system, (ClosedSamples,), lambda: _kernels(system))

    def poses(self, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Coordinates (k, n_q) of samples (k, n) of the independent ones, and whether each is closed (k,)."""
        q = np.tile(self.start.q, (len(y), 1))
        way = y - q[:, self.entries]
        first = q[:, self.entries]
        for part in np.linspace(0.0, 1.0, PARTS + 1)[1:]:
            q[:, self.entries] = first + part * way
            bound = ROUNDOFF if part == 1.0 else ON_THE_WAY
            for _ in range(NEWTON_STEPS):
                residual = self._residuals(q)
                if np.abs(residual).max() <= bound * self._unit:
                    break
                q = self._corrected(q, residual)
        return q, np.abs(self._residuals(q)).max(axis=0) <= CLOSED * self._unit

    @property
    def _unit(self) -> float:
        """Unit of the residuals, lengths and angles."""
        return min(self.system.scale.length, 1.0)

    def _residuals(self, q: np.ndarray) -> np.ndarray:
        """Residuals (m, k) of the positions."""
        return self.residual(np.concatenate([np.full((1, len(q)), self.start.t), q.T]))

    def _corrected(self, q: np.ndarray, residual: np.ndarray) -> np.ndarray:
        """Poses after a step of the dependent coordinates, the least in their units."""
        count, free, units = len(q), len(self.free), self.system.scale.coordinates[self.free]
        given = np.concatenate([np.full((1, count), self.start.t), q.T])
        directions = np.tile(np.eye(self.system.n_v)[self.free].T, count)
        J = self.slopes(np.concatenate([np.repeat(given, free, axis=1), directions]))
        J = np.moveaxis(J.reshape(len(J), count, free), 0, 1) * units
        step = -np.einsum("kij,kj->ki", np.linalg.pinv(J, rcond=CLOSED), residual.T)
        longest = np.maximum(np.abs(step).max(axis=1, initial=0.0) / LONGEST_STEP, 1.0)
        change = np.zeros((count, self.system.n_v))
        change[:, self.free] = units * step / longest[:, None]
        if self.system.n_q == self.system.n_v:
            return q + change
        return np.array([retract(self.system, *pair) for pair in zip(q, change, strict=True)])


def _kernels(system: System) -> tuple[Kernel, Kernel]:
    """(t, q) → position residuals, and (t, q, displacement) → their changes, a column for each sample."""

    def residual(t, q):
        return constraint_residuals(system, t[0], q, np.zeros(system.n_v))[0]

    def change(t, q, along):
        return forward(residual(t, q), q, coordinate_rates(system, q, along))

    sizes = 1, system.n_q
    return (
        Kernel(write(residual, *sizes, name="residuals"), batch=False),
        Kernel(write(change, *sizes, system.n_v, name="changes of residuals"), batch=False),
    )
