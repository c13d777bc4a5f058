"""Independent coordinates of a system in one state: tangents of its positions and of its rates.

Displacements ξ along the rates keep the position constraints to first order if J ξ = 0, and changes δv of the rates keep the
velocity constraints g(q, v) = 0 if G δv + (∂g/∂q) ξ = 0. With displacements y of independent coordinates and changes w of
independent rates,

    ξ = N_q y,    δv = N_v w + D y,

rows of N_q and N_v at the independent ones being those of the unit matrix, and rows of D there zero. Constraints that bind
rates alone (rolling) leave more of y than of w. Displacements of a quaternion turn with the body, so that
dξ/dt = δv + Γ ξ with Γ = −[ω]× of its joint.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gauss.codegen import Kernel, forward, write
from gauss.dynamics.conditions import refuse_motionless
from gauss.dynamics.mechanism import Mechanism, loop_residual
from gauss.dynamics.null_space import RowSpace
from gauss.dynamics.projection import position_residual_of, relative
from gauss.dynamics.store import cached
from gauss.system import State, System, coordinate_rates, whole


@dataclass(frozen=True)
class Tangents:
    """Tangents of one system in one state that meets its constraints.

    SimulationError if nothing in the system can move.
    """

    system: System
    state: State
    held: tuple[int, ...] = ()  # places of rates that are kept at their values

    def __post_init__(self):
        """Refuse systems without tangents."""
        refuse_motionless(self.system, "independent coordinates")

    @cached_property
    def position(self) -> np.ndarray:
        """N_q (n_v, k)."""
        return RowSpace(self.position_rows, self._units, self._residual, self.held).null_space

    @cached_property
    def position_rows(self) -> np.ndarray:
        """J (m, n_v)."""
        return self._slopes(np.eye(self.system.n_v), None)[0]

    @cached_property
    def rate(self) -> np.ndarray:
        """N_v (n_v, l)."""
        return RowSpace(self._rate_rows, self._units, self._residual, self.held).null_space

    @cached_property
    def change(self) -> np.ndarray:
        """D (n_v, k): changes of the rates that displacements alone ask for."""
        rows = self._slopes(self.position, None)[1]
        fixed = np.eye(self.system.n_v)[[*self.independent_rates, *self.held]]
        whole, right = (
            np.concatenate([self._rate_rows, fixed]),
            np.concatenate([-rows, np.zeros((len(fixed), rows.shape[1]))]),
        )
        return np.linalg.lstsq(whole, right, rcond=None)[0]

    @cached_property
    def of_states(self) -> np.ndarray:
        """Changes (n_q + n_v, k + l) of (q, v) by independent displacements, then by changes of independent rates."""
        N, rate, n_q = self.position, self.rate, self.system.n_q
        moved = np.array([coordinate_rates(self.system, self.state.q, column) for column in N.T]).reshape(-1, n_q).T
        return np.block([[moved, np.zeros((n_q, rate.shape[1]))], [self.change, rate]])

    @cached_property
    def turning(self) -> np.ndarray:
        """Γ (n_v, n_v)."""
        n, v = self.system.n_v, self.state.v
        T = self._slopes(None, np.eye(n))[2]
        along = self._slopes(np.eye(n), None)[2]  # change of T v
        state, ones = self.state, np.eye(n)
        other = np.array(
            [_evaluated(self.system, State(state.t, state.q, unit), v[:, None], None)[2][:, 0] for unit in ones]
        ).T
        return np.linalg.lstsq(T, along - other, rcond=None)[0]

    @cached_property
    def independent_coordinates(self) -> list[int]:
        """Places of the independent displacements in v."""
        return _units_of(self.position)

    @cached_property
    def independent_rates(self) -> list[int]:
        """Places of the independent rates in v."""
        return _units_of(self.rate)

    @property
    def _units(self) -> np.ndarray:
        return self.system.scale.coordinates

    @cached_property
    def _residual(self) -> float:
        """Position residual of the state, in shares of the scales of the rows."""
        system = self.system
        return relative(system, position_residual_of(system, self.state)) if system.has_closures else 0.0

    @cached_property
    def _rate_rows(self) -> np.ndarray:
        """G (m, n_v)."""
        return self._slopes(None, np.eye(self.system.n_v))[1]

    def _slopes(self, along_q, along_v) -> list[np.ndarray]:
        return _evaluated(self.system, self.state, along_q, along_v)


def _evaluated(system: System, state: State, along_q, along_v) -> list[np.ndarray]:
    """Changes of position residuals, velocity residuals and rates of coordinates, a column for each direction."""
    kernel, ends = cached(system, (_evaluated,), lambda: _kernel(system))
    count = (along_q if along_v is None else along_v).shape[1]
    zeros = np.zeros((system.n_v, count))
    given = np.concatenate([[state.t], state.q, state.v])
    directions = [zeros if part is None else part for part in (along_q, along_v)]
    return np.split(kernel(np.concatenate([np.tile(given[:, None], count), *directions])), ends)


def constraint_residuals(system: System, t, q, v) -> tuple[np.ndarray, np.ndarray]:
    """Residuals of positions and of rates, those of the coordinates and rates of loop joints included."""
    unreduced = (whole(system),)
    mechanism = Mechanism(system, q, v, t, unreduced)
    held, slack = loop_residual(system, q, t, unreduced)
    positions = np.concatenate([held, *(part for parts in slack for part in parts)])
    return positions, np.concatenate([mechanism.velocity_residual(), mechanism.dependent_rates() - v])


def _kernel(system: System) -> tuple[Kernel, np.ndarray]:
    """(t, q, v, displacements, changes of rates) → changes of residuals and of rates of coordinates."""
    sizes = list[int]()

    def slopes(t, q, v, along_q, along_v):
        residuals = [*constraint_residuals(system, t[0], q, v), coordinate_rates(system, q, v)]
        sizes[:] = [part.size for part in residuals]
        direction = np.concatenate([coordinate_rates(system, q, along_q), along_v])
        return forward(np.concatenate(residuals), np.concatenate([q, v]), direction)

    function = write(slopes, 1, system.n_q, system.n_v, system.n_v, system.n_v, name="tangents")
    return Kernel(function, batch=False), np.cumsum(sizes[:-1])


def _units_of(N: np.ndarray) -> list[int]:
    """Places of the rows of the unit matrix in a basis."""
    return [int(np.flatnonzero((N == unit).all(axis=1))[0]) for unit in np.eye(N.shape[1])]
