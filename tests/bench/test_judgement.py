"""How the comparison judges: promises by residuals, errors by references, all by the same rule on the same problems."""

import re
from pathlib import Path

import numpy as np
import pytest
from scipy import sparse

from gauss.backends.programme import Outcome
from gauss.bench.contestants import refusal
from gauss.bench.instances import FILE, INEQUALITY, Instance, of_problem, of_selection
from gauss.bench.levels import LIMIT, Promise, promise
from gauss.bench.measure import NOT_ASKED, _judged, measure
from gauss.bench.problems import INCONSISTENT, UNKNOWN, make_problem
from gauss.bench.suite.instance import INFEASIBLE, UNBOUNDED
from gauss.bench.suite_instances import SUITE, of_suite
from gauss.bench.summary import (
    asked,
    complete,
    is_broken,
    is_kept,
    is_right,
    mean_time,
    not_asked,
    profile,
    sensitivity,
    totals,
    verdict,
)
from gauss.bench.verdicts import is_false, said
from gauss.errors import BackendError
from tests.support import qp_solvers
from tests.support.qp_solvers import BEYOND, GOOD, NO_FIGURES, ROUNDED


@pytest.fixture(scope="module")
def four_bar() -> Instance:
    return of_problem(make_problem("four-bar"))


@pytest.mark.parametrize(
    "solver, outcome, right, broken",
    [
        ("Perfect", "answered", True, False),
        ("LiarInX", "answered", False, True),
        ("LiarInY", "answered", False, True),
        ("NotANumber", "not finite", False, True),
        ("LiarWithoutMultipliers", "not finite", False, True),
        ("Changes", "answered", False, False),
        ("Raises", "refused", False, False),
    ],
)
def test_solvers_of_ones_own_are_caught_in_what_they_claim(four_bar, solver, outcome, right, broken):
    row = measure(four_bar, f"{qp_solvers.__name__}:{solver}", "F2s", "high") | {"level": "high", "group": "equality"}
    assert (row["outcome"], is_right(row), is_broken(row)) == (outcome, right, broken)


@pytest.mark.parametrize(
    ("solver", "says"), [("WrongShape", r"x is .* of shape \(\d+,\), expected"), ("ClaimsInWords", "found is a str")]
)
def test_outcomes_of_solvers_of_ones_own_that_are_none_are_named(four_bar, solver, says):
    with pytest.raises(BackendError, match=says):
        measure(four_bar, f"{qp_solvers.__name__}:{solver}", "F2s", "high")


@pytest.mark.slow
@pytest.mark.parametrize("solver", ("daqp", "piqp", "proxqp", "osqp", "clarabel", "qpoases", "qrqp", "quadprog", "scs"))
def test_contestants_keep_their_promise_on_three_stops(solver):
    """All kinds of rows, F2s: residuals, gap and error, and the times that the library reports are within its call."""
    row = measure(of_problem(make_problem("three stops")), solver, "F2s", "high") | {"level": "high"}
    assert row["outcome"] == "answered" and row["claimed"] and is_right(row) and not is_broken(row)
    assert row["lower"] <= row["seconds"] <= row["upper"]
    reported = [row[name] for name in ("setup", "solve", "library") if np.isfinite(row[name])]
    assert all(0.0 < seconds < LIMIT for seconds in reported)
    assert reported or solver in ("qpoases", "qrqp")


def test_what_a_row_says():
    assert is_kept(GOOD) and is_right(GOOD) and not is_broken(GOOD)
    assert not is_kept(GOOD | BEYOND) and is_broken(GOOD | BEYOND) and is_right(GOOD | BEYOND)
    assert not is_kept(GOOD | ROUNDED) and not is_broken(GOOD | ROUNDED)
    assert not is_broken(GOOD | BEYOND | {"claimed": False})
    late = GOOD | {"outcome": "timed out", "claimed": False}
    assert not is_right(late) and not is_kept(late)
    own = GOOD | NO_FIGURES | {"error": 1e-3, "level": "own", "certified": True}
    assert not is_right(own)  # whatever its certificate says
    assert is_right(GOOD | {"error": np.nan})  # no reference: residuals are all that there is
    assert not is_right(GOOD | BEYOND | {"error": np.nan})
    unknown = GOOD | {"error": np.nan, "verdict": UNKNOWN}
    assert is_right(unknown) and not is_right(unknown | BEYOND)
    gives_up = unknown | NO_FIGURES | {"claimed": False, "outcome": "refused", "reason": "infeasible"}
    assert not is_right(gives_up) and not is_false(gives_up)  # who knows


