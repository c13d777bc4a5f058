"""QPS: free MPS with the section QUADOBJ, as HiGHS, Gurobi, CPLEX and MOSEK read it; every double reads back as it was.

Equality rows are e0, e1, …, inequality rows i0, i1, …; variables keep their names, blanks become underscores. Comments at
the head tell the story and the verdict and hold the reference: a line for each variable, row and bound, in two doubles
whose sum it is.
"""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from scipy import sparse

from gauss.bench.export import file_name
from gauss.bench.suite.instance import SuiteInstance, programme
from gauss.errors import FileError
from gauss.io.checked_arrays import require_symmetric

KINDS = "N", "E", "L", "G"  # of rows
SECTIONS = "NAME", "ROWS", "COLUMNS", "RHS", "RANGES", "BOUNDS", "QUADOBJ", "QMATRIX", "ENDATA"


def write_qps(path: Path, instance: SuiteInstance):
    """Write an instance without cones."""
    names = [f"{_word(variable)}" for variable in instance.variables]
    names = names if len(set(names)) == len(names) else [f"{name}#{i}" for i, name in enumerate(names)]
    equalities, inequalities = (
        [f"{letter}{i}" for i in range(size)] for letter, size in (("e", instance.b.size), ("i", instance.h.size))
    )
    lines = [*_comments(instance, names), f"NAME {file_name(instance.name)}", "ROWS", " N cost"]
    lines += [f" E {row}" for row in equalities] + [f" L {row}" for row in inequalities] + ["COLUMNS"]
    rows, both = [*equalities, *inequalities], sparse.csc_array(sparse.vstack([instance.A, instance.G]))
    lines += _columns(instance, names, rows, both)
    right = np.concatenate([instance.b, instance.h])
    lines += ["RHS", *(f" rhs {row} {_text(value)}" for row, value in zip(rows, right, strict=True) if value)]
    lines += ["BOUNDS", *_bounds(instance, names)]
    lower = sparse.coo_array(sparse.tril(instance.P))
    lines.append("QUADOBJ")
    order = np.lexsort((lower.row, lower.col))
    lines += [f" {names[lower.col[k]]} {names[lower.row[k]]} {_text(lower.data[k])}" for k in order]
    path.write_text("\n".join([*lines, "ENDATA", ""]), encoding="utf-8")


def _columns(instance: SuiteInstance, names: list[str], rows: list[str], matrix) -> Iterator[str]:
    for j, name in enumerate(names):
        entries = range(matrix.indptr[j], matrix.indptr[j + 1])
        if instance.q[j] or not len(entries):
            yield f" {name} cost {_text(instance.q[j])}"
        yield from (f" {name} {rows[matrix.indices[k]]} {_text(matrix.data[k])}" for k in entries)


def _bounds(instance: SuiteInstance, names: list[str]) -> Iterator[str]:
    for name, low, high in zip(names, instance.lb, instance.ub, strict=True):
        if np.isinf(low) and np.isinf(high):
            yield f" FR bnd {name}"
            continue
        yield f" LO bnd {name} {_text(low)}" if np.isfinite(low) else f" MI bnd {name}"
        if np.isfinite(high):
            yield f" UP bnd {name} {_text(high)}"


