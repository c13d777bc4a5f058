"""FCLIB: frictional contact problems as HDF5 (Acary, Brémond, Koziara, Pérignon, INRIA RT-0444, 2014), in their local form.

    u = W r + q,   K* ∋ u + μ |u_t| n  ⊥  r ∈ K,   normal first, three numbers a contact

The group ``fclib_local`` holds W (compressed columns), the vectors q and mu, and info; ``solution`` holds u and r. What
FCLIB has no place for, units, names, active set and the lower halves of the reference, stands in a group of its own,
``gauss``.
"""

from pathlib import Path

import numpy as np
from scipy import sparse

from gauss.bench.suite.doubled import product
from gauss.bench.suite.instance import SuiteInstance, programme
from gauss.io.checked_arrays import require_symmetric
from gauss.io.fclib import hdf5, read_local, write_local


def write_fclib(path: Path, instance: SuiteInstance):
    """Write an instance of Coulomb's law; MissingPackageError if h5py is not installed."""
    reference, W = instance.proof, sparse.csc_array(instance.P)
    u = (product(W, reference.x) + instance.q).rounded()
    with hdf5().File(path, "w") as file:
        info = {"title": instance.name, "description": instance.story, "math_info": "units: N s, m/s"}
        write_local(file, W, instance.q, instance.friction, info)
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
    ValueError, KeyError, TypeError, OSError
        If it holds no local form in three dimensions.
    MissingPackageError
        If h5py is not installed.
    """
    with hdf5().File(path, "r") as file:
        local, W, q, friction = read_local(file)
        title = bytes(local["info/title"][()]).decode() if "info/title" in local else path.stem
    require_symmetric("W", W)
    G = -sparse.diags_array(np.column_stack([friction, np.ones((friction.size, 2))]).ravel())
    story, units = f"read from {path.name}", ("N s",) * q.size
    return programme(
        title, "coulomb", story, W, q, G=G, h=np.zeros(q.size), cones=(3,) * friction.size, friction=friction, units=units
    )
