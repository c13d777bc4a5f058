"""Classes of quadratic programmes: references right to thirty digits, verdicts that are proven, files that read back."""

import csv
import importlib.util
import json
import sys
from dataclasses import replace
from fractions import Fraction

import mpmath
import numpy as np
import pytest
from typer.testing import CliRunner

from gauss.bench.problems import make_problem
from gauss.bench.reference import reference
from gauss.bench.suite import CLASSES, instances, recipes
from gauss.bench.suite.check import EXACT, ROUNDED, checked
from gauss.bench.suite.classes.mechanisms import of_compulsion
from gauss.bench.suite.doubled import product
from gauss.bench.suite.fclib import read_fclib
from gauss.bench.suite.files import export_suite, fingerprint, read_npz
from gauss.bench.suite.instance import SOLVED, with_reference
from gauss.bench.suite.optimality import residuals
from gauss.bench.suite.qps import read_qps
from gauss.cli import app
from gauss.errors import BackendError, FileError
from gauss.linkages.doubled import Doubled

FEWEST = 200  # instances that the suite is to have
EACH = 3  # instances of a class that are made here; the export makes and checks all
LARGE = ["large net 100"]  # of the large ones: ten thousand unknowns, a thousand of them at a bound
SMALL = 70  # unknowns up to which conditions are checked once more, number by number
SEEN = 1e-18  # relative error of a reference that the check must see: far below doubles, far above its own rounding
FOREIGN = 1e-6  # relative error of a foreign solver's answer at its own tolerance of 1e-10
FIRST = (
    "equality panda",
    "contacts stops 4 F2",
    "infeasible clamp 2^-20",
    "unbounded gears 4",
    "coulomb table 3",
    "mpc crane 10",
)


@pytest.fixture(scope="module")
def some():
    """A few instances of each class, the first and others evenly spread."""
    return {kind: instances([kind], _names(kind)) for kind in CLASSES}


@pytest.fixture(scope="module")
def few(some):
    """One instance of each of the classes that differ in what files hold."""
    return instances(None, FIRST)


