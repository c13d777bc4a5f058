"""How the comparison judges: promises by residuals, errors by references, all by the same rule on the same problems."""

import re
import time
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import qpsolvers
from scipy import io, sparse

from gauss.backends.programme import FORMS, Outcome
from gauss.bench.class_page import class_page, sentence
from gauss.bench.classes import classes_named
from gauss.bench.clocks import FEWEST, ROUNDS, WALL_PER_CPU, timed
from gauss.bench.contestants import refusal
from gauss.bench.export import export
from gauss.bench.folders import of_folder
from gauss.bench.fronts import FrontPoint, front, fronts
from gauss.bench.instances import FILE, INEQUALITY, Instance, of_arrays, of_problem, of_selection
from gauss.bench.levels import LIMIT, Promise, promise
from gauss.bench.measure import FIGURES, NOT_ASKED, _judged, measure
from gauss.bench.problems import INCONSISTENT, SOLVABLE, UNKNOWN, make_problem
from gauss.bench.publish import publish
from gauss.bench.report import markdown
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
from gauss.bench.table import write_table
from gauss.bench.verdicts import is_false, said
from gauss.bench.worker import Worker
from gauss.errors import BackendError, FileError
from gauss.view.fronts import ZERO, height

GOOD = {"outcome": "answered", "claimed": True, "error": 1e-10, "primal": 1e-12, "dual": 1e-12, "gap": 1e-12, "excess": 1e-3}
GOOD |= {
    "backend": "one",
    "level": "high",
    "form": "F2s",
    "problem": "a",
    "group": "equality",
    "seconds": 1e-3,
    "reason": "",
}
BEYOND = {"primal": 1e-6, "excess": 1e3}  # residuals above the tolerance
ROUNDED = {"primal": 1e-6, "excess": 0.5}  # above the tolerance, but not above rounding
NO_FIGURES = {"error": np.nan, "primal": np.nan, "dual": np.nan, "gap": np.nan, "excess": np.nan}


class Perfect:
    """A solver of one's own that is right."""

    def __call__(self, programme):
        H, C = programme.H.toarray(), programme.C.toarray()
        x = qpsolvers.solve_qp(H, programme.c, A=C, b=programme.d, solver="daqp")
        y = np.linalg.lstsq(C.T, -H @ x - programme.c, rcond=None)[0]
        return Outcome(x, y, np.zeros(0), True, "solved")


class LiarInX(Perfect):
    """It is off by a percent."""

    def __call__(self, programme):
        found = super().__call__(programme)
        return Outcome(1.01 * found.x, found.y, found.z, True, "solved")


class LiarInY(Perfect):
    """Its multipliers are none."""

    def __call__(self, programme):
        return Outcome(super().__call__(programme).x, None, None, True, "solved")


class WrongShape:
    """It returns too much."""

    def __call__(self, programme):
        return Outcome(np.zeros(programme.c.size + 1), None, None, True, "solved")


class NotANumber:
    """It returns nan."""

    def __call__(self, programme):
        return Outcome(np.full(programme.c.size, np.nan), None, None, True, "solved")


class LiarWithoutMultipliers(Perfect):
    """Its multipliers are not finite."""

    def __call__(self, programme):
        found = super().__call__(programme)
        return Outcome(found.x, np.nan * found.y, found.z, True, "solved")


class Changes:
    """It makes zero right by changing what is asked."""

    def __call__(self, programme):
        for part in (programme.H.data, programme.C.data, programme.K.data, programme.c, programme.d, programme.k):
            part[:] = 0.0
        return SaysSolved()(programme)


class ClaimsInWords(Perfect):
    """What it claims is neither True nor False."""

    def __call__(self, programme):
        found = super().__call__(programme)
        object.__setattr__(found, "found", "no")  # past the types that are checked here
        return found


class Raises:
    """It fails."""

    def __call__(self, programme):
        raise RuntimeError("broken")


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
    row = measure(four_bar, f"{__name__}:{solver}", "F2s", "high") | {"level": "high", "group": "equality"}
    assert (row["outcome"], is_right(row), is_broken(row)) == (outcome, right, broken)


@pytest.mark.parametrize(
    ("solver", "says"), [("WrongShape", r"x is .* of shape \(\d+,\), expected"), ("ClaimsInWords", "found is a str")]
)
def test_outcomes_of_solvers_of_ones_own_that_are_none_are_named(four_bar, solver, says):
    with pytest.raises(BackendError, match=says):
        measure(four_bar, f"{__name__}:{solver}", "F2s", "high")


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
    liar = measure(instance, f"{__name__}:SaysSolved", FILE, "high") | key
    assert is_broken(liar) and not is_right(liar)


class SaysSolved:
    """It calls anything solved, at zero."""

    def __call__(self, programme):
        sizes = programme.c.size, programme.d.size, programme.k.size
        return Outcome(*map(np.zeros, sizes), True, "solved")


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


