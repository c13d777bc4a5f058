"""Rows of the relations, directions of the efforts and responses of the system, in one state.

With x̂ the accelerations under contacts and loads without servos, X_W = N H_N⁻¹Nᵀ Wᵀ the accelerations that one unit of each
effort adds, and G x = γ the relations, everything follows from

    S = G X_W   (r × j),     S u = γ − G x̂,     x = x̂ + X_W u

The normalised S has entries between −1 and 1: cosines, in the mass metric, between rows and directions, without
units.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from gauss.codegen import Expression, Scalar
from gauss.shapes import Shaped

DEPENDENT = 1e-10  # singular value or pivot, relative to the largest, of dependent rows and undetermined directions


def number(value: Scalar) -> float:
    """Value that is a number and no expression, as the time of a state in numbers."""
    if isinstance(value, Expression):
        raise TypeError(f"expected a number, got the expression {value!r}.")
    return value


@dataclass(frozen=True)
class ServoInstant:
    """Rows, directions and responses at one state, in m accelerations."""

    position: Shaped[np.ndarray, " r"]  # position, velocity (r,): residuals of the relations at position and velocity level
    velocity: Shaped[np.ndarray, " r"]
    G: Shaped[np.ndarray, "r m"]  # (r, m) rows of the relations
    gamma: Shaped[np.ndarray, " r"]  # (r,) right-hand side of G x = γ
    W: Shaped[np.ndarray, "j m"]  # (j, m) generalised force of one unit of each effort
    free: Shaped[np.ndarray, " m"]  # (m,) accelerations x̂ without servos
    X_W: Shaped[np.ndarray, "m j"]  # (m, j) accelerations that one unit of each effort adds
    X_G: Shaped[np.ndarray, "m r"]  # (m, r) accelerations that a unit force along each row adds
    speeds: Shaped[np.ndarray, " j"]  # (j,) speed against which each effort works: W times the velocities
    power: Shaped[np.ndarray, " 3"]  # (3,) power of drives, of forces on bodies, power lost in dampers [W]

    @cached_property
    def S(self) -> Shaped[np.ndarray, "r j"]:
        """Accelerations of the relations under one unit of each effort."""
        return self.G @ self.X_W

    @property
    def b(self) -> Shaped[np.ndarray, " r"]:
        """Right-hand side of S u = b: accelerations of the relations that the efforts add."""
        return self.gamma - self.G @ self.free

    @property
    def sizes(self) -> Shaped[np.ndarray, " r"]:
        """Sizes of the terms of b, scale of its rounding."""
        return np.abs(self.gamma) + np.abs(self.G) @ np.abs(self.free)

    @cached_property
    def lengths(self) -> Shaped[np.ndarray, " r"]:
        """Lengths of the rows in the mass metric; zero for a row that contacts determine."""
        return np.sqrt(np.maximum(np.einsum("im,mi->i", self.G, self.X_G), 0.0))

    @cached_property
    def strengths(self) -> Shaped[np.ndarray, " j"]:
        """Lengths of the directions in the mass metric; zero for an effort without effect."""
        return np.sqrt(np.maximum(np.einsum("im,mi->i", self.W, self.X_W), 0.0))

    @cached_property
    def unit_rows(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """S, b and the sizes of its terms with rows of unit length, so that relations of angles and of places compare."""
        length = _nonzero(self.lengths)
        return self.S / length[:, None], self.b / length, self.sizes / length

    @cached_property
    def cosines(self) -> Shaped[np.ndarray, "r j"]:
        """Normalised S."""
        return self.S / (_nonzero(self.lengths)[:, None] * _nonzero(self.strengths))

    def part(self, rows) -> "ServoInstant":
        """The same instant with some of the relations only."""
        return replace(
            self,
            position=self.position[rows],
            velocity=self.velocity[rows],
            G=self.G[rows],
            gamma=self.gamma[rows],
            X_G=self.X_G[:, rows],
        )

    def onto_contacts(self, count: int) -> "ServoInstant":
        """Instant of the other relations, projected onto the first ones, which contacts keep with ideal reactions."""
        if not count:
            return self
        contacts, others = self.part(slice(0, count)), self.part(slice(count, None))
        return replace(
            others,
            free=contacts.guided(self.free, contacts.gamma),
            X_W=contacts.guided(self.X_W),
            X_G=contacts.guided(others.X_G),
        )

    def guided(self, x, gamma=0.0):
        """Accelerations x corrected by ideal reactions along the rows until G x = γ."""
        length = _nonzero(self.lengths)
        gram = (self.G @ self.X_G) / np.outer(length, length)
        residual = ((gamma - (self.G @ x).T) / length).T
        return x + self.X_G @ ((np.linalg.pinv(gram, DEPENDENT, hermitian=True) @ residual).T / length).T


def _nonzero(lengths):
    return np.where(lengths > 0, lengths, 1.0)