def _names(kind: str) -> list[str]:
    names = LARGE if kind == "large" else [recipe.name for recipe in recipes(kind)]
    return names[:: max(1, len(names) // EACH)][:EACH]


def test_there_are_enough_instances_and_all_have_names_of_their_own():
    names = [recipe.name for kind in CLASSES for recipe in recipes(kind)]
    assert len(names) >= FEWEST
    assert len(set(names)) == len(names)


@pytest.mark.parametrize("kind", list(CLASSES))
def test_references_meet_the_conditions_of_optimality(some, kind):
    for instance in some[kind]:
        assert instance.kind == kind and instance.story and len(set(instance.variables)) == instance.n
        if instance.verdict != SOLVED:
            continue
        found = instance.reference
        assert max(residuals(instance, found.x, found.y, found.z, found.z_box)) <= (
            ROUNDED if found.contradiction else EXACT
        )
        if instance.n <= SMALL and not instance.friction.size:
            assert _stationarity(instance) <= EXACT


def _stationarity(instance) -> float:
    """Residual of stationarity, by numbers of 60 digits one by one: other arithmetic than that of the references."""
    found = instance.reference
    with mpmath.workdps(60):
        x, y, z, z_box = ([mpmath.mpf(h) + mpmath.mpf(lo) for h, lo in zip(p.hi, p.lo, strict=True)] for p in _parts(found))
        worst = 0.0
        P, A, G = (matrix.toarray() for matrix in (instance.P, instance.A, instance.G))
        for j in range(instance.n):
            terms = [mpmath.mpf(instance.q[j]), z_box[j]]
            for M, factors in ((P[:, j], x), (A[:, j], y), (G[:, j], z)):
                terms += [mpmath.mpf(M[i]) * factors[i] for i in np.flatnonzero(M)]
            size = sum(abs(term) for term in terms)
            worst = max(worst, float(abs(sum(terms)) / size)) if size > 1e-20 else worst
    return worst


def _parts(found):
    return found.x, found.y, found.z, found.z_box


@pytest.mark.parametrize("part", ["x", "y", "z", "z_box"])
def test_a_wrong_reference_is_refused(few, part):
    """An error that no double shows, in any part that an instance has, is seen by the check."""
    tried = 0
    for instance in few:
        right = getattr(instance.reference, part)
        if instance.verdict != SOLVED or not np.abs(right.hi).max(initial=0.0):
            continue
        tried += 1
        wrong = Doubled(right.hi, right.lo + SEEN * np.abs(right.hi).max() * (np.abs(right.hi) == np.abs(right.hi).max()))
        with pytest.raises(BackendError, match="reference leaves"):
            checked(with_reference(instance, replace(instance.reference, **{part: wrong})))
    assert tried


def test_infeasible_and_unbounded_ones_are_proven_in_rational_arithmetic(some):
    """Certificates hold exactly, but that of noise, whose rows are no round numbers."""
    for instance in [i for i in some["infeasible"] if "noisy" not in i.name]:
        found = instance.reference
        pull = _exactly(instance.A.T, found.y.hi), _exactly(instance.G.T, found.z.hi), [Fraction(v) for v in found.z_box.hi]
        assert not any(map(sum, zip(*pull, strict=True))) and (found.z.hi >= 0).all()
        bounds = np.where(found.z_box.hi > 0, instance.ub, np.where(found.z_box.hi < 0, instance.lb, 0.0))
        sides = (instance.b, found.y.hi), (instance.h, found.z.hi), (bounds, found.z_box.hi)
        assert sum(Fraction(a) * Fraction(b) for one, other in sides for a, b in zip(one, other, strict=True)) < 0
    for instance in some["unbounded"]:
        ray, x = instance.reference.ray, instance.reference.x.hi
        assert not any(_exactly(instance.P, ray)) and not any(_exactly(instance.A, ray)) and instance.q @ ray < 0
        assert all(value <= 0 for value in _exactly(instance.G, ray))
        assert (ray[np.isfinite(instance.ub)] <= 0).all() and (ray[np.isfinite(instance.lb)] >= 0).all()
        assert (instance.A @ x == instance.b).all() and (instance.G @ x <= instance.h).all()


def _exactly(M, v) -> list[Fraction]:
    M = M.tocsr()
    rows = (range(M.indptr[i], M.indptr[i + 1]) for i in range(M.shape[0]))
    return [sum((Fraction(M.data[k]) * Fraction(v[M.indices[k]]) for k in row), Fraction(0)) for row in rows]


def test_a_verdict_without_proof_is_refused(few):
    by_verdict = {instance.verdict: instance for instance in few}
    infeasible, unbounded = by_verdict["infeasible"], by_verdict["unbounded"]
    nothing = Doubled(0.0 * infeasible.reference.z.hi, 0.0 * infeasible.reference.z.hi)
    for wrong in (
        with_reference(infeasible, replace(infeasible.reference, z=nothing)),
        replace(infeasible, h=infeasible.h + 1.0),  # rows that are let out as far can be met
        with_reference(unbounded, replace(unbounded.reference, ray=-unbounded.reference.ray)),
        replace(unbounded, ub=np.ones(unbounded.n)),
    ):
        with pytest.raises(BackendError):
            checked(wrong)


@pytest.mark.parametrize("name", ["ur5", "stewart", "three stops", "light tip 1e-9"])
def test_references_agree_with_those_of_fifty_digits(name):
    """Two ways to extended precision, from the full form and from F2, whose making rounds: they differ by that."""
    compulsion = make_problem(name).compulsion
    found, right = checked(of_compulsion(name, "contacts", "", compulsion)), reference(compulsion)
    np.testing.assert_allclose(found.reference.x.hi, right.a, rtol=1e-12, atol=1e-12 * np.abs(right.a).max())
    assert set(right.active) <= set(found.reference.active)


def test_a_foreign_solver_finds_answers_and_multipliers_of_the_same_signs(some):
    """Signs and places of multipliers are those of qpsolvers, where they are unique."""
    import qpsolvers

    tried = 0
    for kind in ("contacts", "mpc", "scales"):
        for instance in some[kind]:
            if instance.n > 120 or not instance.reference.unique or "1e" in instance.name:
                continue
            rows = {"G": instance.G, "h": instance.h} if instance.h.size else {"G": None, "h": None}
            rows |= {"A": instance.A, "b": instance.b} if instance.b.size else {}
            problem = qpsolvers.Problem(instance.P, instance.q, **rows, lb=instance.lb, ub=instance.ub)
            found = qpsolvers.solve_problem(problem, "clarabel", tol_gap_rel=1e-10, tol_gap_abs=1e-10, tol_feas=1e-10)
            right = instance.reference
            pairs = [(found.x, right.x)] + [(found.z, right.z)] * (instance.h.size > 0)
            pairs += [(found.z_box, right.z_box)] * bool(np.abs(right.z_box.hi).any())
            for got, expected in pairs:
                assert np.abs(got - expected.hi).max() <= FOREIGN * max(np.abs(expected.hi).max(), np.abs(instance.q).max())
                tried += 1
    assert tried > 3


def test_coulombs_law_holds_contact_by_contact(some):
    for instance in some["coulomb"]:
        r = instance.reference.x.hi.reshape(-1, 3)
        u = (product(instance.P, instance.reference.x) + instance.q).rounded().reshape(-1, 3)
        small = 1e-14 * np.abs(instance.q).max(), 1e-14 * np.abs(r).max()
        assert u[:, 0].min() >= -small[0] and r[:, 0].min() >= -small[1]
        assert (np.minimum(u[:, 0] / small[0], r[:, 0] / small[1]) <= 1.0).all()
        rub, slip = np.hypot(*r[:, 1:].T), np.hypot(*u[:, 1:].T)
        assert (rub <= instance.friction * r[:, 0] + small[1]).all()
        slides = (slip > small[0]) & (r[:, 0] > small[1])
        np.testing.assert_allclose(rub[slides], (instance.friction * r[:, 0])[slides], rtol=1e-12)
        assert ((r[:, 1:] * u[:, 1:]).sum(axis=1)[slides] < 0).all()


def test_steps_of_a_sequence_have_one_shape_and_change_what_is_active():
    names = [
        recipe.name for recipe in recipes("sequences") if "dropped box" in recipe.name or "falling chain" in recipe.name
    ]
    steps = instances(["sequences"], names)
    for sequence in {step.sequence for step in steps}:
        own = [step for step in steps if step.sequence == sequence]
        assert len({(step.n, step.b.size, step.h.size, step.variables) for step in own}) == 1
        assert len({tuple(step.reference.active) for step in own}) > 2


def test_stages_of_control_are_banded(some):
    for instance in some["mpc"]:
        steps, n_x, n_u = instance.stages
        assert instance.n == steps * (n_x + n_u) and instance.b.size == steps * n_x
        A = instance.A.tocoo()
        assert (A.col // (n_x + n_u) <= A.row // n_x).all() and (A.row // n_x - A.col // (n_x + n_u) <= 1).all()


def _same(one, other, names) -> bool:
    return all(np.array_equal(getattr(one, name), getattr(other, name)) for name in names)


def test_npz_reads_back_to_the_last_bit(few, tmp_path):
    paths = export_suite(few, tmp_path, "npz")
    for instance, path in zip(few, paths, strict=False):
        found = read_npz(path)
        assert all((getattr(found, M) != getattr(instance, M)).nnz == 0 for M in ("P", "A", "G"))
        assert _same(
            found, instance, ("q", "b", "h", "lb", "ub", "friction", "cones", "stages", "variables", "units", "story")
        )
        assert _same(found.reference, instance.reference, ("active", "active_bounds", "digits", "unique", "ray"))
        for one, other in zip(_parts(found.reference), _parts(instance.reference), strict=True):
            assert _same(one, other, ("hi", "lo"))
        checked(found)


def test_qps_reads_back_here_and_in_highs(few, tmp_path):
    highspy = pytest.importorskip("highspy")
    plain = [instance for instance in few if not instance.cones]
    for instance, path in zip(plain, export_suite(few, tmp_path, "qps"), strict=False):
        found, solver = read_qps(path), highspy.Highs()
        assert all((getattr(found, M) != getattr(instance, M)).nnz == 0 for M in ("P", "A", "G"))
        assert _same(found, instance, ("q", "b", "h", "lb", "ub"))
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
    assert _same(found, instance, ("q", "friction", "cones"))
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
        told = [entry["data"] for entry in json.loads(manifest.read_text())["instances"]]
        assert told == [fingerprint(reader(path)) for path in paths] == [fingerprint(instance) for instance in plain]
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