def test_verdicts_on_what_has_no_solution():
    unmeasured = GOOD | NO_FIGURES
    cases = {
        "within": GOOD | {"error": np.nan},
        "broken": unmeasured | BEYOND,
        "said": unmeasured | {"claimed": False, "reason": "PrimalInfeasible"},
        "no answer": unmeasured | {"claimed": False, "reason": "singular"},
        "claimed": unmeasured | {"level": "own"},
    }
    assert {name: verdict(row) for name, row in cases.items()} == {name: name for name in cases}


def test_means_are_over_equal_sets():
    """A backend that was not measured on all problems of a class has no line; late and wrong answers cost the limit."""
    slow, wrong = {"seconds": 0.1, "backend": "two"}, {"error": 1.0, "backend": "two", "problem": "b"}
    rows = [GOOD, GOOD | {"problem": "b"}, GOOD | slow, GOOD | wrong, GOOD | {"backend": "three"}]
    found = complete(rows, ["a", "b"], "F2s")
    assert list(found) == [("one", "high"), ("two", "high")]
    assert mean_time(found["one", "high"]) == pytest.approx(1e-3)
    assert mean_time(found["two", "high"], shift=0.0) == pytest.approx(np.sqrt(0.1 * LIMIT))
    assert mean_time(found["two", "high"], shift=0.0, penalty=10.0) == pytest.approx(np.sqrt(LIMIT))
    lines = {line["backend"]: line for line in totals(rows, ["a", "b"], "F2s")}
    assert lines["one"]["right"] == 1.0 and lines["two"]["right"] == 0.5 and lines["two"]["wrong"] == 1
    assert all(rank == 1 for _, rank in sensitivity(rows, ["a", "b"], "F2s", "high")["one"])
    shares = profile(rows, ["a", "b"], "F2s", "high", 1e-6, np.array([1.0, 1e3]))
    assert {name: share.tolist() for name, share in shares.items()} == {"one": [1.0, 1.0], "two": [0.0, 0.5]}


def test_solvers_are_held_to_what_they_promise():
    """A gap that DAQP does not look at is no broken promise; rows that contradict it are."""
    (instance,) = of_suite("independent", ["equality ur5"])
    programme, right = instance.programme(FILE), instance.known
    m = programme.d.size
    y, z = right.multipliers[:m], right.multipliers[m:]
    one = Outcome(right.x, y, z, True, "solved")
    shifted = Outcome(right.x + 1e-6 * np.abs(right.x).max(), y, z, True, "solved")
    for solver in ("daqp", "piqp", "quadprog", "clarabel"):
        assert _judged(instance, programme, one, promise(solver, "high"))["excess"] <= 1.0
        excess = _judged(instance, programme, shifted, promise(solver, "high"))["excess"]
        assert (excess > 1.0) == (solver != "quadprog")
    gap_alone = [_judged(instance, programme, one, Promise(1.0, 1.0, gap))["excess"] for gap in (1e-300, np.inf)]
    assert gap_alone[0] >= gap_alone[1] and gap_alone[1] <= 1.0


@pytest.mark.slow
def test_solvers_are_not_asked_for_what_they_do_not_take():
    """Dense matrices that fill the memory, and equality rows alone: no failures, and named with the reason."""
    (large,) = of_suite("large", ["large net 100"])
    (equalities,) = of_suite("independent", ["equality ur5"])
    rows = []
    for instance, solver in ((large, "daqp"), (large, "qtqp"), (equalities, "qtqp"), (equalities, "daqp")):
        assert (refusal(solver, instance.programme(FILE)) == "") == ((instance is large) == (solver == "qtqp"))
    row = measure(large, "daqp", FILE, "high")
    assert row["outcome"] == NOT_ASKED and not row["claimed"]
    rows = [GOOD, GOOD | row | {"backend": "two"}, GOOD | {"backend": "two", "problem": "b"}, GOOD | {"problem": "b"}]
    assert list(complete(asked(rows), ["a", "b"], "F2s")) == [("one", "high")]
    assert any("two, 1 problem: takes dense matrices" in line for line in not_asked(rows))


def test_classes_choose_problems():
    names = ("four-bar", "noisy copies", "box on 4 points")
    found = list(of_selection(names, (INEQUALITY, INCONSISTENT)))
    assert [(instance.name, instance.group) for instance in found] == [(names[1], INCONSISTENT), (names[2], INEQUALITY)]
    assert found[0].expected is None  # what has no solution has no reference


