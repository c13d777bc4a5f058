"""Stabilised index-2 equations for DAE solvers of other libraries: F(t, y, ẏ) = 0, y = (q, rates, work, μ, λ).

q̇ = rates with v − Kᵀ μ,  M v̇ = f − Kᵀ λ,  K v = C,  g(q) = 0; the multipliers μ vanish in the exact motion
(Gear, Gupta, Leimkuhler, J. Comput. Appl. Math. 12–13, 1985; Hairer and Wanner, Solving ODEs II, VII.1).
"""

from dataclasses import replace

import numpy as np

from gauss.codegen import Kernel, write
from gauss.dynamics.traced_system import Program
from gauss.integrators import Library, LibrarySolution
from gauss.simulation.compiled_steps.momentum_form import MomentumForm
from gauss.system import State, coordinate_rates

MULTIPLIER_TOLERANCE = 1e10  # absolute: multipliers have no error control


class ResidualEquations:
    """Residual F of one system as machine code; SimulationError if a constraint binds velocities only."""

    def __init__(self, program: Program):
        self.mechanics, self.system = MomentumForm(program), program.system
        self.spread, m, system = self.mechanics.spread, self.mechanics.n_constraints, program.system
        self.share, self.sizes = np.sum(self.spread**2, axis=0), (system.n_q, self.spread.shape[1], 3, m, m)
        self.states = Kernel(write(self._state, 1, system.n_q, self.sizes[1], name="state"), batch=False)
        sizes = (1, *self.sizes, *self.sizes[:3])
        self.residual = Kernel(write(self._residual, *sizes, name="residual"), batch=False)

    def _state(self, t, q, u):
        unit = q.copy()
        for place in self.system.quaternions.values():
            unit[place] = q[place] / np.sqrt(q[place] @ q[place])
        state = self.mechanics.tracked(t[0], unit, np.zeros(self.system.n_v), self.spread @ u)
        return state.q, state.v

    def _residual(self, t, q, u, work, mu, multipliers, dq, du, dwork):
        mechanics, still, n_q = self.mechanics, np.zeros(self.system.n_v), self.system.n_q
        both = np.concatenate(self._state(t, q, u))
        state = State(t[0], both[:n_q], both[n_q:])
        acceleration = self.spread @ du
        motion, violation = mechanics.residual(t[0], state.q, still, state.v, acceleration, multipliers)
        pull = mechanics.reaction(t[0], state.q, still, mu)[0] if mu.size else still
        moving = coordinate_rates(self.system, state.q, state.v + self.spread @ (self.spread.T @ pull / self.share))
        velocity = mechanics.velocity_violation(t[0], state.q, still, state.v)
        return dq - moving, self.spread.T @ motion, dwork - mechanics.evaluate(state).power, velocity, violation

    def by(self, method: Library) -> Library:
        """The method as one for y = (q, v, work), like all others."""
        return replace(method, solve=lambda *given: self._solve(method, *given))

    def _solve(self, method: Library, derivative, times, y0, rtol, atol, largest) -> LibrarySolution:
        (n_q, n, _, m, _), n_v = self.sizes, self.system.n_v
        q, v, work = np.split(y0, [n_q, n_q + n_v])
        rates = derivative(times[0], y0)
        u, du = (self.spread.T @ part / self.share for part in (v, rates[n_q : n_q + n_v]))
        y, slopes = np.concatenate([q, u, work, np.zeros(2 * m)]), np.concatenate([rates[:n_q], du, rates[n_q + n_v :]])
        y[y.size - m :] = self._multipliers(times[0], y, slopes)
        coordinates, own, loose = np.split(atol, [n_q, n_q + n_v])
        allowed = np.concatenate(
            [coordinates, np.abs(self.spread).T @ own / self.share, loose, np.full(2 * m, MULTIPLIER_TOLERANCE)]
        )
        known = len(slopes)

        def residual(t, y, dy, out):
            out[:] = self.residual(np.concatenate([[t], y, dy[:known]]))

        slopes = np.concatenate([slopes, np.zeros(2 * m)])
        found = method.solve(residual, times, (y, slopes), rtol, allowed, largest, np.arange(known, known + 2 * m))
        rows = []
        for t, row in zip(found.t, found.y, strict=True):
            rows.append(np.concatenate([self.states(np.concatenate([[t], row[: n_q + n]])), row[n_q + n : known]]))
        return found._replace(y=np.array(rows))

    def _multipliers(self, t: float, y: np.ndarray, slopes: np.ndarray) -> np.ndarray:
        """Multipliers (m,) at the start: the equations of motion are linear in them."""
        n_q, n, _, m, _ = self.sizes

        def residual(multipliers):
            given = np.concatenate([[t], y[: y.size - m], multipliers, slopes])
            return self.residual(given)[n_q : n_q + n]

        begin = residual(np.zeros(m))
        columns = np.array([residual(unit) - begin for unit in np.eye(m)]).reshape(m, n).T
        return np.linalg.lstsq(columns, -begin, rcond=None)[0]
