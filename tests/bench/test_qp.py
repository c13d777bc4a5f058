"""The comparison of backends: references are right, rows survive interruptions and crashes, files are read by others."""

import csv
import os
import subprocess
import sys
from collections import Counter
from dataclasses import replace
from pathlib import Path

import mpmath
import numpy as np
import pytest
import qpsolvers
from scipy import io

import gauss
from gauss.backends import make
from gauss.backends.programme import FORMS
from gauss.bench.classes import QUICK_PROBLEMS, compare_class, problems_of
from gauss.bench.export import TEST_SET, along, export, without_inequalities
from gauss.bench.instances import FILE, of_arrays
from gauss.bench.levels import POLICIES
from gauss.bench.problems import INCONSISTENT, SELECTION, make_problem
from gauss.bench.qp import compare, quick_backends
from gauss.bench.reference import reference
from gauss.bench.summary import shifted_mean
from gauss.bench.table import ResultTable, read_table
from gauss.bench.worker import Worker
from gauss.cli import app
from gauss.errors import BackendError, FileError
from tests.support import exact

DIGITS = 1e-25  # to which references are refined
ROUNDING = 1e-14
SMALL = ("four-bar", "box on 4 points")


def dies():
    os.kill(os.getpid(), 11)


def answers(number):
    return number + 1


def sleeps():
    import time

    time.sleep(60)


def raises():
    raise ValueError("no such thing")


@pytest.mark.slow
def test_a_worker_survives_whatever_it_calls():
    with Worker() as worker:
        assert worker.call(answers, 1, timeout=20).value == 2
        crashed = worker.call(dies, timeout=20)
        assert crashed.outcome == "crashed" and "SIGSEGV" in crashed.reason
        raised = worker.call(raises, timeout=20)
        assert raised.outcome == "raised" and "no such thing" in raised.reason
        assert worker.call(sleeps, timeout=0.2).outcome == "timed out"
        assert worker.call(answers, 2, timeout=20).value == 3


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ur5", "heavy tip 1e9", "alternating 1e6", "light tip 1e-9"])
def test_references_agree_with_inverse_dynamics_in_60_digits(name):
    """For chains, the reference of the compulsion is right to the rounding of the matrices that describe it."""
    problem = make_problem(name)
    expected = exact.accelerations(problem.system, problem.state, problem.load)
    found = reference(problem.compulsion)
    assert found.last <= DIGITS
    assert exact.relative_error(found.qdd, expected) <= 1e-13


def test_references_agree_with_a_dense_solve_in_50_digits():
    """Four-bar with the redundant rows of its last hinge left out, its KKT matrix eliminated in extended precision."""
    compulsion = make_problem("four-bar").compulsion
    found = reference(compulsion)
    n, p = compulsion.Phi.size, compulsion.P.size
    rows = np.concatenate([compulsion.A, compulsion.B], axis=1)
    kept = []
    for i in range(len(rows)):
        if np.linalg.matrix_rank(rows[[*kept, i]], tol=1e-9) > len(kept):
            kept.append(i)
    K = np.zeros((n + p + len(kept),) * 2)
    K[:n, :n] = np.diag(compulsion.Phi)
    K[n + p :, : n + p], K[: n + p, n + p :] = rows[kept], rows[kept].T
    with mpmath.workdps(50):
        right = mpmath.matrix(np.concatenate([compulsion.impressed, compulsion.P, compulsion.D[kept]]).tolist())
        x = np.array(mpmath.lu_solve(mpmath.matrix(K.tolist()), right), dtype=float).ravel()
    assert np.abs(found.a - x[:n]).max() <= ROUNDING * np.abs(x[:n]).max()
    assert np.abs(found.qdd - x[n : n + p]).max() <= ROUNDING * np.abs(x[n : n + p]).max()


def test_references_refuse_what_has_no_solution():
    """A box between a floor and a ceiling that want to pass through each other."""
    compulsion = make_problem("box on 4 points").compulsion
    G = np.concatenate([compulsion.G, -compulsion.G])
    h = np.concatenate([compulsion.h, np.full(compulsion.h.size, -1.0)])
    with pytest.raises(BackendError, match="no reference"):
        reference(replace(compulsion, G=G, h=h))


