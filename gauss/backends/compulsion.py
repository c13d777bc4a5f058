"""The compulsion of one instant: Gauss's principle of least constraint as a quadratic programme.

    ½ (a − a_free)ᵀ Φ (a − a_free) − Pᵀ q̈ → min,   A a + B q̈ = D,   G (a, q̈) ≤ h

a are the quasi-accelerations of the bodies, q̈ the joint accelerations (Gauss, Journal für die reine und angewandte
Mathematik 4, 1829; Udwadia and Kalaba, Analytical Dynamics, 1996, ch. 3). Φ is diagonal, A and B are kept block by block.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from gauss.backends.columns import Columns, from_blocks
from gauss.backends.structure import ConstraintRows, Structure
from gauss.codegen import Expression, Scalar
from gauss.shapes import Shaped

if TYPE_CHECKING:
    from scipy.sparse import csc_array
else:
    csc_array = object

VECTORS = ("Phi", "impressed", "P", "C", "D", "G", "h", "units")  # arrays of a compulsion that are not kept by blocks


@dataclass(frozen=True)
class Compulsion:
    """M_p(a, q̈) = ½ (a − a_free)ᵀ Φ (a − a_free) − Pᵀ q̈ → min, subject to A a + B q̈ = D and G (a, q̈) ≤ h.

    Parameters
    ----------
    structure : Structure
        Names and pattern of bodies, coordinates and rows.
    Phi : ndarray, shape (6n,)
        Diagonal of Φ: J1, J2, J3 [kg m²], m, m, m [kg] per body.
    impressed : ndarray, shape (6n,)
        Φ a_free: main moment less ω × Jω in principal axes [N m], main force in world axes [N]. Kept beside Φ
        because a body of zero inertia has this but no a_free.
    P : ndarray, shape (p,)
        Generalised drive forces [N m, N].
    A_blocks, B_blocks : tuple of tuple of ndarray
        Blocks of A, (rows, 6), for each body of each constraint, and of B for each of its columns.
    C, D : ndarray, shape (r,)
        Right-hand sides of A v + B q̇ = C and A a + B q̈ = D.
    G : ndarray, shape (s, 6n + p)
        Inequality rows.
    h : ndarray, shape (s,)
        Their right-hand side.
    constraint_residual : float
        Residual of the constraints in this state, positions and velocities, relative to the scale of the scene and its own
        rates. Redundant rows look independent, and contradict each other, by about as much.
    units : ndarray, shape (6n + p,), optional
        Units of the accelerations (a, q̈): 1 rad, and the length of the scene [m]; 1 when not given.
    """

    structure: Structure
    Phi: Shaped[np.ndarray, " n6"]
    impressed: Shaped[np.ndarray, " n6"]
    P: Shaped[np.ndarray, " p"]
    A_blocks: tuple
    B_blocks: tuple
    C: Shaped[np.ndarray, " r"]
    D: Shaped[np.ndarray, " r"]
    G: Shaped[np.ndarray, "s n6p"]
    h: Shaped[np.ndarray, " s"]
    constraint_residual: Scalar = 0.0
    units: Shaped[np.ndarray, " n6p"] = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self):
        """Set the units to 1 where there are none."""
        if not self.units.size:
            object.__setattr__(self, "units", np.ones(self.Phi.size + self.P.size))

    @property
    def violation(self) -> float:
        """``constraint_residual`` as a number; a traced compulsion is assembled, never solved."""
        assert not isinstance(self.constraint_residual, Expression)
        return float(self.constraint_residual)

    @property
    def row_scales(self) -> Shaped[np.ndarray, " s"]:
        """Largest entry of each inequality row, in the units."""
        slopes = np.abs(self.G * self.units).max(axis=1, initial=0.0)
        return np.where(slopes > 0.0, slopes, 1.0)

    def size(self, a, qdd=()) -> float:
        """Largest of accelerations (6n,) and (p,), in their units [1/s²]."""
        x = np.concatenate([a, qdd])
        return float(np.abs(x / self.units[: x.size]).max(initial=0.0))

    def work(self, forces, efforts=()) -> float:
        """Largest work of forces (6n,) and generalised forces (p,) along one of the units [J]."""
        Q = np.concatenate([forces, efforts])
        return float(np.abs(Q * self.units[: Q.size]).max(initial=0.0))

    def acceleration_scale(self, a, qdd=()) -> float:
        """Largest of the given accelerations, the free ones, and the largest force over the largest inertia [1/s²].

        Forces in balance leave accelerations that are round-off alone.
        """
        inertia = float(np.max(self.Phi * self.units[: self.Phi.size] ** 2, initial=0.0))
        pushed = self.work(self.impressed, self.P) / inertia if inertia else 0.0
        return max(self.size(a, qdd), self.size(self.a_free), pushed)

    @cached_property
    def a_free(self) -> Shaped[np.ndarray, " n6"]:
        """Accelerations (6n,) without reactions and drives; 0 along an axis without inertia."""
        return np.divide(self.impressed, self.Phi, out=np.zeros_like(self.impressed), where=self.Phi > 0)

    @cached_property
    def A(self) -> Shaped[np.ndarray, "r n6"]:
        """Dense A (r, 6n)."""
        dense = np.zeros((self.structure.n_rows, 6 * self.structure.n_bodies))
        for constraint, blocks in zip(self.structure.constraints, self.A_blocks, strict=True):
            for body, block in zip(constraint.bodies, blocks, strict=True):
                dense[constraint.rows, 6 * body : 6 * body + 6] = block
        return dense

    @cached_property
    def B(self) -> Shaped[np.ndarray, "r p"]:
        """Dense B (r, p)."""
        dense = np.zeros((self.structure.n_rows, self.structure.n_columns))
        for constraint, blocks in zip(self.structure.constraints, self.B_blocks, strict=True):
            for columns, block in zip(constraint.columns, blocks, strict=True):
                dense[constraint.rows, columns] = block
        return dense

    @cached_property
    def A_sparse(self) -> csc_array:
        """Sparse A (r, 6n); every entry of a block is stored, so that the sparsity pattern depends on the scene only."""
        return self.A_columns.csc()

    @cached_property
    def A_columns(self) -> Columns:
        """A (r, 6n) by columns, with the full pattern of its blocks."""
        starts = [[6 * body for body in c.bodies] for c in self.structure.constraints]
        return self._columns(self.A_blocks, starts, 6 * self.structure.n_bodies)

    @cached_property
    def B_sparse(self) -> csc_array:
        """Sparse B (r, p), with the full pattern of its blocks."""
        return self.B_columns.csc()

    @cached_property
    def B_columns(self) -> Columns:
        """B (r, p) by columns, with the full pattern of its blocks."""
        starts = [[columns.start for columns in c.columns] for c in self.structure.constraints]
        return self._columns(self.B_blocks, starts, self.structure.n_columns)

    def _columns(self, all_blocks, all_starts, width: int) -> Columns:
        entries = [
            (block, constraint.rows.start, start)
            for constraint, blocks, starts in zip(self.structure.constraints, all_blocks, all_starts, strict=True)
            for block, start in zip(blocks, starts, strict=True)
        ]
        return from_blocks(entries, (self.structure.n_rows, width))

    def read_only(self) -> "Compulsion":
        """Return the same problem with read-only views, for foreign methods."""
        views: dict[str, Any] = {name: _view(getattr(self, name)) for name in VECTORS}
        views |= {name: tuple(tuple(map(_view, row)) for row in getattr(self, name)) for name in ("A_blocks", "B_blocks")}
        return replace(self, **views)

    def about_free(self) -> "Compulsion":
        """Return the same problem for the deviation a − a_free as unknown: its free motion is zero.

        A heavy body hardly deviates: its deviation carries all digits, while a − a_free would cancel them.
        """
        shift = self.a_free
        D, h = self.D.copy(), self.h - self.G[:, : shift.size] @ shift
        for constraint, blocks in zip(self.structure.constraints, self.A_blocks, strict=True):
            for body, block in zip(constraint.bodies, blocks, strict=True):
                D[constraint.rows] -= block @ shift[6 * body : 6 * body + 6]
        return replace(self, impressed=np.where(self.Phi > 0, 0.0, self.impressed), D=D, h=h)

    def about_rest(self) -> "Compulsion":
        """Return the problem whose rows are those of the velocities, A v + B q̇ = C, without forces."""
        return replace(self, impressed=np.zeros_like(self.impressed), P=np.zeros_like(self.P), D=self.C)

    def value(self, a: Shaped[np.ndarray, " n6"], qdd: Shaped[np.ndarray, " p"]) -> float:
        """Compulsion M_p of given accelerations [N² / kg]."""
        deviation = a - self.a_free
        return 0.5 * deviation @ (self.Phi * deviation) - self.P @ qdd

    @cached_property
    def gyrations(self) -> np.ndarray:
        """Radius of gyration (n,) of each body [m]; 1 m for a body without mass."""
        parts = self.Phi.reshape(-1, 6)
        mass = parts[:, 3]
        mean = parts[:, :3].sum(axis=1) / 2
        return np.sqrt(np.divide(mean, mass, out=np.ones_like(mass), where=mass > 0))

    @cached_property
    def reaches(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Coordinates of joints, bodies of these, and the acceleration [m/s²] of the body by a unit one of the joint."""
        joints = [(c, A, B) for c, A, B in self.blocks if c.bodies and c.rows.stop - c.rows.start == 6 and c.columns]
        if not joints:
            return np.zeros(0, dtype=int), np.zeros(0, dtype=int), np.zeros(0)
        # of the joint point about the centre of mass
        levers = iter(np.linalg.norm(np.array([block[3:, :3] for _, A, _ in joints for block in A]), 2, axis=(1, 2)))
        coordinates, bodies, reaches = [], [], []
        for constraint, A_blocks, B_blocks in joints:
            arms = [
                np.hypot(self.gyrations[body], next(levers)) for body, _ in zip(constraint.bodies, A_blocks, strict=True)
            ]
            for columns, B in zip(constraint.columns, B_blocks, strict=True):
                turn, slide = np.sqrt((B[:3] * B[:3]).sum(axis=0)), np.sqrt((B[3:] * B[3:]).sum(axis=0))
                for body, arm in zip(constraint.bodies, arms, strict=True):
                    coordinates.append(np.arange(columns.start, columns.stop))
                    bodies.append(np.full(turn.size, body))
                    reaches.append(arm * turn + slide)
        return np.concatenate(coordinates), np.concatenate(bodies), np.concatenate(reaches)

    @property
    def blocks(self) -> Iterator[tuple[ConstraintRows, tuple, tuple]]:
        """Every constraint with its blocks of A and of B."""
        return zip(self.structure.constraints, self.A_blocks, self.B_blocks, strict=True)

    def residuals(self, a, qdd, multipliers):
        """Residuals of stationarity and rows: Φ a − f + Aᵀλ (6n,), A a + B q̈ − D (r,), Bᵀλ − P (p,), block by block."""
        r1 = self.Phi * a - self.impressed
        r2 = -self.D
        r3 = -self.P
        for constraint, A_blocks, B_blocks in self.blocks:
            rows = constraint.rows
            for body, block in zip(constraint.bodies, A_blocks, strict=True):
                columns = slice(6 * body, 6 * body + 6)
                r1[columns] += block.T @ multipliers[rows]
                r2[rows] += block @ a[columns]
            for columns, block in zip(constraint.columns, B_blocks, strict=True):
                r3[columns] += block.T @ multipliers[rows]
                r2[rows] += block @ qdd[columns]
        return r1, r2, r3

    def magnitudes(self, a, qdd, multipliers):
        """Sums of the absolute values of the terms of :meth:`residuals`, with ``|a − a_free|`` in place of a in Φ a − f."""
        lift, a_free = np.abs(a - self.a_free), np.abs(self.a_free)
        multipliers, qdd = np.abs(multipliers), np.abs(qdd)
        r1, r2, r3 = self.Phi * lift, np.abs(self.D), np.abs(self.P)
        for constraint, A_blocks, B_blocks in self.blocks:
            rows = constraint.rows
            for body, block in zip(constraint.bodies, A_blocks, strict=True):
                columns, sizes = slice(6 * body, 6 * body + 6), np.abs(block)
                r1[columns] += sizes.T @ multipliers[rows]
                r2[rows] += sizes @ (lift[columns] + a_free[columns])
            for columns, block in zip(constraint.columns, B_blocks, strict=True):
                sizes = np.abs(block)
                r3[columns] += sizes.T @ multipliers[rows]
                r2[rows] += sizes @ qdd[columns]
        return r1, r2, r3


def _view(array: np.ndarray) -> np.ndarray:
    """Array on the same numbers that cannot be written to."""
    found = array.view()
    found.flags.writeable = False
    return found
