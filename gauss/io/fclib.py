"""Contact problems as files of FCLIB, the library of frictional contact problems: HDF5, group "fclib_local".

Acary, Brémond, Koziara, Pérignon, FCLIB: a collection of discrete 3D frictional contact problems, INRIA RT-444, 2014.
Matrices are compressed columns, as in CSparse; the solution is the group "solution". Needs pip install h5py. Files are not
trusted: indices are checked, and nothing is read from other files that they link to.
"""

from collections.abc import Mapping
from os import PathLike
from pathlib import Path

import numpy as np
from scipy import sparse

from gauss.dynamics.contact.friction_problem import FrictionProblem
from gauss.errors import ArgumentError, FileError, extra, require
from gauss.io.checked_arrays import REAL_KINDS, require_small, require_sparse

COLUMNS, ROWS = -1, -2  # of "nz": compressed columns, or rows; else the number of triplets
ENTRIES = "p", "i", "x"
NAMES = "info/contacts"  # of our own
MATHEMATICS = "u = W r + q in local frames (normal, two tangents)"
NOT_OF_FCLIB = ValueError, LookupError, TypeError, OSError, AttributeError  # of files with other contents


def save_fclib(problem: FrictionProblem, path: str | PathLike, r: np.ndarray | None = None, title: str = "contacts"):
    """Write a contact problem.

    Parameters
    ----------
    problem : FrictionProblem
        The problem.
    path : str or Path
        The file; one that exists is replaced.
    r : ndarray, shape (3 m,), optional
        Impulses [N s], to be written as its solution.
    title : str
        Its title.

    Raises
    ------
    MissingPackageError
        If h5py is not installed.
    ArgumentError
        If the impulses do not belong to the problem, or a number is not finite.
    """
    require(problem, (FrictionProblem,), "save_fclib")
    if r is not None and np.shape(r) != problem.q.shape:
        raise ArgumentError(f"save_fclib: r has shape {np.shape(r)}, the problem {problem.q.shape}.")
    if not _are_finite(problem.W, problem.q, problem.mu, r):
        raise ArgumentError("save_fclib: expected finite numbers in the problem and its solution.")
    with hdf5().File(path, "w") as file:
        info = {"title": title, "description": "one step of gauss", "math_info": MATHEMATICS}
        local = write_local(file, problem.W, problem.q, problem.mu, info)
        local[NAMES] = np.array([name.encode() for name in problem.names])
        if r is not None:
            file["solution/u"], file["solution/r"] = problem.W @ r + problem.q, np.asarray(r, dtype=float)


def load_fclib(path: str | PathLike) -> tuple[FrictionProblem, np.ndarray | None]:
    """Read a contact problem in local form, and its solution.

    Parameters
    ----------
    path : str or Path
        The file.

    Returns
    -------
    problem : FrictionProblem
        The problem; its contacts are named by their number where the file has no names of gauss.
    r : ndarray, shape (3 m,), or None
        Impulses of the solution [N s].

    Raises
    ------
    MissingPackageError
        If h5py is not installed.
    FileError
        If the file is missing, is none of FCLIB, links to another file, or holds a problem in the plane, in global form, or
        with equality rows, an index beyond its matrix, or a number that is not finite.
    """
    h5py = hdf5()
    if not Path(path).is_file():
        raise FileError(f"no file {str(path)!r}.")
    if not h5py.is_hdf5(path):
        raise FileError(f"{str(path)!r} is no HDF5 file.")
    try:
        with h5py.File(path, "r") as file:
            local, W, q, mu = read_local(file)
            require_small(8.0 * q.size**2)
            r = _numbers(file, "solution/r").astype(float) if "solution/r" in file else None
            if r is not None and r.size != q.size:
                raise ValueError(f"the solution has {r.size} impulses, the problem {q.size}.")
            if not _are_finite(W.data, q, mu, r):
                raise ValueError("expected finite numbers.")
            return FrictionProblem(W.toarray().astype(float), q, mu, _names(local, mu.size)), r
    except NOT_OF_FCLIB as error:
        raise FileError(f"{str(path)!r}: {error.args[0] if error.args else error}") from error


