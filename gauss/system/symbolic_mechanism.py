"""A view of the mechanism by symbols, with which constraints are traced."""

import numpy as np

from gauss.codegen import Graph
from gauss.rotations import skew
from gauss.system.state import View


class Symbols(View):
    """Bodies and joints as independent symbols, each made on first access."""

    def __init__(self, system, graph: Graph):
        self.system, self.graph, self.time = system, graph, graph.symbol("t")
        self.bodies: dict[int, tuple] = {}
        self.joints: dict[int, tuple] = {}
        self.R, self.x, self.W, self.u = (_OfBodies(self, k) for k in range(4))

    @property
    def t(self):
        """Symbol of time."""
        return self.time

    def coordinates_of(self, joint) -> np.ndarray:
        """Symbols of the coordinates of a placed joint."""
        return self.joint(joint)[0]

    def rates_of(self, joint) -> np.ndarray:
        """Symbols of the rates of a placed joint."""
        return self.joint(joint)[1]

    def body(self, index: int) -> tuple:
        """Symbols R, x, W, u of a body; constants for the ground."""
        if index < 0:
            return np.eye(3), np.zeros(3), np.zeros(3), np.zeros(3)
        if index not in self.bodies:
            sizes = {"R": 9, "x": 3, "W": 3, "u": 3}
            R, *vectors = (self.graph.symbols(f"{name}{index}", size) for name, size in sizes.items())
            self.bodies[index] = (R.reshape(3, 3), *vectors)
        return self.bodies[index]

    def joint(self, placed) -> tuple:
        """Symbols q, q̇ of a placed joint."""
        index = next(i for i, joint in enumerate(self.system.joints) if joint is placed)
        if index not in self.joints:
            q, v = self.graph.symbols(f"q{index}", placed.pair.n_q), self.graph.symbols(f"v{index}", placed.pair.n_v)
            self.joints[index] = q, v
        return self.joints[index]

    def motion(self):
        """Symbols that depend on time, and their rates without accelerations."""
        moving, rates = [self.time], [1.0]
        for R, x, W, u in self.bodies.values():
            moving += [*R.ravel(), *x]
            rates += [*(skew(W) @ R).ravel(), *u]
        for index, (q, v) in self.joints.items():
            moving += list(q)
            rates += list(self.system.joints[index].pair.coordinate_rate(q, v))
        return moving, rates

    def residuals(self, relation) -> tuple[np.ndarray, np.ndarray]:
        """Position and velocity residuals of a relation as expressions."""
        found = relation.positions(self), relation.velocities(self)
        c, g = (np.array([*part, None], dtype=object)[:-1] for part in found)  # numbers beside expressions stay as they are
        return c, g

    def velocities(self) -> list:
        """Symbols of all velocities."""
        parts = [part for _, _, W, u in self.bodies.values() for part in (W, u)]
        return [symbol for part in (*parts, *(v for _, v in self.joints.values())) for symbol in part]


def symbols_of(bodies: dict, joints: dict, clock) -> list:
    """Symbols of bodies and joints of a view, and the time."""
    found = [symbol for parts in bodies.values() for part in parts for symbol in np.ravel(part)]
    return [*found, *(symbol for parts in joints.values() for part in parts for symbol in part), clock]


class _OfBodies:
    """One of R, x, W, u of any body, by its index."""

    def __init__(self, symbols: Symbols, place: int):
        self.symbols, self.place = symbols, place

    def __getitem__(self, body: int) -> np.ndarray:
        return self.symbols.body(body)[self.place]
