"""Files of problems in a folder as instances of the comparison, in the formats in which others write theirs."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from scipy import sparse

from gauss.bench.instances import Instance, of_arrays
from gauss.bench.suite import read_fclib, read_npz, read_qps
from gauss.bench.suite_instances import of_suite_instance
from gauss.errors import FileError

INFINITE_BOUND = 1e20  # larger bounds are infinite: the convention of the files of Matlab, and of SIF before them


def of_folder(folder: Path) -> Iterator[Instance]:
    """Instances of the files of problems in a folder; their class is its name, unless they name one.

    Files end in .npz, as ``qpsolvers.Problem.save`` or ``gauss problems suite`` write them, the latter with references; in
    .mat with P, q, A, l, u of l ≤ A x ≤ u, as the Maros–Mészáros problems are distributed for OSQP; in .mps or .qps (free
    MPS, with a section QUADOBJ or QMATRIX); or in .hdf5 (FCLIB: contact problems with friction).

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
            yield READERS[path.suffix](path, Path(folder).name or "folder")
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise FileError(f"{path}: {error}") from None


def _of_npz(path: Path, group: str) -> Instance:
    """Instance of a file of the suite, or of qpsolvers."""
    import qpsolvers

    with np.load(path, allow_pickle=False) as data:
        of_the_suite = "P_data" in data.files and "variables" in data.files
    if of_the_suite:
        return of_suite_instance(read_npz(path))
    P, q, G, h, A, b, lb, ub = qpsolvers.Problem.load(str(path)).unpack()
    rows = [] if G is None else [(sparse.csr_matrix(G), h)]
    nothing = np.full(q.size, np.inf)
    lb, ub = (-nothing if lb is None else lb), (nothing if ub is None else ub)
    rows += _one_sided(sparse.eye_array(q.size, format="csr"), np.asarray(lb), np.asarray(ub))
    return of_arrays(path.stem, group, P, q, A, b, *_stacked(rows))


def _of_mat(path: Path, group: str) -> Instance:
    """Instance of a file of Matlab with l ≤ A x ≤ u."""
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
    P = sparse.csc_matrix(data["P"], dtype=float)
    return of_arrays(path.stem, group, P, q, rows[held], upper[held], *_stacked(sides))


def _of_qps(path: Path, _: str) -> Instance:
    return of_suite_instance(read_qps(path))


def _of_fclib(path: Path, _: str) -> Instance:
    return of_suite_instance(read_fclib(path))


READERS = {".npz": _of_npz, ".mat": _of_mat, ".mps": _of_qps, ".qps": _of_qps, ".hdf5": _of_fclib}


def _one_sided(rows, lower: np.ndarray, upper: np.ndarray) -> list:
    """Rows of G x ≤ h and their h, for lower ≤ rows x ≤ upper."""
    above, below = upper < INFINITE_BOUND, lower > -INFINITE_BOUND
    return [(rows[above], upper[above]), (-rows[below], -lower[below])]


def _stacked(rows: list):
    """G and h; None where there is no row."""
    rows = [(matrix, right) for matrix, right in rows if np.size(right)]
    if not rows:
        return None, None
    return sparse.vstack([matrix for matrix, _ in rows]), np.concatenate([right for _, right in rows])