class _QpsReader:
    """Sections of a QPS file, line by line."""

    def __init__(self, path: Path):
        self.path, self.name, self.both_halves = path, path.stem, False
        self.objective: str | None = None
        self.kinds: dict[str, str] = {}  # of the rows
        self.columns: dict[str, int] = {}
        self.cost: dict[int, float] = {}
        self.entries: list[tuple[str, int, float]] = []
        self.right: dict[str, float] = {}
        self.ranges: dict[str, float] = {}
        self.bounds: list[list[str]] = []
        self.quadratic: list[tuple[int, int, float]] = []
        self.takes = {
            "ROWS": self._row,
            "COLUMNS": self._column,
            "RHS": lambda words: self._of_rows(self.right, words),
            "RANGES": lambda words: self._of_rows(self.ranges, words),
            "BOUNDS": self.bounds.append,
            "QUADOBJ": self._quadratic,
            "QMATRIX": self._quadratic,
        }

    def read(self, text: str):
        """Take all lines."""
        take = None
        for line in text.splitlines():
            if not line.strip() or line.startswith("*"):
                continue
            words = line.split()
            if not line.startswith((" ", "\t")):
                take = self._section(words)
            elif take is not None:
                take(words)

    def _section(self, words: list[str]) -> Callable[[list[str]], None] | None:
        """Reader of the lines of a section; lines of other sections are skipped."""
        section = words[0]
        if section not in SECTIONS:
            raise FileError(f"{self.path}: section {section!r} is not read; known are {', '.join(SECTIONS)}.")
        if section == "NAME" and len(words) > 1:
            self.name = words[1]
        self.both_halves = self.both_halves or section == "QMATRIX"
        return self.takes.get(section)

    def _row(self, words: list[str]):
        if words[0] not in KINDS:
            raise FileError(f"{self.path}: a row of kind {words[0]!r} is not read; known are {', '.join(KINDS)}.")
        if words[1] in self.kinds:
            raise FileError(f"{self.path}: row {words[1]!r} stands there twice.")
        self.kinds[words[1]] = words[0]
        if words[0] == "N" and self.objective is None:
            self.objective = words[1]

    def _column(self, words: list[str]):
        column = self.columns.setdefault(words[0], len(self.columns))
        for row, value in zip(words[1::2], words[2::2], strict=True):
            if row not in self.kinds:
                raise FileError(f"{self.path}: column {words[0]!r} has an entry in row {row!r}, which is not there.")
            if row == self.objective:
                self.cost[column] = float(value)
            else:
                self.entries.append((row, column, float(value)))

    def _of_rows(self, values: dict[str, float], words: list[str]):
        for row, value in zip(words[-2::-2], words[-1::-2], strict=False):
            if row not in self.kinds:
                raise FileError(f"{self.path}: a right-hand side or range is of row {row!r}, which is not there.")
            values[row] = float(value)

    def _quadratic(self, words: list[str]):
        self.quadratic.append((self.columns[words[0]], self.columns[words[1]], float(words[2])))

    def hessian(self):
        """P of both triangles; QUADOBJ gives each pair of variables once, in either order."""
        P = sparse.csc_array(sparse.coo_array(_triplets(self.quadratic), shape=(len(self.columns),) * 2))
        if self.both_halves:
            require_symmetric("QMATRIX", P)
            return P
        pairs = {(first, second) for first, second, _ in self.quadratic if first != second}
        if twice := next((pair for pair in pairs if pair[::-1] in pairs), None):
            names = list(self.columns)
            raise FileError(
                f"{self.path}: QUADOBJ has {names[twice[0]]!r}, {names[twice[1]]!r} in both orders; both triangles are "
                "QMATRIX."
            )
        return P + P.T - sparse.diags_array(P.diagonal())

    def two_sided_rows(self):
        """Rows with their lowest and highest values."""
        kinds = {row: kind for row, kind in self.kinds.items() if kind != "N"}
        wanted = [_sides(kind, self.right.get(row, 0.0), self.ranges.get(row)) for row, kind in kinds.items()]
        number = {row: i for i, row in enumerate(kinds)}
        known = [(number[row], column, value) for row, column, value in self.entries if row in number]
        rows = sparse.csr_array(sparse.coo_array(_triplets(known), shape=(len(wanted), len(self.columns))))
        return rows, *np.array(wanted).reshape(-1, 2).T


