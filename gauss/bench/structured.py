"""Programmes with more than rows: second-order cones, Coulomb's law, stages.

    ½ xᵀ H x + cᵀ x → min   subject to   C x = d,   k − K x ∈ 𝒦

𝒦 is the positive orthant, but for the last rows of K, which form second-order cones {s : s₀ ≥ |s₁|}. Of Coulomb's law x
are contact impulses r, normal first, the cones are |r_t| ≤ μ r_n, and instead of a minimum the relative velocities
u = H r + c are asked for that obey u_n ≥ 0 ⊥ r_n ≥ 0 and slide against r_t (De Saxcé, Feng 1998).
"""

from dataclasses import dataclass, field

import numpy as np

from gauss.backends.programme import Programme

CONES, COULOMB, STAGES, ROWS = "cones", "coulomb", "stages", "rows"


@dataclass(frozen=True)
class ProgrammeStructure:
    """Structure of a programme beside its matrices, for solvers of one kind."""

    cones: tuple[int, ...] = ()  # sizes of the second-order cones that the last inequality rows form
    friction: tuple[float, ...] = ()  # coefficients of friction, one a cone of three rows, where Coulomb's law is asked for
    # of optimal control: number of steps, states and inputs of a step; unknowns are u₀, x₁, u₁, x₂, …
    stages: tuple[int, ...] = ()

    @property
    def kind(self) -> str:
        """Solvers of which kind take it: "coulomb", "cones", "stages" or "rows"."""
        return COULOMB if self.friction else CONES if self.cones else STAGES if self.stages else ROWS


@dataclass(frozen=True)
class StructuredProgramme(Programme):
    """Programme with a structure."""

    # its cones, friction and stages; the other fields are those of a programme
    structure: ProgrammeStructure = field(default_factory=ProgrammeStructure)

    @property
    def orthant(self) -> int:
        """Number of inequality rows that form no cones; those of cones follow."""
        return self.k.size - sum(self.structure.cones)

    def multipliers(self, x, y, z) -> tuple[np.ndarray, np.ndarray]:
        """Multipliers y (m,) and z (s,); those of Coulomb's law follow from the impulses: z = (u_n / μ + |u_t|, u_t)."""
        if not self.structure.friction:
            return y, z
        u, friction = (self.H @ x + self.c).reshape(-1, 3), np.array(self.structure.friction)
        lifted = u[:, 0] / friction + np.hypot(u[:, 1], u[:, 2])
        return y, np.column_stack([lifted, u[:, 1:]]).ravel()

    def residuals(self, x, y, z) -> tuple[float, float, float]:
        """Largest violation of rows and cones; of stationarity and of the cones of multipliers; and the duality gap.

        Of Coulomb's law: largest excess of friction over its limit, largest approaching velocity, and the sum of all that
        |u_n r_n| and sliding friction differ from zero and from the most that can be dissipated.
        """
        slack = self.k - self.K @ x
        s, w = slack[self.orthant :], z[self.orthant :]
        primal = max(
            np.abs(self.C @ x - self.d).max(initial=0.0),
            -slack[: self.orthant].min(initial=0.0),
            _outside(self.structure, s),
        )
        if self.structure.friction:
            approach = -(self.H @ x + self.c)[::3].min(initial=0.0)
            return float(primal), float(approach), float(np.abs((s * w).reshape(-1, 3).sum(axis=1)).sum())
        dual = np.abs(self.H @ x + self.c + self.C.T @ y + self.K.T @ z).max(initial=0.0)
        gap = abs(x @ (self.H @ x) + self.c @ x + self.d @ y + self.k @ z)
        return float(primal), float(max(dual, _outside(self.structure, w))), float(gap)


def _outside(structure: ProgrammeStructure, s: np.ndarray) -> float:
    """Largest |s₁| − s₀ of the cones that vectors are to lie in; 0 if all do."""
    ends = np.cumsum(structure.cones, dtype=int)
    parts = (s[end - size : end] for end, size in zip(ends, structure.cones, strict=True))
    return max((0.0, *(float(np.linalg.norm(part[1:]) - part[0]) for part in parts)))