@pytest.mark.slow
@pytest.mark.parametrize("name", SELECTION)
def test_every_problem_of_the_selection_has_a_reference(name):
    problem = make_problem(name)
    if problem.verdict == INCONSISTENT:
        rows = np.concatenate([problem.compulsion.A, problem.compulsion.B], axis=1)
        nearest = np.linalg.lstsq(rows, problem.compulsion.D, rcond=1e-12)[0]  # its own residual is far below what is left
        assert np.abs(rows @ nearest - problem.compulsion.D).max() > 1e-9 * np.abs(problem.compulsion.D).max()
        return
    found = reference(problem.compulsion)
    assert found.last <= DIGITS
    solution = gauss.solve(problem.compulsion)
    assert str(solution.status) == "solved"
    assert found.error(problem.compulsion, make_answer(solution)) <= 1e-9


def make_answer(solution):
    parts = solution.a, solution.qdd, solution.multipliers, solution.inequality_multipliers
    return gauss.backends.Answer(*parts)


def test_errors_show_what_residuals_hide():
    """The light tip is off by half of its acceleration: the rows notice nothing."""
    compulsion = make_problem("light tip 1e-9").compulsion
    answer = make("daqp")(compulsion)
    wrong = answer.a.copy()
    wrong[-3:] *= 1.5
    found = reference(compulsion)
    assert found.error(compulsion, answer) <= 1e-9
    assert found.error(compulsion, replace(answer, a=wrong)) > 0.1


@pytest.mark.slow
def test_an_interrupted_comparison_goes_on(tmp_path):
    """Rows are kept, half a row is dropped, and what is there is not measured again."""
    some = {"backends": ["recursion", "daqp"], "forms": ["F2s"], "levels": ["high"], "progress": False}
    first = compare(tmp_path, problems=SMALL[:1], **some)
    lines = first.path.read_text().splitlines(keepends=True)
    first.path.write_text("".join(lines) + lines[-1][:20])
    table = compare(tmp_path, problems=SMALL, **some)
    assert table.path.read_text().startswith("".join(lines))
    rows = read_table(table.path)
    # four-bar: DAQP, recursion, machine code; box: DAQP alone, for the recursion takes no one-sided rows
    assert [(r["problem"], r["backend"]) for r in rows if r["backend"] != "gauss compiled"] == [
        (SMALL[0], "recursion"),
        (SMALL[0], "daqp"),
        (SMALL[1], "daqp"),
    ]
    solved = [r for r in rows if r["backend"] == "daqp"]
    assert all(r["certified"] and r["error"] <= 1e-9 and r["cold"] > 0 and r["library"] > 0 for r in solved)
    assert all(r["lower"] <= r["seconds"] <= r["upper"] for r in solved)
    assert any(line.startswith("numpy==") for line in (tmp_path / "qp.lock").read_text().splitlines())
    assert len(compare(tmp_path, problems=SMALL, **some).rows) == len(rows)


@pytest.mark.slow
def test_rows_of_other_settings_or_numbers_are_measured_again(tmp_path, monkeypatch):
    """A row is known by the digests of its problem and of its solver's settings; it takes the place of the older one."""
    some = {"backends": ["daqp"], "levels": ["high"], "progress": False, "name": "mine"}
    added = []
    add = ResultTable.add
    monkeypatch.setattr(ResultTable, "add", lambda table, row: added.append(row) or add(table, row))

    def measured(size: float) -> int:
        """How many rows are measured for a problem of this size."""
        before = len(added)
        instances = [of_arrays("it", "mine", size * np.eye(2), np.ones(2), np.ones((1, 2)), [1.0], None, None)]
        compare(tmp_path, instances=instances, **some)
        return len(added) - before

    assert [measured(1.0), measured(1.0)] == [1, 0]
    monkeypatch.setitem(POLICIES, "daqp", replace(POLICIES["daqp"], limits={"iter_limit": 77}))
    assert [measured(1.0), measured(1.0), measured(2.0), measured(2.0)] == [1, 0, 1, 0]
    (row,) = read_table(tmp_path / "mine.csv")
    assert row["data"] == added[-1]["data"] and len({(one["data"], one["settings"]) for one in added}) == 3