def read_qps(path: Path) -> SuiteInstance:
    """Read a QPS file in free format, with RANGES, QUADOBJ or QMATRIX, but without integers and blanks in names.

    Rows with a range become two inequality rows, rows ≥ are turned round; a constant of the cost is left out.

    FileError if a section or a kind of bound is not known, or names do not belong together. ValueError if a number is none,
    or QMATRIX is not symmetric.
    """
    found = _QpsReader(path)
    found.read(path.read_text(encoding="utf-8"))
    n = len(found.columns)
    q, lb, ub = np.zeros(n), np.zeros(n), np.full(n, np.inf)
    for j, value in found.cost.items():
        q[j] = value
    _bound(path, found.bounds, found.columns, lb, ub)
    rows, low, high = found.two_sided_rows()
    equal = low == high
    up, down = np.isfinite(high) & ~equal, np.isfinite(low) & ~equal
    G, h = sparse.vstack([rows[up], -rows[down]]), np.concatenate([high[up], -low[down]])
    more: dict[str, Any] = {"lb": lb, "ub": ub, "variables": tuple(found.columns)}
    about = found.name, "file", f"read from {path.name}"
    return programme(*about, found.hessian(), q, A=rows[equal], b=high[equal], G=G, h=h, **more)


def _sides(kind: str, right: float, span: float | None) -> tuple[float, float]:
    """Lowest and highest value of a row of a kind, with its range if it has one."""
    if kind == "E":
        return (right, right) if span is None else (min(right, right + span), max(right, right + span))
    far = np.inf if span is None else abs(span)
    return (right - far, right) if kind == "L" else (right, right + far)


def _bound(path: Path, bounds, columns, lb, ub):
    lower = {words[2] for words in bounds if words[0] in ("FR", "MI", "LO", "FX")}
    for kind, _, name, *value in bounds:
        if kind not in ("FR", "MI", "LO", "UP", "FX", "PL"):
            raise FileError(f"{path}: a bound of kind {kind!r} is not read; known are FR, MI, PL, LO, UP and FX.")
        j, number = columns[name], float(value[0]) if value else 0.0
        if kind in ("FR", "MI", "LO", "FX"):
            lb[j] = number if kind in ("LO", "FX") else -np.inf
        if kind in ("UP", "FX", "PL"):
            ub[j] = np.inf if kind == "PL" else number
    _require_clear_bounds(path, columns, lower, ub)


def _require_clear_bounds(path: Path, columns: dict[str, int], lower: set[str], ub: np.ndarray):
    for name, j in columns.items():
        if ub[j] < 0.0 and name not in lower:  # for some readers the lowest value is then −∞, for others 0
            raise FileError(
                f"{path}: {name!r} has the upper bound {ub[j]:g} and no lower one, which is not clear: say LO or MI."
            )


def _triplets(entries):
    rows, columns, values = ([entry[k] for entry in entries] for k in range(3))
    return np.array(values, dtype=float), (np.array(rows, dtype=int), np.array(columns, dtype=int))


def _comments(instance: SuiteInstance, names: list[str]):
    reference = instance.reference
    yield f"* {instance.name}: {instance.story}"
    yield f"* class {instance.kind}, verdict {instance.verdict}"
    yield from (f"* unit {name} {unit}" for name, unit in zip(names, instance.units, strict=True))
    if reference is None:
        return
    yield f"* reference: residual {reference.residual:.1e}, digits {reference.digits:.1f}; value and residual follow"
    rows = [f"e{i}" for i in range(instance.b.size)], [f"i{i}" for i in range(instance.h.size)]
    for title, of, value in zip(
        ("x", "y", "z", "z_box"),
        (names, *rows, names),
        (reference.x, reference.y, reference.z, reference.z_box),
        strict=True,
    ):
        yield from (
            f"* {title} {name} {_text(hi)} {_text(lo)}" for name, hi, lo in zip(of, value.hi, value.lo, strict=False)
        )
    yield from (f"* ray {name} {_text(value)}" for name, value in zip(names, reference.ray, strict=False))
    yield "* active " + " ".join([*(f"i{i}" for i in reference.active), *(names[j] for j in reference.active_bounds)])


def _word(name: str) -> str:
    return "_".join(name.split())


def _text(value: float) -> str:
    return repr(float(value))
