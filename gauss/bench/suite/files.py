"""The suite as files that others read: sparse arrays of numpy and Matlab, QPS, FCLIB, and a test set of qpbenchmark.

Each file holds the data, names and units of the variables, the story, the verdict, and the reference with its active set
in two doubles a number, x + x_low. ``manifest.json`` tells of all files, with their SHA-256 and that of the whole; ``data``
is that of the numbers of a programme alone, the same in every format.
"""

import hashlib
import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from scipy import io, sparse

from gauss.bench.export import file_name
from gauss.bench.suite import fclib, qps
from gauss.bench.suite.catalogue import CLASSES, VERSION
from gauss.bench.suite.doubled import zeros
from gauss.bench.suite.instance import SuiteInstance, SuiteReference
from gauss.errors import FileError, did_you_mean, writing
from gauss.io.checked_arrays import require_sparse
from gauss.linkages.doubled import Doubled

MATRICES, VECTORS = ("P", "A", "G"), ("q", "b", "h", "lb", "ub", "friction")
TEXTS = ("name", "kind", "story", "verdict", "sequence")
WIDE = ("x", "y", "z", "z_box")
PLAIN = ("active", "active_bounds", "residual", "digits", "contradiction", "unique", "ray")
MAT_HEADER = b"MATLAB 5.0 MAT-file, gauss problems"  # without the time that scipy writes: files are the same every time

TEST_SET = '''"""Quadratic programmes of mechanics as a test set of qpbenchmark.

    qpbenchmark --results-path results.csv gauss_suite.py run --author me
"""

from pathlib import Path

import numpy as np
from qpbenchmark import Problem, TestSet
from scipy.sparse import csc_matrix


class GaussSuite(TestSet):
    """The programmes in the .npz files beside this file that have a solution and no cones."""

    title = "Gauss suite"
    description = "Quadratic programmes of mechanics, by classes."
    sparse_only = True

    def __iter__(self):
        """Yield the programmes by name."""
        for file in sorted(Path(__file__).parent.glob("*.npz")):
            with np.load(file, allow_pickle=False) as data:
                if str(data["verdict"]) != "solved" or data["cones"].size:
                    continue
                P, A, G = (
                    csc_matrix((data[f"{M}_data"], data[f"{M}_indices"], data[f"{M}_indptr"]), shape=data[f"{M}_shape"])
                    for M in "PAG"
                )
                A, b = (A, data["b"]) if data["b"].size else (None, None)
                G, h = (G, data["h"]) if data["h"].size else (None, None)
                bounds = (v if np.isfinite(v).any() else None for v in (data["lb"], data["ub"]))
                yield Problem(P, data["q"], G, h, A, b, *bounds, name=str(data["name"]))
'''


def export_suite(instances: Iterable[SuiteInstance], folder: Path, kind: str) -> list[Path]:
    """Write instances, one file each, and a manifest; return the files.

    Parameters
    ----------
    instances : iterable of Instance
        Each with its reference.
    folder : Path
        Where; made if it is not there.
    kind : str
        * "npz": sparse arrays, see :func:`read_npz`;
        * "qpbenchmark": the same, and the module of a test set beside them;
        * "mat": P, q, A, l, u as the Maros–Mészáros problems are distributed for OSQP, and all else;
        * "qps": free MPS with a section QUADOBJ; instances without cones only;
        * "fclib": HDF5 of the Frictional Contact Library; instances of Coulomb's law only.

    Raises
    ------
    FileError
        If there is no such kind, two instances have one file name, or none can be written in it.
    """
    writers = {
        "npz": write_npz,
        "qpbenchmark": write_npz,
        "mat": write_mat,
        "qps": qps.write_qps,
        "fclib": fclib.write_fclib,
    }
    if kind not in writers:
        raise FileError(f"no format {kind!r} of the suite. {did_you_mean(kind, writers)}")
    ending = {"qpbenchmark": "npz", "fclib": "hdf5", "qps": "mps"}.get(kind, kind)
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
    paths, entries = [], []
    for instance in instances:
        if (kind == "qps" and instance.cones) or (kind == "fclib" and not instance.friction.size):
            continue
        path = folder / f"{file_name(instance.name)}.{ending}"
        if path in paths:
            raise FileError(f"{path}: two instances have this file name.")
        writers[kind](path, instance)
        paths.append(path)
        entries.append(_entry(path, instance))
    if not paths:
        raise FileError(
            f"none of the instances can be written as {kind!r}: qps takes those without cones, fclib those of Coulomb's law."
        )
    if kind == "qpbenchmark":
        paths.append(folder / "gauss_suite.py")
        paths[-1].write_text(TEST_SET, encoding="utf-8")
    paths.append(folder / "manifest.json")
    paths[-1].write_text(json.dumps(_manifest(kind, entries), indent=1) + "\n", encoding="utf-8")
    return paths


def write_npz(path: Path, instance: SuiteInstance):
    """Write an instance as sparse arrays: of a matrix M the parts M_data, M_indices, M_indptr and M_shape (CSC)."""
    np.savez_compressed(path, **_arrays(instance))


