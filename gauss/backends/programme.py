"""The compulsion as a quadratic programme for QP solvers, in one of four forms, and the way back.

    ½ xᵀ H x + cᵀ x → min,   C x = d,   K x ≤ k

F1 keeps all unknowns (a, q̈), F2 has no q̈, F2s is F2 with a Hessian of ones, F3 has q̈ alone. All have the same minimum;
they differ in which solvers take them, in speed, and in the digits that are lost.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

import numpy as np

from gauss.backends.columns import Columns
from gauss.backends.compulsion import Compulsion
from gauss.backends.coordinates import Coordinates
from gauss.backends.forms import Eliminated, eliminated, scaled
from gauss.backends.solution import Answer
from gauss.errors import BackendError, did_you_mean

if TYPE_CHECKING:
    from scipy.sparse import csc_matrix
else:
    csc_matrix = object


@dataclass(frozen=True)
class Programme:
    """½ xᵀ H x + cᵀ x → min subject to C x = d, K x ≤ k.

    Parameters
    ----------
    form : str
        "F1", "F2", "F2s" or "F3".
    H : csc_matrix or ndarray, shape (n, n)
        Hessian; all matrices are dense for a solver that is ``dense``.
    c : ndarray, shape (n,)
        Linear term.
    C, d : csc_matrix or ndarray, shape (m, n), and ndarray, shape (m,)
        Equality rows.
    K, k : csc_matrix or ndarray, shape (s, n), and ndarray, shape (s,)
        Inequality rows.
    answer : callable
        ``answer(x, y, z, **outcome)`` turns a solution and its multipliers into an :class:`gauss.backends.solution.Answer`.
    """

    form: str
    H: Any
    c: np.ndarray
    C: Any
    d: np.ndarray
    K: Any
    k: np.ndarray
    answer: Callable

    def without_zeros(self) -> "Programme":
        """The same programme without stored zeros, with a C of its own: solvers want to write to it."""
        if self.C.data.all() and self.K.data.all() and self.C.indices.flags.writeable:
            return self
        C, K = self.C.copy(), self.K.copy()
        C.eliminate_zeros()
        K.eliminate_zeros()
        return replace(self, C=C, K=K)

    @property
    def lengths(self) -> np.ndarray:
        """Lengths (s,) of the inequality rows; 1 of one that is zero."""
        found = np.sqrt(np.asarray(_times(self.K, self.K).sum(axis=1)).ravel())
        return np.where(found > 0.0, found, 1.0)

    @property
    def size(self) -> float:
        """Power of two near the largest number among c, d, k."""
        largest = max(np.abs(part).max(initial=0.0) for part in (self.c, self.d, self.k))
        return float(2.0 ** np.round(np.log2(largest))) if 0.0 < largest < np.inf else 1.0

    def with_rows_of_unit_length(self) -> "Programme":
        """The same programme with inequality rows of unit length, whose multipliers are longer by as much."""
        if not self.k.size:
            return self
        return replace(self, K=_times(self.K, 1.0 / self.lengths[:, None]), k=self.k / self.lengths)

    def divided(self, size: float) -> "Programme":
        """The same programme for x/size, whose multipliers are divided, too."""
        return replace(self, c=self.c / size, d=self.d / size, k=self.k / size)

    def residuals(self, x, y, z) -> tuple[float, float, float]:
        """Largest violation of the rows, of stationarity, and the duality gap, in the units of the programme."""
        primal = max(np.abs(self.C @ x - self.d).max(initial=0.0), (self.K @ x - self.k).max(initial=0.0))
        dual = np.abs(self.H @ x + self.c + self.C.T @ y + self.K.T @ z).max(initial=0.0)
        gap = abs(x @ (self.H @ x) + self.c @ x + self.d @ y + self.k @ z)
        return float(primal), float(dual), float(gap)


@dataclass(frozen=True)
class Outcome:
    """Outcome of a QP solver.

    Parameters
    ----------
    x, y, z : ndarray or None
        Solution, multipliers of the equality and of the inequality rows; None of a solver without them.
    found : bool
        Whether it claims success.
    message : str
        Its own words.
    iterations : int
        Its iterations; 0 where unknown.
    """

    x: np.ndarray | None
    y: np.ndarray | None
    z: np.ndarray | None
    found: bool
    message: str
    iterations: int = 0

    def times(self, size: float) -> "Outcome":
        """The outcome of a programme that has been divided by a size."""
        x, y, z = (None if part is None else size * part for part in (self.x, self.y, self.z))
        return replace(self, x=x, y=y, z=z)


@runtime_checkable
class Solver(Protocol):
    """A QP solver: called with a programme, it returns an outcome.

    One with a true attribute ``dense`` gets dense matrices, others csc_matrices.
    """

    name: str

    def __call__(self, programme: Programme) -> Outcome:
        """Solve."""


def apply_settings(target, settings: dict, solver: str):
    """Set attributes of a solver's settings.

    BackendError if it has no such setting.
    """
    for name, value in settings.items():
        if not hasattr(target, name):
            raise BackendError(f"{solver}: no setting {name!r}. {did_you_mean(name, _public(target))}")
        setattr(target, name, value)


def _public(target) -> list[str]:
    return [name for name in dir(target) if not name.startswith("_")]


def compressed(matrix: Columns | np.ndarray) -> csc_matrix:
    """The matrix as a csc_matrix."""
    from scipy import sparse  # takes as long to import as all of gauss

    return sparse.csc_matrix(matrix.csc() if isinstance(matrix, Columns) else matrix)


def dense(matrix: Columns | np.ndarray) -> np.ndarray:
    """The matrix as a dense array."""
    return matrix.toarray() if isinstance(matrix, Columns) else matrix


def _times(matrix, factors):
    """Products of the entries, in the storage of the matrix."""
    return matrix * factors if isinstance(matrix, np.ndarray) else type(matrix)(matrix.multiply(factors))


def full(compulsion: Compulsion, stored: Callable = compressed) -> Programme:
    """F1: unknowns (a, q̈); the Hessian is singular in q̈."""
    n = compulsion.Phi.size

    def answer(x, y, z, **outcome) -> Answer:
        return Answer(x[:n], x[n:], y, z, **outcome)

    H = Columns.diagonal(np.concatenate([compulsion.Phi, np.zeros(compulsion.P.size)]))
    c = -np.concatenate([compulsion.impressed, compulsion.P])
    C, K = compulsion.A_columns.beside(compulsion.B_columns), compulsion.G
    return Programme("F1", stored(H), c, stored(C), compulsion.D.copy(), stored(K), compulsion.h.copy(), answer)


def accelerations(compulsion: Compulsion, stored: Callable = compressed) -> Programme:
    """F2: unknowns a."""
    return _of_accelerations("F2", eliminated(compulsion), stored)


def scaled_accelerations(compulsion: Compulsion, stored: Callable = compressed) -> Programme:
    """F2s: unknowns Φ^½ a, rows of unit length."""
    return _of_accelerations("F2s", scaled(compulsion), stored)


def coordinates(compulsion: Compulsion, stored: Callable = compressed) -> Programme:
    """F3: unknowns q̈ of the tree; its inertia matrix is the Hessian."""
    form = Coordinates(compulsion)
    return Programme("F3", stored(form.M), -form.force, stored(form.C), form.d, stored(form.K), form.k, form.answer)


def _of_accelerations(name: str, form: Eliminated, stored: Callable) -> Programme:
    H, c = Columns.diagonal(form.weights), -form.weights * form.x_free
    return Programme(name, stored(H), c, stored(form.C), form.d, stored(form.K), form.k, form.answer)


FORMS = {"F1": full, "F2": accelerations, "F2s": scaled_accelerations, "F3": coordinates}
