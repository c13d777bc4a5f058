"""Files of problems from anybody: nothing is executed, nothing fills the memory, errors name the file."""

import io
import os
import pickle
import zipfile

import numpy as np
import pytest
from scipy import sparse
from scipy.io import savemat

from gauss.bench.folders import of_folder
from gauss.bench.publish import publish
from gauss.bench.qp import compare
from gauss.errors import FileError

NONE = np.array(None)  # how qpsolvers writes what is not there
PLAIN = {"P": np.eye(2), "q": np.ones(2), "A": np.ones((1, 2)), "b": np.ones(1)} | dict.fromkeys(
    ("G", "h", "lb", "ub"), NONE
)
MPS = "NAME it\nROWS\n N cost\n E row\nCOLUMNS\n x cost 1 row 1\n y row 1\nRHS\n right row 1\nENDATA\n"
FCLIB = {"p": [0, 1, 2, 3], "i": [0, 1, 2], "x": [1.0, 1.0, 1.0], "q": [1.0, 0.0, 0.0], "mu": [0.3]}


class Executed:
    """An object that makes a file when it is unpickled."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return os.mkdir, (str(self.path),)


@pytest.mark.parametrize("change", ["P", "G"])
def test_no_pickle_is_opened(tmp_path, change):
    made = tmp_path / "made"
    np.savez(tmp_path / "it.npz", **PLAIN | {change: np.array([Executed(made)], dtype=object)})
    with pytest.raises(FileError, match=rf"{change}.npy holds objects"):
        list(of_folder(tmp_path))
    (tmp_path / "it.npz").write_bytes(pickle.dumps(Executed(made)))
    with pytest.raises(FileError):
        list(of_folder(tmp_path))
    assert not made.exists()


def _header(shape) -> bytes:
    found = io.BytesIO()
    np.lib.format.write_array_header_1_0(found, {"descr": "<f8", "fortran_order": False, "shape": shape})
    return found.getvalue()


@pytest.mark.parametrize("shape", [(10**9, 10**9), (40_000, 40_000), (-1, 2)])
def test_shapes_that_a_file_does_not_hold_are_refused(tmp_path, shape):
    np.savez(tmp_path / "it.npz", **{name: part for name, part in PLAIN.items() if name != "P"})
    with zipfile.ZipFile(tmp_path / "it.npz", "a") as archive:
        archive.writestr("P.npy", _header(shape))
    with pytest.raises(FileError, match="more than the file holds"):
        list(of_folder(tmp_path))


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"q": np.ones(3)}, "P has shape"),
        ({"b": np.ones(3)}, "A has shape"),
        ({"b": NONE}, "no b"),
        ({"lb": np.zeros(5)}, "lb has shape"),
        ({"P": np.nan * np.eye(2)}, "nan"),
        ({"q": np.full(2, np.inf)}, "not finite"),
        ({"P": 1j * np.eye(2)}, "real numbers"),
        ({"P": NONE}, "no P"),
        ({"P": np.triu(np.ones((2, 2)))}, "not symmetric"),
        ({"P": np.zeros((0, 0)), "q": np.zeros(0), "A": NONE, "b": NONE}, "no unknowns"),
    ],
)
def test_files_of_qpsolvers_that_are_no_programmes(tmp_path, change, says):
    np.savez(tmp_path / "it.npz", **PLAIN | change)
    with pytest.raises(FileError, match=rf"it\.npz: .*{says}"):
        list(of_folder(tmp_path))


@pytest.mark.parametrize(
    "change",
    [
        (" N cost", " N"),
        (" E row", " Q row"),
        ("row 1\nR", "other 1\nR"),
        ("cost 1", "cost nan"),
        ("cost 1", "cost one"),
        (" E row", " E row\n E row"),
        ("right row", "right rwo"),
        ("ENDATA", "QUADOBJ\n x y 1\n y x 1\nENDATA"),
        ("ENDATA", "QMATRIX\n x y 1\nENDATA"),
        (MPS, ""),
    ],
)
def test_files_in_mps_that_are_no_programmes(tmp_path, change):
    path = tmp_path / "it.mps"
    path.write_text(MPS)
    assert len(list(of_folder(tmp_path))) == 1
    path.write_text(MPS.replace(*change))
    with pytest.raises(FileError, match=r"it\.mps"):
        list(of_folder(tmp_path))


@pytest.mark.parametrize("section", ["QUADOBJ\n x x 2\n x y 1\n z y 3", "QMATRIX\n x x 2\n x y 1\n y x 1\n y z 3\n z y 3"])
def test_pairs_of_a_quadratic_cost_count_in_either_order(tmp_path, section):
    (tmp_path / "IT.QPS").write_text(MPS.replace("RHS", " z row 1\nRHS").replace("ENDATA", f"{section}\nENDATA"))
    (instance,) = of_folder(tmp_path)
    assert instance.group == tmp_path.name
    np.testing.assert_array_equal(instance.matrices.P.toarray(), [[2, 1, 0], [1, 0, 3], [0, 3, 0]])


def test_matrices_of_matlab_with_indices_beyond_their_shape(tmp_path):
    P = sparse.csc_matrix(np.eye(2))
    P.indices[1] = 99
    savemat(tmp_path / "it.mat", {"P": P, "q": np.ones(2), "A": np.eye(2), "l": np.zeros(2), "u": np.ones(2)})
    with pytest.raises(FileError, match=r"it\.mat: P: indices"):
        list(of_folder(tmp_path))
    (tmp_path / "it.mat").write_bytes(b"")
    with pytest.raises(FileError, match=r"it\.mat: cannot be read"):
        list(of_folder(tmp_path))


@pytest.mark.parametrize(
    ("change", "says"),
    [({"i": [0, 1, 99]}, "W"), ({"i": [0, 1, -9]}, "W"), ({"mu": [-0.3]}, "friction"), ({"q": [1.0]}, "q")],
)
def test_files_of_fclib_that_are_no_programmes(tmp_path, change, says):
    _write_fclib(tmp_path, FCLIB | change)
    with pytest.raises(FileError, match=rf"it\.hdf5: .*{says}"):
        list(of_folder(tmp_path))


def test_fclib_opens_no_other_file(tmp_path):
    h5py = _write_fclib(tmp_path, FCLIB)
    assert len(list(of_folder(tmp_path))) == 1
    with h5py.File(tmp_path / "it.hdf5", "a") as file:
        del file["fclib_local/W/x"]
        file["fclib_local/W"].create_dataset("x", (3,), dtype="f8", external=[(str(tmp_path / "secret"), 0, 24)])
    with pytest.raises(FileError, match="another file"):
        list(of_folder(tmp_path))


def _write_fclib(folder, parts: dict):
    h5py = pytest.importorskip("h5py")
    with h5py.File(folder / "it.hdf5", "w") as file:
        file["fclib_local/spacedim"] = [3]
        for name, size in (("m", 3), ("n", 3), ("nz", -1)):
            file[f"fclib_local/W/{name}"] = [size]
        for name in "pix":
            file[f"fclib_local/W/{name}"] = parts[name]
        for name in ("q", "mu"):
            file[f"fclib_local/vectors/{name}"] = parts[name]
    return h5py


def test_what_is_no_file_is_left_out(tmp_path):
    (tmp_path / "folder.npz").mkdir()
    os.mkfifo(tmp_path / "pipe.npz")
    with pytest.raises(FileError, match="no .npz"):
        list(of_folder(tmp_path))


@pytest.mark.slow
@pytest.mark.parametrize("level", ["high", "low"])
def test_a_folder_of_problems_has_a_page(tmp_path, level):
    """With one that is infeasible, one without rows, and one that is called like a number."""
    np.savez(tmp_path / "001.npz", **PLAIN)
    np.savez(tmp_path / "nan.npz", **PLAIN | {"lb": np.ones(2), "ub": np.zeros(2)})
    np.savez(tmp_path / "free.npz", **PLAIN | {"A": NONE, "b": NONE})
    given = of_folder(tmp_path)
    table = compare(tmp_path / "out", instances=given, backends=["daqp"], levels=[level], progress=False)
    page, *_ = publish(tmp_path / "out", table.path, None)
    assert all(f"**{name}**" in page.read_text(encoding="utf-8") for name in ("001", "nan", "free"))
