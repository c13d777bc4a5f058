"""QPS: free MPS with the section QUADOBJ, as HiGHS, Gurobi, CPLEX and MOSEK read it; every double reads back as it was.

Equality rows are e0, e1, …, inequality rows i0, i1, …; variables keep their names, blanks become underscores. Comments at
the head tell the story and the verdict and hold the reference: a line for each variable, row and bound, in two doubles
whose sum it is.
"""

from pathlib import Path

import numpy as np
from scipy import sparse

from gauss.bench.export import file_name
from gauss.bench.suite.instance import SuiteInstance, programme
from gauss.errors import FileError

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
    for j, name in enumerate(names):
        entries = range(both.indptr[j], both.indptr[j + 1])
        if instance.q[j] or not len(entries):
            lines.append(f" {name} cost {_text(instance.q[j])}")
        lines += [f" {name} {rows[both.indices[k]]} {_text(both.data[k])}" for k in entries]
    right = np.concatenate([instance.b, instance.h])
    lines += ["RHS", *(f" rhs {row} {_text(value)}" for row, value in zip(rows, right, strict=True) if value), "BOUNDS"]
    for name, low, high in zip(names, instance.lb, instance.ub, strict=True):
        if np.isinf(low) and np.isinf(high):
            lines.append(f" FR bnd {name}")
            continue
        lines.append(f" LO bnd {name} {_text(low)}" if np.isfinite(low) else f" MI bnd {name}")
        lines += [f" UP bnd {name} {_text(high)}"] if np.isfinite(high) else []
    lower = sparse.coo_array(sparse.tril(instance.P))
    lines.append("QUADOBJ")
    order = np.lexsort((lower.row, lower.col))
    lines += [f" {names[lower.col[k]]} {names[lower.row[k]]} {_text(lower.data[k])}" for k in order]
    path.write_text("\n".join([*lines, "ENDATA", ""]), encoding="utf-8")


def read_qps(path: Path) -> SuiteInstance:
    """Read a QPS file in free format, with RANGES, QUADOBJ or QMATRIX, but without integers and blanks in names.

    Rows with a range become two inequality rows, rows ≥ are turned round; a constant of the cost is left out.

    Raises
    ------
    FileError
        If a section or a kind of bound is not known.
    """
    section, kinds, columns, cost, entries, right, bounds, quadratic, ranges = "", {}, {}, {}, [], {}, [], [], {}
    objective, name, both_halves = None, path.stem, False
    for line in path.read_text(encoding="utf-8").splitlines():
        if not line.strip() or line.startswith("*"):
            continue
        words = line.split()
        if not line.startswith((" ", "\t")):
            section, name = words[0], words[1] if words[0] == "NAME" and len(words) > 1 else name
            if section not in SECTIONS:
                raise FileError(f"{path}: section {section!r} is not read; known are {', '.join(SECTIONS)}.")
            both_halves = both_halves or section == "QMATRIX"
        elif section == "ROWS":
            kinds[words[1]] = words[0]
            objective = words[1] if words[0] == "N" and objective is None else objective
        elif section == "COLUMNS":
            column = columns.setdefault(words[0], len(columns))
            for row, value in zip(words[1::2], words[2::2], strict=True):
                if row == objective:
                    cost[column] = float(value)
                else:
                    entries.append((row, column, float(value)))
        elif section in ("RHS", "RANGES"):
            found = {row: float(value) for row, value in zip(words[-2::-2], words[-1::-2], strict=False)}
            (right if section == "RHS" else ranges).update(found)
        elif section == "BOUNDS":
            bounds.append(words)
        elif section in ("QUADOBJ", "QMATRIX"):
            quadratic.append((columns[words[0]], columns[words[1]], float(words[2])))
    n = len(columns)
    q, lb, ub = np.zeros(n), np.zeros(n), np.full(n, np.inf)
    for j, value in cost.items():
        q[j] = value
    _bound(path, bounds, columns, lb, ub)
    P = sparse.coo_array(_triplets(quadratic), shape=(n, n))
    P = P if both_halves else P + sparse.triu(P.T, 1) if _is_lower(quadratic) else P + sparse.tril(P.T, -1)
    wanted = {row: _sides(kind, right.get(row, 0.0), ranges.get(row)) for row, kind in kinds.items() if kind != "N"}
    number = {row: i for i, row in enumerate(wanted)}
    known_entries = [(number[row], column, value) for row, column, value in entries if row in number]
    rows = sparse.csr_array(sparse.coo_array(_triplets(known_entries), shape=(len(wanted), n)))
    low, high = np.array(list(wanted.values())).reshape(-1, 2).T
    equal = low == high
    up, down = np.isfinite(high) & ~equal, np.isfinite(low) & ~equal
    G, h = sparse.vstack([rows[up], -rows[down]]), np.concatenate([high[up], -low[down]])
    A, b, names = rows[equal], high[equal], tuple(columns)
    return programme(name, "file", f"read from {path.name}", P, q, A=A, b=b, G=G, h=h, lb=lb, ub=ub, variables=names)


def _sides(kind: str, right: float, span: float | None) -> tuple[float, float]:
    """Lowest and highest value of a row of a kind, with its range if it has one."""
    if kind == "E":
        return (right, right) if span is None else (min(right, right + span), max(right, right + span))
    far = np.inf if span is None else abs(span)
    return (right - far, right) if kind == "L" else (right, right + far)


def _bound(path: Path, bounds, columns, lb, ub):
    lower = {words[2] for words in bounds if words[0] in ("FR", "MI", "LO", "FX")}
    for kind, _, name, *value in bounds:
        j, number = columns[name], float(value[0]) if value else 0.0
        if kind in ("FR", "MI"):
            lb[j] = -np.inf
        elif kind == "LO":
            lb[j] = number
        elif kind == "UP":
            ub[j] = number
        elif kind == "FX":
            lb[j] = ub[j] = number
        elif kind == "PL":
            ub[j] = np.inf
        else:
            raise FileError(f"{path}: a bound of kind {kind!r} is not read; known are FR, MI, PL, LO, UP and FX.")
    for name, j in columns.items():
        if ub[j] < 0.0 and name not in lower:  # for some readers the lowest value is then −∞, for others 0
            raise FileError(
                f"{path}: {name!r} has the upper bound {ub[j]:g} and no lower one, which is not clear: say LO or MI."
            )


def _triplets(entries):
    rows, columns, values = ([entry[k] for entry in entries] for k in range(3))
    return np.array(values, dtype=float), (np.array(rows, dtype=int), np.array(columns, dtype=int))


def _is_lower(quadratic) -> bool:
    """Whether second indices come first: (column, row) pairs of a lower triangle fill the upper one as read."""
    return any(first > second for first, second, _ in quadratic)


def _comments(instance: SuiteInstance, names: list[str]):
    reference = instance.reference
    yield f"* {instance.name}: {instance.story}"
    yield f"* class {instance.kind}, verdict {instance.verdict}"
    yield from (f"* unit {name} {unit}" for name, unit in zip(names, instance.units, strict=True))
    if reference is None:
        return
    yield f"* reference: residual {reference.residual:.1e}, digits {reference.digits:.1f}; value and what it lacks follow"
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