def read_npz(path: Path) -> SuiteInstance:
    """Read an instance as :func:`write_npz` wrote it, every number as it was."""
    with np.load(path, allow_pickle=False) as data:
        parts = ("data", "indices", "indptr")
        matrices = {
            M: sparse.csc_matrix(tuple(data[f"{M}_{part}"] for part in parts), shape=tuple(data[f"{M}_shape"]))
            for M in MATRICES
        }
        for M, matrix in matrices.items():
            require_sparse(M, matrix)
        wide: dict[str, Any] = {name: Doubled(data[name], data[f"{name}_low"]) for name in WIDE}
        plain = {name: data[name] if data[name].ndim else data[name].item() for name in PLAIN}
        fields: dict[str, Any] = matrices | {name: data[name] for name in VECTORS}
        fields |= {name: str(data[name]) for name in TEXTS}
        fields |= {name: tuple(data[name].tolist()) for name in ("variables", "units", "cones", "stages")}
        return SuiteInstance(**fields, reference=SuiteReference(**(wide | plain)))


def write_mat(path: Path, instance: SuiteInstance):
    """Write an instance for Matlab: all of :func:`write_npz`, matrices as such, and l ≤ A x ≤ u of all plain rows."""
    rows = sparse.vstack([instance.A, sparse.csr_array(instance.G)[: instance.orthant], sparse.eye_array(instance.n)])
    below = np.full(instance.orthant, -np.inf)
    found = {
        name: value for name, value in _arrays(instance).items() if "_" not in name or name.endswith("_low") or name in PLAIN
    }
    found |= {name: np.array(found[name], dtype=object) for name in ("variables", "units")}
    found |= {"P": instance.P, "G": instance.G, "A_eq": instance.A}
    found |= {"A": sparse.csc_matrix(rows), "l": np.concatenate([instance.b, below, instance.lb]), "r": 0.0}
    found |= {
        "u": np.concatenate([instance.b, instance.h[: instance.orthant], instance.ub]),
        "z_box": instance.proof.z_box.hi,
    }
    found |= {"m": float(rows.shape[0]), "n": float(instance.n)}
    io.savemat(path, found, do_compression=True, oned_as="column")
    with open(path, "r+b") as file:
        file.write(MAT_HEADER.ljust(116))


def _arrays(instance: SuiteInstance) -> dict:
    """All that an instance holds, as arrays of numbers and texts."""
    reference = instance.reference
    if reference is None:
        nothing = zeros(0)
        reference = SuiteReference(nothing, nothing, nothing, nothing)
    found: dict[str, Any] = {}
    for name in MATRICES:
        M = getattr(instance, name)
        found |= {f"{name}_{part}": getattr(M, part) for part in ("data", "indices", "indptr")}
        found[f"{name}_shape"] = np.array(M.shape)
    found |= {name: getattr(instance, name) for name in VECTORS}
    found |= {name: np.array(getattr(instance, name)) for name in (*TEXTS, "variables", "units")}
    found |= {name: np.array(getattr(instance, name), dtype=int) for name in ("cones", "stages")}
    for name in WIDE:
        value = getattr(reference, name)
        found |= {name: value.hi, f"{name}_low": value.lo}
    return found | {name: np.array(getattr(reference, name)) for name in PLAIN} | {"version": np.array(VERSION)}


def _entry(path: Path, instance: SuiteInstance) -> dict:
    reference = instance.proof
    sizes = {"n": instance.n, "m": instance.b.size, "s": instance.h.size, "cones": len(instance.cones)}
    known_digits = reference.digits if np.isfinite(reference.digits) else None
    return {
        "file": path.name,
        "name": instance.name,
        "class": instance.kind,
        "verdict": instance.verdict,
        **sizes,
        "digits": known_digits and round(known_digits, 1),
        "residual": float(f"{reference.residual:.1e}"),
        "data": fingerprint(instance),
        "sha256": hashlib.sha256(path.read_bytes()).hexdigest(),
    }


def fingerprint(instance: SuiteInstance) -> str:
    """SHA-256 of the numbers of a programme: P, A, G by columns, q, b, h, bounds, friction, cones; no names."""
    found = hashlib.sha256()
    for M in (getattr(instance, name).sorted_indices() for name in MATRICES):
        parts = np.array(M.shape, dtype="<i8"), M.indptr.astype("<i8"), M.indices.astype("<i8"), M.data.astype("<f8")
        found.update(b"".join(part.tobytes() for part in parts))
    for vector in (*(getattr(instance, name) for name in VECTORS), np.array(instance.cones, dtype=float)):
        found.update(vector.astype("<f8").tobytes())
    return found.hexdigest()


def _manifest(kind: str, entries: list[dict]) -> dict:
    """Version, classes, files, and checksums of all: those of the checksums in the order of the names."""
    in_order = sorted(entries, key=lambda entry: entry["name"])
    whole = {
        key: hashlib.sha256("".join(f"{entry[key]}\n" for entry in in_order).encode()).hexdigest()
        for key in ("data", "sha256")
    }
    return {
        "suite": "gauss",
        "version": VERSION,
        "format": kind,
        "classes": {kind: story for kind, story in CLASSES.items() if any(entry["class"] == kind for entry in entries)},
        **whole,
        "instances": entries,
    }
