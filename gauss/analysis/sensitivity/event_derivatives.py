"""Derivatives of what an event is made of: gap functions, sliding rates, and the rates after an impact.

The rates after an impact are the nearest in the mass metric that meet the closed gaps with K v⁺ − C = −e (K v⁻ − C) and all
other constraints, whose residuals are zero before and after: one residual of all rows, times e.
"""

import numpy as np

from gauss.codegen import Kernel, forward, write
from gauss.dynamics.kinematics import kinematics
from gauss.dynamics.mechanism import Mechanism
from gauss.dynamics.parameter_terms import GRAVITY, OF_BODIES, OF_JOINTS, inverse_dynamics_by_parameter
from gauss.dynamics.store import cached_on_disk
from gauss.system import State, System, sides
from gauss.system.relations import place_residuals


class EventDerivatives:
    """Derivatives by (q, v) and by the time at one state of a system.

    Parameters
    ----------
    system : System
        The whole system, for gap functions, or a smooth one of closed gaps and sticking elements.
    """

    def __init__(self, system: System, state: State):
        self.system, self.state = system, state
        self.given = np.concatenate([[state.t], state.q, state.v])
        self.directions = np.eye(self.given.size)

    def gaps(self) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives (m, n_x) and (m,) of all gap functions."""
        watched = place_residuals(self.system, sides(self.system.scene))

        def changes(t, q, v, direction):
            widths, _ = np.split(np.array(watched.values(kinematics(self.system, State(t[0], q, v)))).reshape(-1), 2)
            return forward(widths, [*t, *q, *v], direction)

        return _by_state(self._along("gap changes", changes))

    def velocity_residuals(self) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives (m, n_x) and (m,) of the velocity residuals of all constraints."""

        def changes(t, q, v, direction):
            return forward(Mechanism(self.system, q, v, t[0]).velocity_residual(), [*t, *q, *v], direction)

        return _by_state(self._along("velocity residual changes", changes))

    def rates_after(self, restitution: float) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives (n_v, n_x) and (n_v,) of the rates after an impact of all rows that the rates do not meet."""

        def changes(t, q, v, e, direction):
            mechanism = Mechanism(self.system, q, v, t[0])
            target = mechanism.velocity_rhs - e[0] * mechanism.velocity_residual()
            return forward(mechanism.nearest(v, target), [*t, *q, *v], direction)

        return _by_state(self._along("impact changes", changes, [restitution]))

    def rates_after_by(self, parameters: dict[str, int], change: np.ndarray) -> np.ndarray:
        """Derivatives (n_v, n_p) of the rates after an impact that changes them by ``change``: −M⁻¹ (∂M/∂p) Δv on the rows.

        Inverse dynamics is affine in the accelerations, so that its derivatives at Δv less those at rest are (∂M/∂p) Δv.
        """
        system, n = self.system, self.system.n_v
        moved = [name for name in parameters if name != GRAVITY and name.partition(":")[0] in {**OF_BODIES, **OF_JOINTS}]
        found = np.zeros((n, sum(parameters.values())))
        if not moved:
            return found

        def columns(t, q, v, change):
            mechanism, still = Mechanism(system, q, v, t[0]), np.zeros(n)
            none = np.zeros(mechanism.velocity_residual().size)
            made = []
            for name in moved:
                at = lambda rates, name=name: inverse_dynamics_by_parameter(system, [], t[0], q, v, rates, name)  # noqa: E731
                made += [-mechanism.response(column, none)[0] for column in (at(change) - at(still)).T]
            return np.concatenate(made)

        kernel = self._kernel("impact by parameters", columns, n, key=tuple(moved))
        values = np.split(kernel(np.concatenate([self.given, change])), sum(parameters[name] for name in moved))
        ends = dict(zip(parameters, np.cumsum([0, *parameters.values()])[:-1], strict=True))
        places = [ends[name] + k for name in moved for k in range(parameters[name])]
        found[:, places] = np.array(values).T
        return found

    def _along(self, name: str, function, given=()) -> np.ndarray:
        """Changes along all directions, a column each."""
        count = self.directions.shape[1]
        kernel = self._kernel(name, function, *([len(given)] if given else []), count)
        fixed = np.concatenate([self.given, given])
        return kernel(np.concatenate([np.tile(fixed[:, None], count), self.directions]))

    def _kernel(self, name: str, function, *sizes: int, key=()) -> Kernel:
        """Machine code of a function of (t, q, v, …), kept with the system."""
        system = self.system
        make = lambda: Kernel(write(function, 1, system.n_q, system.n_v, *sizes, name=name), batch=False)  # noqa: E731
        return cached_on_disk(system, (EventDerivatives, name, *key), make)


def _by_state(changes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Derivatives by the state, and by the time."""
    return changes[:, 1:], changes[:, 0]
