"""Arrays of untrusted files, checked before use: nothing is unpickled, no size fills the memory.

Sparse matrices of any file are checked entry by entry, for an index beyond the shape would read and write beyond the arrays.
"""

import zipfile
from pathlib import Path

import numpy as np
from scipy import sparse

LARGEST_FILE = 2e9  # bytes of all arrays of a file, unpacked
REAL_KINDS = "biuf"  # kinds of arrays that hold real numbers
ASYMMETRY_RELATIVE = 1e-9  # of the largest entry: Hessians of others are symmetric to rounding, or are one triangle


def read_arrays(path: Path) -> dict[str, np.ndarray | None]:
    """Arrays of an .npz file by name; None where the pickle of a single object stands for nothing, as qpsolvers writes it.

    ValueError if it is no such file, holds other objects, or more than :data:`LARGEST_FILE`.
    """
    with zipfile.ZipFile(path) as archive:
        members = [member for member in archive.infolist() if member.filename.endswith(".npy")]
        require_small(sum(member.file_size for member in members))
        kinds = {}
        for member in members:
            with archive.open(member) as file:
                kinds[member.filename.removesuffix(".npy")] = _header(member.filename, file, member.file_size)
    with np.load(path, allow_pickle=False) as data:
        return {name: None if kind.hasobject else data[name] for name, kind in kinds.items()}


def _header(name: str, file, size: int) -> np.dtype:
    """Kind of the numbers of an array, whose shape needs no more bytes than there are."""
    version = np.lib.format.read_magic(file)
    read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, _, kind = read(file)
    if kind.hasobject and shape != ():
        raise ValueError(f"{name} holds objects of Python, which are not read; expected numbers.")
    if any(extent < 0 for extent in shape) or int(np.prod(shape, dtype=object)) * kind.itemsize > max(size, kind.itemsize):
        raise ValueError(f"{name} claims the shape {shape}, which is more than the file holds.")
    return kind


def require_small(size: float):
    """Refuse a file whose arrays need too many bytes; ValueError if there are more than :data:`LARGEST_FILE`."""
    if size > LARGEST_FILE:
        raise ValueError(f"its arrays need {size / 1e9:.3g} GB, more than {LARGEST_FILE / 1e9:g}.")


def require_sparse(name: str, matrix):
    """Refuse a sparse matrix with indices beyond its shape.

    ValueError naming the matrix.
    """
    if not sparse.issparse(matrix) or matrix.format not in ("csc", "csr"):
        return
    try:
        matrix.check_format(full_check=True)
    except ValueError as error:
        raise ValueError(f"{name}: {error}.") from None


def require_real(**parts):
    """Refuse matrices and vectors that hold other things than real numbers, or nan.

    ValueError naming the first of them.
    """
    for name, part in parts.items():
        values = part.data if sparse.issparse(part) else np.asarray(part)
        if values.dtype.kind not in REAL_KINDS:
            raise ValueError(f"{name} holds {values.dtype}, expected real numbers.")
        if np.isnan(values).any():
            raise ValueError(f"{name} holds nan.")


def require_symmetric(name: str, matrix):
    """Refuse a matrix that is not symmetric, as one triangle: solvers read the one or the other, or both.

    ValueError naming the matrix.
    """
    found = sparse.csc_array(matrix)
    if found.shape[0] != found.shape[1]:
        raise ValueError(f"{name} has shape {found.shape}, expected a square matrix.")
    difference, largest = (float(abs(one).max()) if one.nnz else 0.0 for one in (found - found.T, found))
    if difference > ASYMMETRY_RELATIVE * largest:
        raise ValueError(f"{name} is not symmetric, by {difference:.3g} of {largest:.3g}; expected both of its triangles.")


def require_programme(P, q, A, b, G, h):
    """Refuse matrices and vectors that are no quadratic programme.

    ValueError if shapes do not belong together, P is not symmetric, numbers but right-hand sides of inequalities are not
    finite, or nothing is asked.
    """
    n = np.size(q)
    expected = {"P": (n, n), "q": (n,), "A": (np.size(b), n), "b": (np.size(b),), "G": (np.size(h), n), "h": (np.size(h),)}
    for (name, shape), part in zip(expected.items(), (P, q, A, b, G, h), strict=True):
        if part.shape != shape:
            raise ValueError(f"{name} has shape {part.shape}, expected {shape}.")
        values = part.data if sparse.issparse(part) else part
        if np.isnan(values).any() or (name != "h" and np.isinf(values).any()):
            raise ValueError(f"{name} holds numbers that are not finite.")
    if not n:
        raise ValueError("it has no unknowns.")
    require_symmetric("P", P)
