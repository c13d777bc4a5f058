"""Relative errors of multipliers, constraint by constraint; they are found when they are asked for.

A multiplier is measured by the work [J] of its row along one of the units of accelerations, |λ| max(|A|, |B|) units: forces
and moments are of one kind. The error of a constraint is compared with its own reaction; where that is small, with 10⁻³ of
the largest force on the lighter of its bodies: reactions of light bodies count, however heavy others are.
"""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from gauss.backends.compulsion import Compulsion
from gauss.shapes import Shaped

LEAST_SHARE = 1e-3  # of the largest acceleration, or force on a body: smaller ones are compared with that


@dataclass(frozen=True)
class DualCertificate:
    """Estimated error of the multipliers of an answer, by residuals and one refinement step.

    Multipliers along the null space of redundant rows (``undetermined`` in :class:`Certificate`) are not judged: any of them
    give the same motion.

    Parameters
    ----------
    compulsion : Compulsion
        The problem.
    multipliers : ndarray, shape (r,)
        Multipliers of the equality rows less their estimated error, of least norm where rows are redundant.
    inequality_multipliers : ndarray, shape (s,)
        Those of the inequality rows.
    given : tuple of ndarray, (r,) and (s,)
        Multipliers that the backend gave, without their part in the null space of redundant rows.
    active : ndarray of int, shape (k,)
        Active inequality rows.
    doubts : tuple of tuple of ndarray, (r,) and (k,)
        Parts of a bound of the error of the multipliers that are returned.
    """

    compulsion: Compulsion = field(repr=False)
    multipliers: Shaped[np.ndarray, " r"]
    inequality_multipliers: Shaped[np.ndarray, " s"]
    given: tuple = field(repr=False)
    active: Shaped[np.ndarray, " k"] = field(repr=False)
    doubts: tuple = field(repr=False)

    @cached_property
    def errors(self) -> Shaped[np.ndarray, " c"]:
        """Estimated relative errors of the multipliers that are returned, by constraint, then by inequality row."""
        return self._compared(self._doubt)

    @cached_property
    def given_errors(self) -> Shaped[np.ndarray, " c"]:
        """Estimated relative errors of the multipliers that the backend gave, in the same order."""
        multipliers, mu = self.given
        return self.relative(multipliers - self.multipliers, mu - self.inequality_multipliers) + self.errors

    @property
    def error(self) -> float:
        """Largest of ``errors``."""
        return float(self.errors.max(initial=0.0))

    @property
    def given_error(self) -> float:
        """Largest of ``given_errors``."""
        return float(self.given_errors.max(initial=0.0))

    @property
    def worst(self) -> str:
        """Name of the constraint with the largest error of what is returned."""
        return self._name(self.errors)

    @property
    def given_worst(self) -> str:
        """Name of the constraint with the largest error of what the backend gave."""
        return self._name(self.given_errors)

    def _name(self, errors: np.ndarray) -> str:
        constraints = self.compulsion.structure.constraints
        if not errors.size:
            return ""
        worst = int(errors.argmax())
        return constraints[worst].name if worst < len(constraints) else f"inequality row {worst - len(constraints)}"

    def relative(self, multipliers, mu) -> Shaped[np.ndarray, " c"]:
        """Relative sizes of a change of multipliers (r,) and (s,), by constraint, then by inequality row."""
        return self._compared(self._sizes(multipliers, mu))

    def _compared(self, error: np.ndarray) -> np.ndarray:
        scale = self._scale
        return np.divide(error, scale, out=np.where(error > 0, np.inf, 0.0), where=scale > 0)

    def _sizes(self, multipliers, mu) -> np.ndarray:
        """Sizes (c + s,) of multipliers [J], of a constraint the largest."""
        largest = np.zeros(len(self.compulsion.structure.constraints))
        np.maximum.at(largest, self._owners, np.abs(multipliers * self._rows))
        return np.concatenate([largest, np.abs(mu) * self.compulsion.row_scales])

    @cached_property
    def _doubt(self) -> np.ndarray:
        """Bound (c + s,) of the error of the multipliers that are returned [J]."""
        found = np.zeros(len(self.compulsion.structure.constraints) + self.compulsion.h.size)
        for multipliers, active in self.doubts:
            mu = np.zeros_like(self.inequality_multipliers)
            mu[self.active] = active
            found = found + self._sizes(multipliers, mu)
        return found

    @cached_property
    def _owners(self) -> np.ndarray:
        """Constraint (r,) of every row."""
        owners = np.zeros(self.compulsion.structure.n_rows, dtype=int)
        for i, constraint in enumerate(self.compulsion.structure.constraints):
            owners[constraint.rows] = i
        return owners

    @cached_property
    def _rows(self) -> np.ndarray:
        """Largest entries of the equality rows (r,), in the units."""
        compulsion = self.compulsion
        sizes, n = np.zeros(compulsion.structure.n_rows), compulsion.Phi.size
        for constraint, A_blocks, B_blocks in compulsion.blocks:
            places = [slice(6 * body, 6 * body + 6) for body in constraint.bodies]
            places += [slice(n + columns.start, n + columns.stop) for columns in constraint.columns]
            for place, block in zip(places, (*A_blocks, *B_blocks), strict=True):
                slopes = np.abs(block * compulsion.units[place]).max(axis=1, initial=0.0)
                sizes[constraint.rows] = np.maximum(sizes[constraint.rows], slopes)
        return sizes

    @cached_property
    def _scale(self) -> np.ndarray:
        """Sizes (c + s,) that errors are compared with [J]."""
        compulsion, own = self.compulsion, self._sizes(self.multipliers, self.inequality_multipliers)
        touched = _touched(compulsion)
        pushed = (
            np.abs(compulsion.impressed * compulsion.units[: compulsion.Phi.size]).reshape(-1, 6).max(axis=1, initial=0.0)
        )
        for size, bodies in zip(np.maximum(own - self._doubt, 0.0), touched, strict=True):  # the certain part of a reaction
            pushed[bodies] = np.maximum(pushed[bodies], size)
        return np.array(
            [max(size, LEAST_SHARE * pushed[bodies].min(initial=np.inf)) for size, bodies in zip(own, touched, strict=True)]
        )


def _touched(compulsion: Compulsion) -> list[list[int]]:
    """Bodies on which each constraint, then each inequality row acts: directly, or through joints whose rates it binds."""
    structure, n = compulsion.structure, compulsion.Phi.size
    on_rate: list[list[int]] = [[] for _ in range(structure.n_columns)]
    for constraint in structure.constraints:
        for column in _indices(constraint.columns):
            on_rate[column] += constraint.bodies
    through = lambda columns: [body for column in columns for body in on_rate[column]]  # noqa: E731
    by_rows = [list(c.bodies) or through(_indices(c.columns)) for c in structure.constraints]
    by_inequalities = [
        np.unique(np.flatnonzero(row[:n]) // 6).tolist() or through(np.flatnonzero(row[n:])) for row in compulsion.G
    ]
    return by_rows + by_inequalities


def _indices(columns: tuple[slice, ...]) -> list[int]:
    return [column for place in columns for column in range(place.start, place.stop)]