def write_local(file, W, q: np.ndarray, mu: np.ndarray, info: Mapping[str, str]):
    """Write the group of a problem in local form, which is returned.

    Parameters
    ----------
    W : ndarray or sparse array, shape (3 m, 3 m)
        Delassus operator.
    q, mu : ndarray, shape (3 m,), (m,)
        Rates, and coefficients of friction.
    info : mapping of str to str
        Texts about it.
    """
    columns, local = sparse.csc_array(W), file.create_group("fclib_local")
    local["spacedim"] = np.array([3], dtype=np.int32)
    matrix = local.create_group("W")
    for name, number in (("nzmax", columns.nnz), ("m", columns.shape[0]), ("n", columns.shape[1]), ("nz", COLUMNS)):
        matrix[name] = np.array([number], dtype=np.int32)
    arrays = columns.indptr.astype(np.int32), columns.indices.astype(np.int32), columns.data
    for name, array in zip(ENTRIES, arrays, strict=True):
        matrix[name] = array
    local["vectors/q"], local["vectors/mu"] = q, mu
    for name, text in info.items():
        local[f"info/{name}"] = np.bytes_(text.encode())  # of fixed length, as FCLIB reads them
    return local


def read_local(file):
    """Group of a problem in local form, its W (3 m, 3 m), a sparse array, q (3 m,) and μ (m,).

    ValueError, KeyError, TypeError, OSError if there is none, or it is not as FCLIB says; see :data:`NOT_OF_FCLIB`.
    """
    if "fclib_local" not in file:
        raise ValueError(f"expected the group 'fclib_local', found {', '.join(map(repr, file)) or 'none'}.")
    local = _own(file, "fclib_local")
    if int(_numbers(local, "spacedim")[0]) != 3 or "R" in local:
        raise ValueError("expected contacts in space without equality rows.")
    matrix, vectors = _own(local, "W"), _own(local, "vectors")
    q, mu = (_numbers(vectors, name).astype(float) for name in ("q", "mu"))
    m, n = (int(_numbers(matrix, name)[0]) for name in ("m", "n"))
    if (m, n) != (q.size, q.size) or q.size != 3 * mu.size:
        raise ValueError(f"W has shape {(m, n)}, q {q.shape}, mu {mu.shape}; expected 3 rows a contact.")
    if (mu < 0.0).any():
        raise ValueError(f"expected coefficients of friction ≥ 0, got {mu.min()}.")
    return local, _matrix(matrix, (m, n)), q, mu


def _are_finite(*parts) -> bool:
    return all(np.isfinite(part).all() for part in parts if part is not None)


def _matrix(group, shape: tuple[int, int]):
    """Sparse array of compressed columns or rows, or of triplets, whose indices are within its shape."""
    kind, (p, i, x) = int(_numbers(group, "nz")[0]), (_numbers(group, name) for name in ENTRIES)
    if kind in (COLUMNS, ROWS):
        found = (sparse.csc_array if kind == COLUMNS else sparse.csr_array)((x, i, p), shape=shape)
    else:  # CSparse: i are rows, p columns of triplets
        found = sparse.coo_array((x[:kind], (i[:kind], p[:kind])), shape=shape).tocsc()
    require_sparse("W", found)
    return found


def _numbers(group, name: str) -> np.ndarray:
    """Numbers of a data set that stand in the file itself."""
    array = np.ravel(_own(group, name)[()])
    if array.dtype.kind not in REAL_KINDS:
        raise ValueError(f"{name} holds {array.dtype}, expected real numbers.")
    return array


def _own(group, name: str):
    """Group or data set of the file itself, not of another one that it names."""
    elsewhere = ValueError(f"{name} stands in another file, which is not opened.")
    if isinstance(group.get(name, getlink=True), hdf5().ExternalLink):
        raise elsewhere
    found = group[name]
    if found.file.filename != group.file.filename:
        raise elsewhere
    if isinstance(found, hdf5().Dataset):
        if found.external or found.is_virtual:
            raise elsewhere
        require_small(found.nbytes)
    return found


def _names(local, count: int) -> tuple[str, ...]:
    if NAMES not in local:
        return tuple(f"contact {k}" for k in range(count))
    names = np.ravel(_own(local, NAMES)[()]).tolist()
    if len(names) != count:
        raise ValueError(f"{NAMES}: expected {count} names, found {len(names)}.")
    return tuple(name.decode() if isinstance(name, bytes) else str(name) for name in names)


def hdf5():
    """Package h5py; MissingPackageError if it is not installed."""
    with extra("results"):
        import h5py
    return h5py
