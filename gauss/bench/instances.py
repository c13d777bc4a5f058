"""Instances of the comparison: programmes with what is known of them, be they compulsions or from a file."""

import hashlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy import sparse

from gauss.backends.compulsion import Compulsion
from gauss.backends.programme import FORMS, Programme
from gauss.bench.known import KnownSolution, known
from gauss.bench.problems import INCONSISTENT, SOLVABLE, UNKNOWN, MechanismProblem, make_problem
from gauss.bench.reference import ReferenceSolution, reference
from gauss.bench.structured import ROWS, ProgrammeStructure, StructuredProgramme
from gauss.errors import BackendError

EQUALITY, INEQUALITY = "equality", "inequality"
GROUPS = (EQUALITY, INEQUALITY, INCONSISTENT)  # classes of the selection
FILE = "file"  # form of programmes that are no compulsions
MAIN_FORM = "F2s"  # of tables and charts about one form, and of quick comparisons


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
    """Programme that solvers are given, and its solution."""

    name: str  # name, group, note: its name, its class, and what it is
    group: str
    note: str = ""
    # "solvable", "inconsistent", "infeasible" or "unbounded"; "unknown" of files without a solution or a proof
    verdict: str = SOLVABLE
    compulsion: Compulsion | None = None  # where the programme comes from, in every form
    expected: ReferenceSolution | None = None  # its solution
    matrices: Matrices | None = None  # the programme itself, if it is not that of a compulsion
    known: KnownSolution | None = None  # its solution, if it is known
    start: np.ndarray | None = None  # where a warm start begins: the solution of the problem before it in a sequence
    structure: ProgrammeStructure = ProgrammeStructure()  # cones, friction or stages of the programme; none when not given
    data: str = ""  # SHA-256 of its numbers, see :func:`data_of`; of the suite that in the manifest of its files

    def programme(self, form: str) -> Programme:
        """Programme in a form, without entries that are zero."""
        if self.matrices is None:
            assert self.compulsion is not None  # an instance has one of both
            return FORMS[form](self.compulsion).without_zeros()
        parts = (FILE, *self.matrices, _unread)
        if self.structure.kind == ROWS:
            return Programme(*parts).without_zeros()
        return StructuredProgramme(*parts, structure=self.structure).without_zeros()

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
    c = problem.compulsion
    data = data_of(c.Phi, c.impressed, c.P, c.A_sparse, c.B_sparse, c.D, c.G, c.h)
    return Instance(problem.name, group_of(problem), problem.note, problem.verdict, c, expected, data=data)


def of_arrays(name: str, group: str, P, q, A, b, G, h, x=None, **fields) -> Instance:
    """Instance of a programme given by its arrays; A, b or G, h may be None, and so may its solution x, unknown then."""
    n = np.size(q)
    A, b = (sparse.csc_matrix((0, n)), np.zeros(0)) if A is None else (sparse.csc_matrix(A), np.asarray(b, dtype=float))
    G, h = (sparse.csc_matrix((0, n)), np.zeros(0)) if G is None else (sparse.csc_matrix(G), np.asarray(h, dtype=float))
    matrices = Matrices(sparse.csc_matrix(P), np.asarray(q, dtype=float), A, b, G, h)
    solution = {"verdict": UNKNOWN} if x is None else {"known": known(matrices, x)}
    fields = {"data": data_of(*matrices)} | solution | fields
    return Instance(name, group, matrices=matrices, **fields)


def data_of(*parts) -> str:
    """SHA-256 of the numbers of vectors and matrices, whatever the order in which these are stored."""
    found = hashlib.sha256()
    for part in parts:
        if sparse.issparse(part):
            columns = sparse.csc_array(part).sorted_indices()
            found.update(repr(columns.shape).encode() + columns.indptr.astype("<i8").tobytes())
            found.update(columns.indices.astype("<i8").tobytes() + columns.data.astype("<f8").tobytes())
        else:
            found.update(np.asarray(part, dtype="<f8").tobytes())
    return found.hexdigest()


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
