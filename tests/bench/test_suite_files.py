"""Files of the suite: every format reads back, here and by other programs, and its manifest holds checksums."""

import csv
import importlib.util
import json
import sys
from dataclasses import replace

import numpy as np
import pytest
from typer.testing import CliRunner

from gauss.bench.suite import CLASSES, instances, recipes
from gauss.bench.suite.catalogue import checked
from gauss.bench.suite.fclib import read_fclib
from gauss.bench.suite.files import export_suite, fingerprint, read_npz
from gauss.bench.suite.instance import SOLVED
from gauss.bench.suite.qps import read_qps
from gauss.cli import app
from gauss.errors import BackendError, FileError
from tests.support.suite import parts, same


def test_npz_reads_back_to_the_last_bit(few, tmp_path):
    paths = export_suite(few, tmp_path, "npz")
    for instance, path in zip(few, paths, strict=False):
        found = read_npz(path)
        assert all((getattr(found, M) != getattr(instance, M)).nnz == 0 for M in ("P", "A", "G"))
        assert same(
            found, instance, ("q", "b", "h", "lb", "ub", "friction", "cones", "stages", "variables", "units", "story")
        )
        assert same(found.reference, instance.reference, ("active", "active_bounds", "digits", "unique", "ray"))
        for one, other in zip(parts(found.reference), parts(instance.reference), strict=True):
            assert same(one, other, ("hi", "lo"))
        checked(found)


@pytest.mark.peer
def test_qps_reads_back_here_and_in_highs(few, tmp_path):
    highspy = pytest.importorskip("highspy")
    plain = [instance for instance in few if not instance.cones]
    for instance, path in zip(plain, export_suite(few, tmp_path, "qps"), strict=False):
        found, solver = read_qps(path), highspy.Highs()
        assert all((getattr(found, M) != getattr(instance, M)).nnz == 0 for M in ("P", "A", "G"))
        assert same(found, instance, ("q", "b", "h", "lb", "ub"))
        solver.setOptionValue("output_flag", False)
        assert solver.readModel(str(path)) != highspy.HighsStatus.kError
        model = solver.getModel()
        assert model.lp_.num_col_ == instance.n and model.lp_.num_row_ == instance.b.size + instance.h.size
        np.testing.assert_array_equal(model.lp_.col_cost_, instance.q)
        np.testing.assert_array_equal(model.lp_.row_upper_, np.concatenate([instance.b, instance.h]))


RANGES = """* every kind of row and of bound, a range on each kind of row
NAME ranges
ROWS
 N cost
 E up
 E down
 L below
 G above
COLUMNS
 a cost 1.5 up 1
 a below 2
 b up 1 down 1
 b above 3
 c down 4 below 1
 d above 1
 e cost -1
RHS
 rhs up 2 down 3
 rhs below 4 above 5
RANGES
 rng up 0.5 down -0.25
 rng below 1 above 2
BOUNDS
 UP bnd a 4
 MI bnd b
 UP bnd b -1
 FR bnd c
 MI bnd d
 FX bnd e 0.5
QUADOBJ
 a a 2
 a c 0.5
 c c 3
ENDATA
"""


@pytest.mark.peer
def test_qps_with_ranges_is_read_as_highs_reads_it(tmp_path):
    """The same rows, bounds and cost."""
    highspy = pytest.importorskip("highspy")
    path = tmp_path / "ranges.mps"
    path.write_text(RANGES)
    found, solver = read_qps(path), highspy.Highs()
    solver.setOptionValue("output_flag", False)
    solver.readModel(str(path))
    lp = solver.getLp()
    np.testing.assert_array_equal(found.lb, lp.col_lower_)
    np.testing.assert_array_equal(found.ub, lp.col_upper_)
    np.testing.assert_array_equal(found.q, lp.col_cost_)
    np.testing.assert_array_equal(found.P.toarray(), found.P.T.toarray())
    assert found.P[0, 2] == 0.5
    values, starts, rows = np.array(lp.a_matrix_.value_), lp.a_matrix_.start_, np.array(lp.a_matrix_.index_)
    A = np.zeros((lp.num_row_, lp.num_col_))
    for j in range(lp.num_col_):
        A[rows[starts[j] : starts[j + 1]], j] = values[starts[j] : starts[j + 1]]
    wanted = [(*row, side) for row, side in zip(A, lp.row_upper_, strict=True) if np.isfinite(side)]
    wanted += [(*-row, -side) for row, side in zip(A, lp.row_lower_, strict=True) if np.isfinite(side)]
    assert not found.b.size  # ranges make inequalities of all rows
    assert sorted(wanted) == sorted((*row, side) for row, side in zip(found.G.toarray(), found.h, strict=True))


@pytest.mark.parametrize(
    ("change", "says"),
    [((" MI bnd b\n", ""), "'b'.*LO or MI"), (("QUADOBJ", "QCMATRIX q"), "QCMATRIX"), ((" FR bnd c", " BV bnd c"), "'BV'")],
)
def test_qps_that_is_not_read_is_refused(tmp_path, change, says):
    path = tmp_path / "wrong.mps"
    path.write_text(RANGES.replace(*change))
    with pytest.raises(FileError, match=says):
        read_qps(path)


