"""Contact problems as files of FCLIB, the library of frictional contact problems: HDF5, group "fclib_local".

Acary, Brémond, Koziara, Pérignon, FCLIB: a collection of discrete 3D frictional contact problems, INRIA RT-444, 2014.
Matrices are compressed columns, as in CSparse; the solution is the group "solution". Needs pip install h5py.
"""

from os import PathLike
from pathlib import Path

import numpy as np
from scipy.sparse import csc_matrix, csr_matrix

from gauss.dynamics.contact.friction_problem import FrictionProblem
from gauss.errors import ArgumentError, FileError, extra, require

COLUMNS, ROWS = -1, -2  # of "nz": compressed columns, or rows; else the number of triplets
ENTRIES = "p", "i", "x"
NAMES = "info/contacts"  # of our own
MATHEMATICS = "u = W r + q in local frames (normal, two tangents)"


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
    W = csc_matrix(problem.W)
    with _h5py().File(path, "w") as file:
        local = file.create_group("fclib_local")
        local["spacedim"] = np.array([3], dtype=np.int32)
        matrix = local.create_group("W")
        for name, number in (("nzmax", W.nnz), ("m", W.shape[0]), ("n", W.shape[1]), ("nz", COLUMNS)):
            matrix[name] = np.array([number], dtype=np.int32)
        matrix["p"], matrix["i"], matrix["x"] = W.indptr.astype(np.int32), W.indices.astype(np.int32), W.data
        local["vectors/q"], local["vectors/mu"] = problem.q, problem.mu
        for name, text in (("title", title), ("description", "one step of gauss"), ("math_info", MATHEMATICS)):
            local[f"info/{name}"] = np.bytes_(text.encode())  # of fixed length, as FCLIB reads them
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
        If the file is missing, is none of FCLIB, or holds a problem in the plane, in global form, or with equality rows, or
        a number that is not finite.
    """
    h5py = _h5py()
    if not Path(path).is_file():
        raise FileError(f"no file {str(path)!r}.")
    if not h5py.is_hdf5(path):
        raise FileError(f"{str(path)!r} is no HDF5 file.")
    with h5py.File(path, "r") as file:
        if "fclib_local" not in file:
            raise FileError(
                f"{str(path)!r}: expected the group 'fclib_local', found {', '.join(map(repr, file)) or 'none'}."
            )
        local = file["fclib_local"]
        if int(np.ravel(local["spacedim"])[0]) != 3 or "R" in local:
            raise FileError(f"{str(path)!r}: expected contacts in space without equality rows.")
        W, vectors = _matrix(local["W"]), local["vectors"]
        q, mu = (np.asarray(vectors[name], dtype=float) for name in ("q", "mu"))
        if W.shape != (q.size, q.size) or q.size != 3 * mu.size:
            raise FileError(f"{str(path)!r}: W has shape {W.shape}, q {q.shape}, mu {mu.shape}; expected 3 rows a contact.")
        r = np.asarray(file["solution/r"], dtype=float) if "solution/r" in file else None
        if not _are_finite(W, q, mu, r):
            raise FileError(f"{str(path)!r}: expected finite numbers.")
        names = _names(local, mu.size)
    return FrictionProblem(W, q, mu, names), r


def _are_finite(*parts) -> bool:
    return all(np.isfinite(part).all() for part in parts if part is not None)


def _matrix(group) -> np.ndarray:
    kind, shape = (int(np.ravel(group["nz"])[0]), tuple(int(np.ravel(group[name])[0]) for name in ("m", "n")))
    p, i, x = (np.asarray(group[name]) for name in ENTRIES)
    if kind in (COLUMNS, ROWS):
        return (csc_matrix if kind == COLUMNS else csr_matrix)((x, i, p), shape=shape).toarray()
    found = np.zeros(shape)
    np.add.at(found, (i[:kind], p[:kind]), x[:kind])  # CSparse: i are rows, p columns of triplets
    return found


def _names(local, count: int) -> tuple[str, ...]:
    if NAMES not in local:
        return tuple(f"contact {k}" for k in range(count))
    return tuple(name.decode() if isinstance(name, bytes) else str(name) for name in np.asarray(local[NAMES]).tolist())


def _h5py():
    with extra("results"):
        import h5py
    return h5py
