"""FCLIB: frictional contact problems as HDF5 (Acary, Brémond, Koziara, Pérignon, INRIA RT-0444, 2014), in their local form.

    u = W r + q,   K* ∋ u + μ |u_t| n  ⊥  r ∈ K,   normal first, three numbers a contact

The group ``fclib_local`` holds W (compressed columns), the vectors q and mu, and info; ``solution`` holds u and r. What
FCLIB has no place for, units, names, active set and the lower halves of the reference, stands in a group of its own,
``gauss``.
"""

from pathlib import Path

import numpy as np
from scipy import sparse

from gauss.bench.checked_arrays import require_small, require_sparse, require_symmetric
from gauss.bench.suite.doubled import product
from gauss.bench.suite.instance import SuiteInstance, programme
from gauss.errors import FileError

COLUMNS = -1  # what FCLIB calls compressed columns


def write_fclib(path: Path, instance: SuiteInstance):
    """Write an instance of Coulomb's law.

    Raises
    ------
    FileError
        If h5py is not there.
    """
    h5py = _h5py()
    reference, W = instance.proof, sparse.csc_array(instance.P)
    u = (product(W, reference.x) + instance.q).rounded()
    with h5py.File(path, "w") as file:
        local = file.create_group("fclib_local")
        local["spacedim"] = np.array([3], dtype=np.int32)
        group = local.create_group("W")
        sizes = {"nzmax": W.nnz, "m": W.shape[0], "n": W.shape[1], "nz": COLUMNS}
        for name, value in sizes.items():
            group[name] = np.array([value], dtype=np.int32)
        group["p"], group["i"], group["x"] = W.indptr.astype(np.int32), W.indices.astype(np.int32), W.data
        vectors = local.create_group("vectors")
        vectors["q"], vectors["mu"] = instance.q, instance.friction
        info = local.create_group("info")
        for name, text in {"title": instance.name, "description": instance.story, "math_info": "units: N s, m/s"}.items():
            info[name] = np.bytes_(text.encode())
        solution = file.create_group("solution")
        solution["u"], solution["r"] = u, reference.x.hi
        own = file.create_group("gauss")
        own["r_low"], own["z"], own["z_low"] = reference.x.lo, reference.z.hi, reference.z.lo
        own["active"], own["residual"], own["digits"] = reference.active, reference.residual, reference.digits
        own["variables"], own["units"] = (
            np.array([text.encode() for text in texts]) for texts in (instance.variables, instance.units)
        )


def read_fclib(path: Path) -> SuiteInstance:
    """Read the local form of an FCLIB file as an instance of Coulomb's law, without reference.

    Raises
    ------
    FileError
        If it holds no local form in three dimensions, or h5py is not there.
    """
    h5py = _h5py()
    with h5py.File(path, "r") as file:
        if "fclib_local" not in file or int(np.ravel(file["fclib_local/spacedim"])[0]) != 3:
            raise FileError(f"{path}: expected the group fclib_local with spacedim 3; it has {', '.join(file)}.")
        group, vectors = file["fclib_local/W"], file["fclib_local/vectors"]
        m, n, nz = (int(np.ravel(group[name])[0]) for name in ("m", "n", "nz"))
        p, i, x = (_numbers(group, name) for name in ("p", "i", "x"))
        kinds = {-1: sparse.csc_array, -2: sparse.csr_array}
        W = kinds[nz]((x, i, p), shape=(m, n)) if nz in kinds else sparse.coo_array((x, (i, p)), shape=(m, n))
        require_sparse("W", W)
        require_symmetric("W", W)
        q, friction = _numbers(vectors, "q"), _numbers(vectors, "mu")
        title = bytes(file["fclib_local/info/title"][()]).decode() if "info/title" in file["fclib_local"] else path.stem
    if not (friction >= 0.0).all() or q.size != 3 * friction.size:
        raise FileError(f"{path}: expected a coefficient of friction ≥ 0 for each three of the {q.size} numbers of q.")
    G = -sparse.diags_array(np.column_stack([friction, np.ones((friction.size, 2))]).ravel())
    story, units = f"read from {path.name}", ("N s",) * n
    return programme(
        title, "coulomb", story, W, q, G=G, h=np.zeros(n), cones=(3,) * friction.size, friction=friction, units=units
    )


def _numbers(group, name: str) -> np.ndarray:
    """Numbers of a data set that stand in the file itself."""
    import h5py

    found = group[name]
    if isinstance(group.get(name, getlink=True), h5py.ExternalLink) or found.external or found.is_virtual:
        raise ValueError(f"{name} stands in another file, which is not opened.")
    require_small(found.nbytes)
    return np.ravel(found[()])


def _h5py():
    try:
        import h5py
    except ImportError:
        raise FileError("FCLIB files are HDF5, which takes another package: pip install h5py.") from None
    return h5py