def test_fclib_reads_back_and_holds_the_velocities(few, tmp_path):
    h5py = pytest.importorskip("h5py")
    instance = next(instance for instance in few if instance.friction.size)
    path = export_suite(few, tmp_path, "fclib")[0]
    found = read_fclib(path)
    assert (found.P != instance.P).nnz == 0 and (found.G != instance.G).nnz == 0
    assert same(found, instance, ("q", "friction", "cones"))
    with h5py.File(path) as file:
        r, u = file["solution/r"][()], file["solution/u"][()]
        np.testing.assert_allclose(instance.P @ r + instance.q, u, atol=1e-14 * np.abs(instance.q).max())


def test_mat_holds_the_rows_as_osqp_takes_them(few, tmp_path):
    from scipy.io import loadmat

    plain = [instance for instance in few if instance.verdict == SOLVED and not instance.cones]
    for instance, path in zip(plain, export_suite(plain, tmp_path, "mat"), strict=False):
        found, x = loadmat(path), instance.reference.x.hi
        np.testing.assert_array_equal(found["x"].ravel(), x)
        np.testing.assert_array_equal(found["z_box"].ravel(), instance.reference.z_box.hi)
        assert [str(name[0]) for name in found["variables"].ravel()] == list(instance.variables)
        rows, slack = found["A"] @ x, 1e-12 * (abs(found["A"]) @ np.abs(x)).max()
        assert (rows >= found["l"].ravel() - slack).all() and (rows <= found["u"].ravel() + slack).all()


def test_the_checksum_of_the_data_is_that_of_what_every_format_holds(few, tmp_path):
    """Read back from npz and QPS the numbers have the checksum that all manifests tell."""
    plain = [instance for instance in few if not instance.cones]
    readers = {"npz": read_npz, "qps": read_qps}
    for kind, reader in readers.items():
        *paths, manifest = export_suite(plain, tmp_path / kind, kind)
        mode = [entry["data"] for entry in json.loads(manifest.read_text())["instances"]]
        assert mode == [fingerprint(reader(path)) for path in paths] == [fingerprint(instance) for instance in plain]
    assert len({fingerprint(instance) for instance in few}) == len(few)


@pytest.mark.parametrize("kind", ["npz", "mat", "qps", "fclib"])
def test_files_are_the_same_every_time_and_the_manifest_tells_when_one_changes(few, tmp_path, kind):
    first, again = (json.loads(export_suite(few, tmp_path / side, kind)[-1].read_text()) for side in "ab")
    assert first == again
    wrong = replace(few[-2], friction=2.0 * few[-2].friction) if kind == "fclib" else replace(few[0], q=2.0 * few[0].q)
    changed = [wrong if instance.name == wrong.name else instance for instance in few]
    other = json.loads(export_suite(changed, tmp_path / "c", kind)[-1].read_text())
    assert other["sha256"] != first["sha256"]
    assert sum(a["sha256"] != b["sha256"] for a, b in zip(first["instances"], other["instances"], strict=True)) == 1


@pytest.mark.slow
@pytest.mark.peer
def test_qpbenchmark_takes_the_test_set_and_its_command_runs(few, tmp_path, monkeypatch):
    qpbenchmark = pytest.importorskip("qpbenchmark")
    from qpbenchmark.benchmark import main

    module = export_suite(few, tmp_path, "qpbenchmark")[-2]
    spec = importlib.util.spec_from_file_location("gauss_suite", module)
    loaded = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(loaded)
    test_set = loaded.GaussSuite()
    assert isinstance(test_set, qpbenchmark.TestSet)
    wanted = {instance.name for instance in few if instance.verdict == SOLVED and not instance.cones}
    assert {problem.name for problem in test_set} == wanted
    command = next(line for line in loaded.__doc__.splitlines() if "run" in line).split()
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", [*command, "--solver", "clarabel"])
    main()
    with open("results.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert {row["problem"] for row in rows} == wanted and all(row["found"] == "True" for row in rows)


def test_the_command_writes_what_it_lists(tmp_path):
    listed = CliRunner().invoke(app, ["problems", "classes"])
    assert listed.exit_code == 0 and all(kind in listed.output for kind in CLASSES)
    done = CliRunner().invoke(
        app, ["problems", "suite", "--class", "unbounded", "--format", "qps", "--output", str(tmp_path)]
    )
    assert done.exit_code == 0
    manifest = json.loads((tmp_path / "manifest.json").read_text())
    assert {entry["name"] for entry in manifest["instances"]} == {recipe.name for recipe in recipes("unbounded")}


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        (lambda folder, few: instances(["frictoin"]), "frictoin"),
        (lambda folder, few: instances(["mpc"], ["mpc crane 11"]), "mpc crane 11"),
        (lambda folder, few: export_suite(few, folder, "qpx"), "qpx"),
        (lambda folder, few: export_suite(few[:1], folder, "fclib"), "fclib"),
        (lambda folder, few: export_suite([few[0], few[0]], folder, "npz"), "equality_panda"),
    ],
)
def test_mistakes_are_told(few, tmp_path, wrong, says):
    with pytest.raises((BackendError, FileError), match=says):
        wrong(tmp_path, few)