@pytest.mark.slow
def test_classes_are_asked_at_high_and_a_few_of_their_problems_at_low_and_mid(tmp_path):
    table = compare_class(tmp_path, "infeasible", backends=["clarabel"], progress=False)
    count = Counter(row["level"] for row in table.rows.values())
    assert count == {"high": len(problems_of("infeasible")), "low": QUICK_PROBLEMS, "mid": QUICK_PROBLEMS}
    (form,) = {row["form"] for row in table.rows.values()}
    assert form == FILE and not {"qpax", "jaxopt_osqp"} & set(quick_backends())


def test_tables_do_not_mix_machines(tmp_path):
    ResultTable(tmp_path / "t.csv", ["date", "this machine"], ("key",), ("value",), False).add({"key": "a", "value": 1.0})
    again = ResultTable(tmp_path / "t.csv", ["another date", "this machine"], ("key",), ("value",), False)
    assert again.has(key="a") and again.numbers() == [{"key": "a", "value": 1.0}]
    with pytest.raises(FileError, match="--fresh"):
        ResultTable(tmp_path / "t.csv", ["date", "other machine"], ("key",), ("value",), False)
    with pytest.raises(FileError, match="columns"):
        ResultTable(tmp_path / "t.csv", ["date", "this machine"], ("key",), ("value", "more"), False)
    assert not ResultTable(tmp_path / "t.csv", ["date", "other machine"], ("key",), ("value",), True).rows


def test_tables_hold_any_names_and_words(tmp_path):
    """Of files, which may be called like numbers or comments, and of solvers, which may say anything."""

    def table():
        return ResultTable(tmp_path / "t.csv", ["date", "here"], ("problem",), ("reason",), False)

    said = {"#1": "a\rb", "001": "1.5", "1": "True", "nan": "a\x85b\u2028c", "a\udcff": "\x00", 'a,"b': '"\n#'}
    for problem, reason in said.items():
        table().add({"problem": problem, "reason": reason})
    assert all(table().has(problem=problem) for problem in said)
    found = {row["problem"]: row["reason"] for row in read_table(tmp_path / "t.csv")}
    assert found == {"#1": "a b", "001": "1.5", "1": "True", "nan": "a b c", "a ": " ", 'a,"b': '" #'}


def test_unknown_names_are_refused_at_once(tmp_path):
    with pytest.raises(BackendError, match="no backend 'clarabell'.*clarabel"):
        compare(tmp_path, backends=["clarabell"])
    with pytest.raises(BackendError, match="no problem 'pandas'.*panda"):
        compare(tmp_path, problems=["pandas"])
    with pytest.raises(BackendError, match="no form 'F5'"):
        compare(tmp_path, forms=["F5"])
    with pytest.raises(BackendError, match="no level 'highest'.*high"):
        compare(tmp_path, levels=["highest"])
    with pytest.raises(BackendError, match="no class 'equal'.*equality"):
        compare_class(tmp_path, "equal")
    with pytest.raises(BackendError, match="solver 'tests.support.exact:Solver'.*module:Class"):
        compare(tmp_path, solvers=["tests.support.exact:Solver"])
    with pytest.raises(FileError, match="no format 'csv'"):
        export([], tmp_path, "csv")
    with pytest.raises(FileError, match="no form 'F5'"):
        export([], tmp_path, "npz", "F5")


def test_shifted_means():
    assert shifted_mean([2e-3, 2e-3]) == pytest.approx(2e-3)
    assert shifted_mean([0.0, 3e-3]) == pytest.approx(1e-3)  # √(1 · 4) − 1 milliseconds


@pytest.mark.slow
@pytest.mark.peer
@pytest.mark.parametrize("form", FORMS)
def test_problems_are_read_by_qpsolvers(tmp_path, form):
    """What is exported has the solution that gauss finds."""
    problem = make_problem("three stops")
    (path,) = export([problem], tmp_path, "npz", form)
    loaded = qpsolvers.Problem.load(str(path))
    x = qpsolvers.solve_problem(loaded, "daqp" if form != "F1" else "piqp").x
    a = gauss.solve(problem.compulsion)
    n = problem.compulsion.Phi.size
    expected = {"F1": np.concatenate([a.a, a.qdd]), "F2": a.a, "F2s": np.sqrt(problem.compulsion.Phi) * a.a, "F3": a.qdd}
    assert x == pytest.approx(expected[form], rel=1e-6, abs=1e-6 * np.abs(expected[form]).max())
    assert loaded.h.size == 3 and n == 36


