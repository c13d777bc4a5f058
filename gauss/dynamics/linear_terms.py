"""Linear model of one state over symbols: δq̈ by displacements y and changes w of the rates of independent coordinates.

With the null space N of the constraints, displacements are ξ = N y and changes of rates δv = N w + D y, where D keeps the
velocity constraints g(q, v) = 0 at fixed independent rates: G D = −(∂g/∂q) N. Along these the accelerations change as in
:mod:`gauss.dynamics.acceleration_derivatives`; a column each, so that a loop with one freedom has two of them.
"""

from functools import cached_property

import numpy as np

from gauss.codegen import forward, write
from gauss.dynamics.acceleration_derivatives import LoadedMechanism
from gauss.dynamics.constrained_terms import ConstrainedTerms
from gauss.rotations import cross
from gauss.system import coordinate_rates


class LinearTerms:
    """Linear model of one system in one state.

    ``terms``: the system in the state, over symbols, with k independent coordinates. ``loads``: its loads, with traced laws.
    ``load`` (n_v,): generalised forces added to the loads.
    """

    def __init__(self, terms: ConstrainedTerms, loads, load):
        self.terms, self.loads, self.load = terms, loads, load
        self.system, self.q, self.v, self.t = terms.system, terms.q, terms.v, terms.t
        self.loaded = LoadedMechanism(self.system, loads, self.t, self.q, self.v, load)
        self.motion = self.loaded.motion()

    @property
    def is_tree(self) -> bool:
        """Whether all coordinates are independent."""
        return len(self.terms.independent) == self.system.n_v

    @cached_property
    def displacements(self) -> np.ndarray:
        """N (n_v, k)."""
        return np.eye(self.system.n_v)[:, self.terms.independent] if self.is_tree else self.terms.null_space

    @cached_property
    def rate_changes(self) -> np.ndarray:
        """D (n_v, k)."""
        N, mechanism, system = self.displacements, self.loaded.mechanism, self.system
        if self.is_tree:
            return np.zeros(N.shape)
        still = np.zeros(system.n_v)
        parts = mechanism.velocity_residual(), mechanism.dependent_rates() - self.v
        found = []
        for column in N.T:
            direction = np.concatenate([coordinate_rates(system, self.q, column), still])
            held, following = (forward(part, [*self.q, *self.v], direction) for part in parts)
            free = mechanism.response(still, -held)[0] + following
            found.append(free - N @ free[self.terms.independent])
        D = np.array(found).T
        D[self.terms.independent] = 0.0
        return D

    @cached_property
    def acceleration_changes(self) -> np.ndarray:
        """Changes (n_v, 2 k) of the accelerations by displacements, then by rates, of the independent coordinates."""
        system, N, D = self.system, self.displacements, self.rate_changes
        n, k, (rates, multipliers) = system.n_v, N.shape[1], self.motion
        m = multipliers.size

        def changes(t, q, v, load, rates, multipliers, N, D):
            """Changes with accelerations and multipliers as inputs, which are fixed."""
            inner, still = LoadedMechanism(system, self.loads, t[0], q, v, load), np.zeros(n)
            moved, turned = N.reshape(n, k), D.reshape(n, k)
            along = [*zip(moved.T, turned.T, strict=True), *((still, column) for column in moved.T)]
            return tuple(
                np.array(part, dtype=object).T for part in zip(*inner.changes(rates, multipliers, along), strict=True)
            )

        written = write(changes, 1, self.q.size, n, n, n, m, n * k, n * k, name="changes")
        table = written.inlined([self.t], self.q, self.v, self.load, rates, multipliers, N.ravel(), D.ravel())
        parts = np.split(table, np.cumsum([2 * n * k, 2 * m * k]))
        force, rows, following = (part.reshape(-1, 2 * k).T for part in parts)
        found = [
            self.loaded.mechanism.response(own, held)[0] + after
            for own, held, after in zip(force, rows, following, strict=True)
        ]
        return np.array(found).T

    def response(self, force) -> np.ndarray:
        """Change (n_v,) of the accelerations by generalised forces (n_v,)."""
        return self.loaded.mechanism.response(force, np.zeros(self.motion[1].size))[0]

    @cached_property
    def turning(self) -> np.ndarray:
        """Γ N (n_v, k) of dξ/dt = δv + Γ ξ: displacements of a quaternion turn with the body, Γ = −[ω]×."""
        found = np.zeros(self.displacements.shape, dtype=object)
        for joint in self.system.joints:
            if joint.pair.quaternion is not None:
                first = joint.v.start + joint.pair.quaternion
                place = slice(first, first + 3)
                found[place] = np.array([-cross(self.v[place], column) for column in self.displacements[place].T]).T
        return found

    @cached_property
    def by_state(self) -> np.ndarray:
        """Changes (3 n_v, 2 k) of displacements, rates and accelerations by displacements, then by rates."""
        N = self.displacements
        moved = np.concatenate([N, np.zeros(N.shape)], axis=1)
        return np.concatenate([moved, np.concatenate([self.rate_changes, N], axis=1), self.acceleration_changes])

    def by_forces(self, forces: np.ndarray) -> np.ndarray:
        """Changes (3 n_v, m) of displacements, rates and accelerations by generalised forces, a column (n_v, m) each."""
        n, m = forces.shape
        responses = np.array([self.response(column) for column in forces.T], dtype=object).reshape(m, n).T
        return np.concatenate([np.zeros((2 * n, m)), responses])

    def state_matrices(self, by_forces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """A (2k, 2k) and B (2k, m), with the changes of :meth:`by_forces`."""
        free, n = self.terms.independent, self.system.n_v
        k = len(free)
        positions = np.concatenate([self.turning[free], np.eye(k)], axis=1)
        rows = [2 * n + place for place in free]
        return np.concatenate([positions, self.by_state[rows]]), np.concatenate(
            [np.zeros((k, by_forces.shape[1])), by_forces[rows]]
        )

    def measured(self, sensor, changes: np.ndarray) -> np.ndarray:
        """Changes (p, c) of what is measured along changes (3 n_v, c) of displacements, rates and accelerations.

        ``sensor``: (t, q, v, accelerations) → values (p,).
        """
        n, count, size = self.system.n_v, changes.shape[1], 0
        along = [np.concatenate([coordinate_rates(self.system, self.q, one[:n]), one[n:]]) for one in changes.T]

        def slopes(t, q, v, accelerations, directions):
            nonlocal size
            values, given = sensor(t[0], q, v, accelerations), [*q, *v, *accelerations]
            size = len(values)
            return np.concatenate([forward(values, given, direction) for direction in directions.reshape(count, -1)])

        if not count:
            return np.zeros((len(sensor(self.t, self.q, self.v, self.motion[0])), 0))
        given = np.concatenate(along)
        written = write(slopes, 1, self.q.size, n, n, given.size, name="outputs")
        return written.inlined([self.t], self.q, self.v, self.motion[0], given).reshape(count, size).T
