"""Programmes in files: npz of qpsolvers, mat; what is written is read again."""

import numpy as np
import pytest
import qpsolvers
from scipy import io, sparse

from gauss.backends.programme import FORMS
from gauss.bench.export import export
from gauss.bench.folders import of_folder
from gauss.bench.instances import FILE, of_arrays
from gauss.bench.measure import measure
from gauss.bench.problems import UNKNOWN, make_problem
from gauss.bench.summary import (
    is_right,
)
from gauss.errors import BackendError, FileError


@pytest.mark.peer
def test_files_of_qpsolvers_are_instances(tmp_path):
    """Bounds become rows; there is no reference, and residuals judge."""
    P, q, lb, ub = (
        sparse.eye_array(2, format="csc"),
        np.array([-3.0, 1.0]),
        np.array([-np.inf, 0.0]),
        np.array([2.0, np.inf]),
    )
    qpsolvers.Problem(sparse.csc_matrix(P), q, lb=lb, ub=ub).save(str(tmp_path / "bounds.npz"))
    (instance,) = of_folder(tmp_path)
    assert (instance.name, instance.verdict, instance.forms(("F2",))) == ("bounds", UNKNOWN, (FILE,))
    row = measure(instance, "piqp", FILE, "high") | {"level": "high"}
    assert row["outcome"] == "answered" and np.isnan(row["error"]) and is_right(row)
    with pytest.raises(BackendError, match="take a compulsion"):
        measure(instance, "recursion", FILE, "own")
    with pytest.raises(FileError, match="no .npz or .mat"):
        list(of_folder(tmp_path / "empty"))
    known = of_arrays("known", "mine", P, q, None, None, np.eye(2), np.array([2.0, 5.0]), x=np.array([2.0, -1.0]))
    assert is_right(measure(known, "daqp", FILE, "high"))


@pytest.mark.parametrize("kind", ["npz", "mat"])
@pytest.mark.parametrize("name", ["box on 4 points", "four-bar"])
def test_problems_that_are_written_are_read_again(tmp_path, kind, name):
    """In both forms of files, every number of a programme with inequality rows, and of one without."""
    problem = make_problem(name)
    export([problem], tmp_path, kind)
    (instance,) = of_folder(tmp_path)
    expected, found = FORMS["F2"](problem.compulsion), instance.programme(FILE)
    for part in ("H", "c", "C", "d", "K", "k"):
        a, b = (x.toarray() if sparse.issparse(x) else x for x in (getattr(expected, part), getattr(found, part)))
        assert np.array_equal(a, b), part


@pytest.mark.parametrize(
    ("change", "said"),
    [({"l": None}, "no l"), ({"u": np.ones(3)}, "shapes"), ({"cones": np.array([3])}, "cones")],
)
def test_files_of_matlab_that_are_no_programmes(tmp_path, change, said):
    whole = {"P": np.eye(2), "q": np.ones(2), "A": np.eye(2), "l": np.zeros(2), "u": np.full(2, 1e20)}
    io.savemat(tmp_path / "it.mat", {name: value for name, value in (whole | change).items() if value is not None})
    with pytest.raises(FileError, match=rf"it\.mat: .*{said}"):
        list(of_folder(tmp_path))


def test_bounds_of_matlab_that_are_infinite_are_none(tmp_path):
    """1e20 is no bound; rows with l = u are equalities, those with both bounds two inequality rows; integers are numbers."""
    bounds = {"l": np.array([0, 0, 1, 3], dtype=np.uint8), "u": [1e20, 1e20, 1.0, 4.0]}
    io.savemat(tmp_path / "it.mat", {"P": np.eye(4, dtype=int), "q": np.ones(4), "A": np.eye(4, dtype=np.uint8)} | bounds)
    (instance,) = of_folder(tmp_path)
    m = instance.matrices
    assert m.A.toarray().tolist() == [[0, 0, 1, 0]] and m.b.tolist() == [1.0]
    assert sorted(zip(m.G.toarray().tolist(), m.h.tolist(), strict=True)) == [
        ([-1, 0, 0, 0], 0.0),
        ([0, -1, 0, 0], 0.0),
        ([0, 0, 0, -1], -3.0),
        ([0, 0, 0, 1], 4.0),
    ]
