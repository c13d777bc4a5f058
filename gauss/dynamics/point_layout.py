"""Vector of a point of a motion: (t, q, v, work, q̈, power, method state, parameters).

A state, the work up to it, the rates there, the state of the method, and, for a parametrised system, its parameters.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gauss.codegen import Expression
from gauss.integrators import Point, Rates
from gauss.system import State


@dataclass(frozen=True)
class PointLayout:
    """Places of the parts of a point in its vector."""

    n_q: int  # n_q, n_v: numbers of coordinates and rates
    n_v: int
    memory: int = 0  # numbers of the state of the method
    parameters: tuple[str, ...] = ()  # parameters of the system

    @cached_property
    def row(self) -> int:
        """Numbers of (t, q, v, work)."""
        return 1 + self.n_q + self.n_v + 3

    @cached_property
    def size(self) -> int:
        """Numbers of a point."""
        return self.row + self.n_v + 3 + self.memory + len(self.parameters)

    @property
    def n_y(self) -> int:
        """Numbers of y."""
        return 2 * self.n_v + 3

    def pack(self, point: Point, parameters=None) -> np.ndarray:
        """Vector of a point; its parameters are those of the graph that it is traced in, unless they are given."""
        state = point.state
        memory = point.rates.acceleration if point.method_state is None else point.method_state
        parts: list = [[state.t], state.q, state.v, point.work, *point.rates, memory[: self.memory]]
        if parameters is not None:
            parts.append(parameters)
        elif self.parameters:
            graph = next(entry.graph for part in parts for entry in part if isinstance(entry, Expression))
            parts.append([graph.parameter(name) for name in self.parameters])
        return np.concatenate(parts)

    def state(self, x: np.ndarray) -> State:
        """State in a vector; where it is traced, its parameters hold from then on."""
        if self.parameters and isinstance(x[0], Expression):
            x[0].graph.bind(self.parameters, x[self.size - len(self.parameters) : self.size])
        return State(x[0], x[1 : 1 + self.n_q], x[1 + self.n_q : 1 + self.n_q + self.n_v])

    def point(self, x: np.ndarray) -> Point:
        """Point in a vector."""
        _, acceleration, power, memory, _ = np.split(x, np.cumsum([self.row, self.n_v, 3, self.memory]))
        return Point(self.state(x), x[self.row - 3 : self.row], Rates(acceleration, power), memory)
