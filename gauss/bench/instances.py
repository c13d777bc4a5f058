"""Instances of the comparison: programmes with what is known of them, be they compulsions or from a file."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy import sparse

from gauss.backends.compulsion import Compulsion
from gauss.backends.programme import FORMS, Programme
from gauss.bench.known import KnownSolution, known
from gauss.bench.problems import INCONSISTENT, SOLVABLE, MechanismProblem, make_problem
from gauss.bench.reference import ReferenceSolution, reference
from gauss.errors import BackendError, FileError

EQUALITY, INEQUALITY = "equality", "inequality"
GROUPS = (EQUALITY, INEQUALITY, INCONSISTENT)  # classes of the selection
FILE = "file"  # form of programmes that are no compulsions


class Matrices(NamedTuple):
    """½ xᵀ P x + qᵀ x → min subject to A x = b, G x ≤ h; all matrices sparse, by columns."""

    P: sparse.csc_matrix
    q: np.ndarray
    A: sparse.csc_matrix
    b: np.ndarray
    G: sparse.csc_matrix
    h: np.ndarray


@dataclass(frozen=True)
class Instance:
    """What solvers are asked, and what is right.

    Parameters
    ----------
    name, group, note : str
        Its name, its class, and what it is.
    verdict : str
        "solvable", "inconsistent", "infeasible" or "unbounded".
    compulsion : Compulsion, optional
        Where the programme comes from, in every form.
    expected : ReferenceSolution, optional
        Its solution.
    matrices : Matrices, optional
        The programme itself, if it is not that of a compulsion.
    known : KnownSolution, optional
        Its solution, if it is known.
    start : ndarray, shape (n,), optional
        Where a warm start begins: the solution of the problem before it in a sequence.
    """

    name: str
    group: str
    note: str = ""
    verdict: str = SOLVABLE
    compulsion: Compulsion | None = None
    expected: ReferenceSolution | None = None
    matrices: Matrices | None = None
    known: KnownSolution | None = None
    start: np.ndarray | None = None

    def programme(self, form: str) -> Programme:
        """Programme in a form, without entries that are zero."""
        if self.matrices is None:
            assert self.compulsion is not None  # an instance has one of both
            return FORMS[form](self.compulsion).without_zeros()
        m = self.matrices
        return Programme(FILE, m.P, m.q, m.A, m.b, m.G, m.h, _unread).without_zeros()

    def forms(self, asked: Iterable[str]) -> tuple[str, ...]:
        """Forms in which a solver gets it: those that are asked for, or that of its file."""
        return tuple(asked) if self.matrices is None else (FILE,)

    def error(self, answer, x) -> float:
        """Largest relative error of an answer, or of an x where there is no compulsion; nan where nothing is known."""
        if self.expected is not None and self.compulsion is not None:
            return self.expected.error(self.compulsion, answer)
        return np.nan if self.known is None else self.known.error(x)


def _unread(*_, **__):
    raise BackendError("a programme from a file is no compulsion: there are no accelerations to read.")


def of_problem(problem: MechanismProblem) -> Instance:
    """Instance of a problem, with its reference."""
    expected = None if problem.verdict == INCONSISTENT else reference(problem.compulsion)
    return Instance(problem.name, group_of(problem), problem.note, problem.verdict, problem.compulsion, expected)


def of_arrays(name: str, group: str, P, q, A, b, G, h, x=None, **fields) -> Instance:
    """Instance of a programme given by its arrays; A, b or G, h may be None, and so may its solution x."""
    n = np.size(q)
    A, b = (sparse.csc_matrix((0, n)), np.zeros(0)) if A is None else (sparse.csc_matrix(A), np.asarray(b, dtype=float))
    G, h = (sparse.csc_matrix((0, n)), np.zeros(0)) if G is None else (sparse.csc_matrix(G), np.asarray(h, dtype=float))
    matrices = Matrices(sparse.csc_matrix(P), np.asarray(q, dtype=float), A, b, G, h)
    return Instance(name, group, matrices=matrices, known=None if x is None else known(matrices, x), **fields)


def of_folder(folder: Path) -> Iterator[Instance]:
    """Instances of the files of problems in a folder; their class is its name.

    Files end in .npz, as ``qpsolvers.Problem.save`` writes them, or in .mat with P, q, A, l, u of l ≤ A x ≤ u, as the
    Maros–Mészáros problems are distributed for OSQP.

    Raises
    ------
    FileError
        If there is none, or one cannot be read.
    """
    paths = sorted(path for path in Path(folder).glob("*") if path.suffix in READERS)
    if not paths:
        raise FileError(f"{folder}: no {' or '.join(READERS)} files of problems.")
    for path in paths:
        try:
            parts = READERS[path.suffix](path)
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise FileError(f"{path}: {error}") from None
        yield of_arrays(path.stem, Path(folder).name or "folder", *parts)


def _read_npz(path: Path):
    """P, q, A, b, G, h of a file of qpsolvers."""
    import qpsolvers

    P, q, G, h, A, b, lb, ub = qpsolvers.Problem.load(str(path)).unpack()
    rows = [] if G is None else [(sparse.csr_matrix(G), h)]
    nothing = np.full(q.size, np.inf)
    lb, ub = (-nothing if lb is None else lb), (nothing if ub is None else ub)
    rows += _one_sided(sparse.eye_array(q.size, format="csr"), np.asarray(lb), np.asarray(ub))
    return P, q, A, b, *_stacked(rows)


def _read_mat(path: Path):
    """P, q, A, b, G, h of a file of Matlab with l ≤ A x ≤ u."""
    from scipy import io

    data = io.loadmat(path)
    missing = [name for name in ("P", "q", "A", "l", "u") if name not in data]
    if missing:
        raise ValueError(f"no {', '.join(missing)}; expected P, q, A, l, u of ½ xᵀPx + qᵀx → min subject to l ≤ Ax ≤ u.")
    if np.size(data.get("cones", ())):
        raise ValueError("it has cones; expected a quadratic programme.")
    rows = sparse.csr_matrix(data["A"], dtype=float)  # Matlab's files hold whole numbers as integers, unsigned ones, too
    q, lower, upper = (np.ravel(data[name]).astype(float) for name in ("q", "l", "u"))
    if rows.shape != (lower.size, q.size) or upper.size != lower.size or data["P"].shape != (q.size, q.size):
        raise ValueError("P, q, A, l, u have shapes that do not belong together.")
    held = lower == upper
    sides = _one_sided(rows[~held], lower[~held], upper[~held])
    return sparse.csc_matrix(data["P"], dtype=float), q, rows[held], upper[held], *_stacked(sides)


READERS = {".npz": _read_npz, ".mat": _read_mat}
UNBOUNDED = 1e20  # bounds of this size are none: the convention of the files of Matlab, and of SIF before them


def _one_sided(rows, lower: np.ndarray, upper: np.ndarray) -> list:
    """Rows of G x ≤ h and their h, for lower ≤ rows x ≤ upper."""
    above, below = upper < UNBOUNDED, lower > -UNBOUNDED
    return [(rows[above], upper[above]), (-rows[below], -lower[below])]


def _stacked(rows: list):
    """G and h; None where there is no row."""
    rows = [(matrix, right) for matrix, right in rows if np.size(right)]
    if not rows:
        return None, None
    return sparse.vstack([matrix for matrix, _ in rows]), np.concatenate([right for _, right in rows])


def of_scene(scene, name: str, duration: float = 1.0, count: int = 5) -> Iterator[Instance]:
    """Instances at equally spaced times of the motion of a scene; instants without rows ask for nothing and are left out."""
    from gauss.bench.export import along

    found = [problem for problem in along(scene, duration, count) if _has_rows(problem)]
    if not found:
        raise BackendError(f"{name}: no instant has rows that a QP solver could be asked about.")
    yield from map(of_problem, found)


def of_selection(names: Iterable[str], groups: Iterable[str] = GROUPS) -> Iterator[Instance]:
    """Instances of the selection by name, as far as they are of some classes."""
    for name in names:
        problem = make_problem(name)
        if group_of(problem) in groups:
            yield of_problem(problem)


def group_of(problem: MechanismProblem) -> str:
    """Class of a problem of the selection, or of the instant of a motion."""
    if problem.verdict == INCONSISTENT:
        return INCONSISTENT
    return INEQUALITY if problem.compulsion.h.size else EQUALITY


def _has_rows(problem: MechanismProblem) -> bool:
    return bool(problem.compulsion.D.size or problem.compulsion.h.size)