def test_fronts_hold_what_no_other_beats():
    rows = [
        GOOD | {"backend": name, "problem": problem, "seconds": seconds, "error": error}
        for name, seconds, error in (("one", 1e-3, 1e-8), ("two", 2e-3, 0.0), ("three", 3e-3, 1e-9), ("none", 1e-4, np.nan))
        for problem in "ab"
    ]
    names, overall, panels = fronts(rows)
    assert names == ["one", "two", "three", "none"] and set(panels) == {"a", "b"}
    assert front(overall) == front(panels["a"]) == ["one", "two"]
    assert panels["a"]["three"] == FrontPoint(pytest.approx(3.0), 1e-9) and "none" not in overall
    mine = {name: [row for row in rows if row["backend"] == name] for name in names}
    assert "two is 1.5 × as fast" in sentence("three", mine, overall, panels)
    assert height(0.0) == ZERO < height(1e-300) < height(1e-12)


def computed(seconds: float):
    """Nothing, after so much CPU time [s]."""
    end = time.process_time() + seconds
    while time.process_time() < end:
        pass


def test_clocks_run_a_cold_call_and_some_warm_ones():
    calls = []
    found, seconds = timed(lambda: calls.append(None), LIMIT)
    assert len(calls) == len(found) == len(seconds) == 1 + ROUNDS
    found, seconds = timed(lambda: computed(0.02), 0.01)
    assert len(seconds) == 1  # late already
    found, seconds = timed(lambda: computed(0.02), 0.01, compiles=True)
    assert len(seconds) == 2
    assert len(timed(lambda: computed(0.06), LIMIT)[1]) > FEWEST
    waits = timed(lambda: time.sleep(0.02), LIMIT)[1][0]
    assert 0.02 / WALL_PER_CPU <= waits < 0.02  # less than work, but not free


def test_a_call_that_takes_too_much_time_ends_with_its_process():
    """No setting of a library is needed, and the next call is answered by a new process."""
    with Worker() as worker:
        late = worker.call(timed, partial(computed, 10.0), 0.1, timeout=60.0)
        assert (late.outcome, late.value) == ("timed out", None) and "CPU time" in late.reason
        late = worker.call(timed, partial(time.sleep, 60.0), 0.02, timeout=60.0)
        assert (late.outcome, late.value) == ("timed out", None) and "wall time" in late.reason
        assert worker.call(timed, partial(computed, 0.01), 0.1, timeout=60.0).outcome == "answered"


def test_the_documented_solver_works(tmp_path, monkeypatch, four_bar):
    """The example of benchmarks/README.md, as it stands there."""
    text = (Path(__file__).parents[2] / "benchmarks" / "README.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)
    assert len(code.splitlines()) <= 25
    (tmp_path / "mysolver.py").write_text(code, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    row = measure(four_bar, "mysolver:RangeSpace", "F2s", "high") | {"level": "high"}
    assert is_right(row) and is_kept(row) and row["certified"]


def test_answers_without_a_reference_are_named_by_their_residuals():
    """No error is known of them, which is no fault of the answer."""
    instance = of_arrays("plain", "mine", np.eye(2), np.ones(2), np.ones((1, 2)), [1.0], None, None)
    found = {solver: measure(instance, solver, FILE, "high") for solver in ("daqp", f"{__name__}:LiarInY")}
    key = {"problem": "plain", "form": FILE, "level": "high", "group": "mine", "verdict": SOLVABLE}
    text = markdown([row | key | {"backend": name} for name, row in found.items()], [], ["date: today"])
    errors = text[text.index("## Errors") : text.index("## Class")]
    assert "| daqp | kept |" in errors and "LiarInY | **claimed** |" in errors
    assert "class mine, file" in text and "Level low" not in text


@pytest.mark.parametrize(
    ("change", "has_errors"),
    [({"form": FILE}, True), ({"form": "F2s", "level": "low"}, False), ({"form": "F2s", "group": INCONSISTENT}, False)],
)
def test_pages_are_written_whatever_was_asked(tmp_path, change, has_errors):
    """Of programmes from files; of another level, or of an inconsistent problem, without a chart of errors."""
    row = GOOD | dict.fromkeys(FIGURES, np.nan) | {"certified": False} | change
    write_table(tmp_path / "qp.csv", ["date: today", "machine: this one"], [row])
    written = publish(tmp_path, tmp_path / "qp.csv", None)
    assert set(written) == set(tmp_path.iterdir()) - {tmp_path / "qp.csv"}
    assert (tmp_path / "qp_errors.png" in written) == has_errors == ("qp_errors.png" in (tmp_path / "qp.md").read_text())


def test_names_stand_for_several_classes():
    assert classes_named(["friction", "mpc", "cones"]) == ["cones", "coulomb", "mpc"]


def test_levels_stand_side_by_side_where_several_were_asked():
    """Of the problems that were asked at all levels; the rest of a page is about level high."""
    row = GOOD | {"group": "mpc", "library": 1e-4}
    asked = [("a", "high"), ("b", "high"), ("a", "low")]
    text = class_page("mpc", [row | {"problem": problem, "level": level} for problem, level in asked], [], "")
    assert "Asked at each: 1 problem." in text and "| 1 | one | 2/2 |" in text
    assert "## By level" not in class_page("mpc", [row | {"problem": "a", "level": "high"}], [], "")