def test_problems_are_read_by_matlab_and_osqp(tmp_path):
    problem = make_problem("box on 4 points")
    (path,) = export([problem], tmp_path, "mat")
    data = io.loadmat(path)
    assert data["A"].shape == (data["m"].item(), data["n"].item()) and data["P"].shape == (6, 6)
    assert np.isneginf(data["l"]).sum() == 4 and data["u"].shape == data["l"].shape
    bare = without_inequalities(problem)
    (path,) = export([bare], tmp_path, "mat")
    assert not np.isneginf(io.loadmat(path)["l"]).any()


@pytest.mark.slow
@pytest.mark.peer
def test_a_motion_is_exported_instant_by_instant(tmp_path):
    found = along(gauss.load("four_bar"), 0.1, 3)
    paths = export(found, tmp_path, "npz")
    assert [p.suffix for p in paths] == [".npz"] * 3
    q = [qpsolvers.Problem.load(str(p)).b for p in paths]
    assert np.abs(q[0] - q[2]).max() > 1e-3
    with pytest.raises(FileError, match="two problems have this file name"):
        export([found[0], found[0]], tmp_path, "npz")


@pytest.mark.slow
def test_the_committed_selection_is_a_test_set_of_qpbenchmark():
    """As its own program reads it, in a process of its own: it changes how Python logs."""
    test_set = Path(__file__).parents[2] / "benchmarks" / "qp" / "gauss_problems.py"
    assert test_set.read_text(encoding="utf-8") == TEST_SET
    code = (
        "import sys; from qpbenchmark.benchmark import load_test_set\n"
        "problems = list(load_test_set(sys.argv[1]))\n"
        "print(*[f'{p.name},{p.q.size},{0 if p.h is None else p.h.size}' for p in problems], sep='\\n')"
    )
    command = [sys.executable, "-c", code, str(test_set)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    rows = {name: (int(n), int(s)) for name, n, s in csv.reader(done.stdout.splitlines())}
    assert len(rows) == len(SELECTION) >= 12
    assert rows["box_on_8_points"] == (6, 8) and rows["chain_50"] == (300, 0)


@pytest.mark.slow
@pytest.mark.peer
def test_the_command_of_the_exported_test_set_runs(tmp_path):
    """As its docstring says, for one problem and one solver."""
    export([make_problem("four-bar")], tmp_path, "qpbenchmark")
    (line,) = (line for line in TEST_SET.splitlines() if line.startswith("qpbenchmark "))
    program, *words = line.replace("NAME", "nobody").split()
    command = [str(Path(sys.executable).parent / program), *words, "--solver", "daqp"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    with open(tmp_path / "results.csv") as file:
        rows = list(csv.DictReader(file))
    assert {row["solver"] for row in rows} == {"daqp"} and all(row["found"] == "True" for row in rows)


@pytest.mark.slow
def test_commands(tmp_path, capsys):
    chosen = ["--backend", "daqp", "--problem", "ur5", "--level", "high", "--no-motions"]
    app(["bench", "qp", "--output", str(tmp_path), *chosen], standalone_mode=False)
    charts = {"qp_errors.png", "qp_time_error.png", "qp_profile.png"}
    assert {p.name for p in tmp_path.iterdir()} == {"qp.csv", "qp.lock", "qp.md"} | charts
    assert "daqp" in (tmp_path / "qp.md").read_text()
    few = ["--backend", "piqp", "--problem", "degenerate table 4 at rest", "--level", "high"]
    app(["bench", "qp", "--output", str(tmp_path), "--class", "degenerate", *few], standalone_mode=False)
    assert {"qp_degenerate.csv", "qp_degenerate.md", "qp_degenerate.png"} <= {p.name for p in tmp_path.iterdir()}
    (row,) = read_table(tmp_path / "qp_degenerate.csv")
    assert row["error"] <= 1e-6 and row["dual_error"] <= 1e-3
    assert "1/1" in (tmp_path / "qp_degenerate.md").read_text()
    with pytest.raises(BackendError, match="no class 'contact'.*contacts"):
        app(["bench", "qp", "--output", str(tmp_path), "--class", "contact"], standalone_mode=False)
    app(["problems", "list"], standalone_mode=False)
    assert "box on 8 points" in capsys.readouterr().out
