"""Files of problems in a folder as instances of the comparison, in the formats in which others write theirs."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy import sparse

from gauss.bench.instances import Instance, of_arrays
from gauss.bench.suite import read_fclib, read_npz, read_qps
from gauss.bench.suite_instances import of_suite_instance
from gauss.errors import FileError
from gauss.io.checked_arrays import read_arrays, require_programme, require_real, require_sparse

INFINITE_BOUND = 1e20  # larger bounds are infinite: the convention of the files of Matlab, and of SIF before them


def of_folder(folder: Path) -> Iterator[Instance]:
    """Instances of the files of problems in a folder; their class is its name, unless they name one.

    Files end in .npz, as ``qpsolvers.Problem.save`` or ``gauss problems suite`` write them, the latter with references; in
    .mat with P, q, A, l, u of l ≤ A x ≤ u, as the Maros–Mészáros problems are distributed for OSQP; in .mps or .qps (free
    MPS, with a section QUADOBJ or QMATRIX); or in .hdf5 (FCLIB: contact problems with friction).

    FileError if there is none, or one cannot be read.
    """
    paths = sorted(path for path in Path(folder).glob("*") if path.suffix.lower() in READERS and path.is_file())
    if not paths:
        raise FileError(f"{folder}: no {' or '.join(READERS)} files of problems.")
    for path in paths:
        yield _read(path, Path(folder).name or "folder")


def _read(path: Path, group: str) -> Instance:
    """Instance of a file; whatever is wrong with it, a FileError names it."""
    try:
        found = READERS[path.suffix.lower()](path, group)
        assert found.matrices is not None  # programmes of files are no compulsions
        require_programme(*found.matrices)
    except FileError:
        raise
    except (OSError, ValueError) as error:
        raise FileError(f"{path}: {error}") from None
    except Exception as error:  # readers of foreign formats raise anything
        raise FileError(f"{path}: cannot be read as {path.suffix}: {type(error).__name__}: {error}") from None
    return found


def _of_npz(path: Path, group: str) -> Instance:
    """Instance of a file of the suite, or of qpsolvers."""
    data = read_arrays(path)
    if "P_data" in data and "variables" in data:
        return of_suite_instance(read_npz(path))
    require_real(**{name: part for name, part in data.items() if part is not None})
    P, q = (_given(data, name) for name in ("P", "q"))
    rows = _one_sided(sparse.eye_array(q.size, format="csr"), _bound(data, "lb", -np.inf, q), _bound(data, "ub", np.inf, q))
    if data.get("G") is not None or data.get("h") is not None:
        rows.insert(0, (sparse.csr_matrix(_given(data, "G")), _given(data, "h")))
    has_equalities = data.get("A") is not None or data.get("b") is not None
    equalities = (_given(data, "A"), _given(data, "b")) if has_equalities else (None, None)
    return of_arrays(path.stem, group, P, q, *equalities, *_stacked(rows))


def _given(data: Mapping[str, np.ndarray | None], name: str) -> np.ndarray:
    """Array of a file of qpsolvers; a ValueError if there is none."""
    found = data.get(name)
    if found is None:
        raise ValueError(f"no {name}; expected P, q, G with h, A with b, lb, ub, as qpsolvers saves them.")
    return found


def _bound(data: Mapping[str, np.ndarray | None], name: str, default: float, q: np.ndarray) -> np.ndarray:
    """Bounds of a file of qpsolvers, infinite ones if there are none; a ValueError if they are not one an unknown."""
    found = data.get(name)
    if found is None:
        return np.full(q.size, default)
    if found.shape != q.shape:
        raise ValueError(f"{name} has shape {found.shape}, expected {q.shape}.")
    return found


def _of_mat(path: Path, group: str) -> Instance:
    """Instance of a file of Matlab with l ≤ A x ≤ u."""
    from scipy import io

    data = io.loadmat(path)
    missing = [name for name in ("P", "q", "A", "l", "u") if name not in data]
    if missing:
        raise ValueError(f"no {', '.join(missing)}; expected P, q, A, l, u of ½ xᵀPx + qᵀx → min subject to l ≤ Ax ≤ u.")
    if np.size(data.get("cones", ())):
        raise ValueError("it has cones; expected a quadratic programme.")
    require_sparse("P", data["P"])
    require_sparse("A", data["A"])
    require_real(**{name: data[name] for name in ("P", "A")})
    rows = sparse.csr_matrix(data["A"], dtype=float)  # Matlab's files hold whole numbers as integers, unsigned ones, too
    q, lower, upper = (np.ravel(data[name]).astype(float) for name in ("q", "l", "u"))
    if rows.shape != (lower.size, q.size) or upper.size != lower.size or data["P"].shape != (q.size, q.size):
        raise ValueError("P, q, A, l, u have shapes that do not belong together.")
    require_real(q=q, l=lower, u=upper)
    held = lower == upper
    sides = _one_sided(rows[~held], lower[~held], upper[~held])
    P = sparse.csc_matrix(data["P"], dtype=float)
    return of_arrays(path.stem, group, P, q, rows[held], upper[held], *_stacked(sides))


def _of_qps(path: Path, group: str) -> Instance:
    return replace(of_suite_instance(read_qps(path)), group=group)


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