SMALLEST_OF = {  # a small problem of each class, few of whose multipliers are unique
    "contacts": "contacts balls 8 spread 0",
    "degenerate": "degenerate stack 4",
    "redundant": "redundant four_bar",
    "scales": "scales mm g",
    "mpc": "mpc cart and pole 10",
    "whole body": "inverse dynamics go2",
}


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "name"), SMALLEST_OF.items())
def test_errors_of_x_and_of_multipliers_are_those_that_were_put_in(kind, name):
    """Modulo loose directions, and in any units: those of a solver are small, of shifted ones as large as the shift."""
    (instance,) = of_suite(kind, [name])
    right, rng = instance.known, np.random.default_rng(0)
    row = measure(instance, "quadprog", FILE, "high") | {"level": "high", "group": kind}
    assert is_right(row) and not is_broken(row) and row["dual_error"] <= 1e-6
    rows = sparse.vstack([instance.matrices.A, instance.matrices.G]).toarray()
    loose = np.zeros(right.multipliers.size)
    if right.basis is not None:  # what no row determines: it pulls at nothing
        scaled = rng.standard_normal(right.held.size)
        scaled -= right.basis @ (right.basis.T @ scaled)
        work = right.work[right.held]
        loose[right.held] = scaled * np.abs(right.work * right.multipliers).max() / np.where(work > 0.0, work, np.inf)
        assert np.abs(loose).max() > 0.0 or right.basis.shape[0] == right.basis.shape[1]
        size = np.abs(rows.T) @ np.abs(loose)
        assert (np.abs(rows.T @ loose) <= 1e-9 * np.maximum(size, size.max())).all()
    for size in (0.0, 1e-8, 1e-3):
        assert right.dual_error((1.0 + size) * right.multipliers + loose) == pytest.approx(size, rel=1e-2, abs=1e-11)
        assert right.error(right.x + size * right.scale) == pytest.approx(size, rel=1e-6)
    assert np.isnan(right.error(np.full(right.x.size, np.nan)))
    assert right.dual_error(np.zeros(right.multipliers.size)) == pytest.approx(1.0)


def test_errors_of_what_has_next_to_no_mass_count():
    """Its free acceleration is 1e9 times what its rows allow, and says nothing of what is right."""
    (instance,) = of_suite("scales", ["scales light tip 1e-9"])
    tip = np.arange(instance.known.x.size) >= instance.known.x.size - 6
    assert instance.known.error(np.where(tip, 1.5, 1.0) * instance.known.x) > 1e-2


@pytest.mark.parametrize(
    ("kind", "name", "verdict"),
    [
        ("infeasible", "infeasible clamp 2^-0", INFEASIBLE),
        ("unbounded", "unbounded slider 2^-0", UNBOUNDED),
    ],
)
def test_verdicts_of_solvers_are_compared_with_proven_ones(kind, name, verdict):
    (instance,) = of_suite(kind, [name])
    assert instance.verdict == verdict
    key = {"level": "high", "group": kind, "verdict": verdict}
    for solver in ("clarabel", "piqp", "osqp", "daqp", "qpoases"):
        row = measure(instance, solver, FILE, "high") | key
        assert said(row["reason"]) == verdict and is_right(row) and not is_false(row)
        assert is_false(row | {"verdict": "solvable"}) and not is_right(row | {"verdict": "solvable"})
    liar = measure(instance, f"{qp_solvers.__name__}:SaysSolved", FILE, "high") | key
    assert is_broken(liar) and not is_right(liar)


@pytest.mark.parametrize(
    ("words", "verdict"),
    [
        ("clarabel: PrimalInfeasible", INFEASIBLE),
        ("piqp: Status.PIQP_PRIMAL_INFEASIBLE", INFEASIBLE),
        ("clarabel: DualInfeasible", UNBOUNDED),
        ("piqp: Status.PIQP_DUAL_INFEASIBLE", UNBOUNDED),
        ("scs: unbounded", UNBOUNDED),
        ("scs: infeasible_inaccurate", ""),
        ("clarabel: AlmostDualInfeasible", ""),
        ("highs: primal infeasible or unbounded", ""),
        ("osqp: maximum iterations reached", ""),
        ("osqp: solved", ""),
    ],
)
def test_verdicts_in_the_words_of_solvers(words, verdict):
    assert said(words) == verdict


@pytest.mark.slow
def test_every_class_is_asked_and_sequences_start_at_the_step_before():
    assert set(SUITE) == {*SMALLEST_OF, "independent", "infeasible", "unbounded", "sequences", "large", "cones", "coulomb"}
    first, second = of_suite("sequences", ["sequence falling chain 00", "sequence falling chain 01"])
    assert first.start is None and second.start == pytest.approx(first.known.x, rel=1e-15)
    row = measure(second, "osqp", FILE, "high")
    assert row["warm"] > 0.0 and np.isnan(measure(second, "clarabel", FILE, "high")["warm"])


def test_the_documented_solver_works(tmp_path, monkeypatch, four_bar):
    """The example of benchmarks/README.md, as it stands there."""
    text = (Path(__file__).parents[2] / "benchmarks" / "README.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)
    assert len(code.splitlines()) <= 25
    (tmp_path / "mysolver.py").write_text(code, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    row = measure(four_bar, "mysolver:RangeSpace", "F2s", "high") | {"level": "high"}
    assert is_right(row) and is_kept(row) and row["certified"]
