"""Random problems: none is certified and wrong, no answer is worse than its certificate says, crashes are counted."""

import numpy as np
import pytest

import gauss
from gauss.backends import BACKENDS
from gauss.backends.active_set import active_set
from gauss.backends.estimate import acceleration_errors
from gauss.bench.fuzz.examine import COUNTS, examine
from gauss.bench.fuzz.problems import KINDS, fuzzed
from gauss.bench.fuzz.run import _block, fuzz, markdown
from gauss.bench.reference import reference
from gauss.bench.worker import Reply
from gauss.cli import app
from gauss.errors import BackendError

PROBLEMS = 27  # of the ten thousand of `gauss bench fuzz`
FOLDED = 76  # a loop folded to 5e-9, where a row counts as redundant that gradient search still meets, with forces of 5e11 N
WIDE = 100.0  # by how much more than the error a certificate may say, in the median, where rounding is all there is


@pytest.mark.slow
def test_no_answer_is_worse_than_its_certificate_says():
    for row in examine(0, list(range(PROBLEMS)), ["auto", *BACKENDS, "daqp"]):
        assert row["problems"] == sum(row[what] for what in ("certified", "flagged", "refused")) > PROBLEMS / 2
        assert row["silent"] == row["understated"] == row["unknown"] == 0 and row["ratio"] <= 1.0
        assert np.isnan(row["error"]) or row["certificate"] <= max(WIDE * row["error"], 1e-13)


@pytest.mark.slow
def test_certificates_hold_for_every_body():
    for number in range(len(KINDS)):
        _, compulsion = fuzzed(0, number)
        solution, expected = gauss.solve(compulsion), reference(compulsion)
        off = solution.a - expected.a, solution.qdd - expected.qdd
        errors = acceleration_errors(compulsion, solution.answer, off)[: compulsion.structure.n_bodies]
        assert (errors <= solution.certificate.body_errors).all()


def test_an_answer_that_hinges_on_a_near_dependent_row_is_not_certified():
    _, compulsion = fuzzed(0, FOLDED)
    right, other = gauss.solve(compulsion), gauss.solve(compulsion, "gradient")
    assert right.status.certified and not other.status.certified
    bare = active_set(compulsion, other.answer)[1]
    assert other.certificate.error >= reference(compulsion).error(compulsion, bare)


@pytest.mark.slow
@pytest.mark.parametrize("number", [9073, 1937, 6025])  # answers whose error is above what the parts of it once added up to
def test_errors_of_parts_bound_the_error_of_their_sum(number):
    _, compulsion = fuzzed(0, number)
    answer, rng = gauss.solve(compulsion).answer, np.random.default_rng(number)
    sizes = compulsion.Phi.size, compulsion.P.size

    def part(decade):
        numbers = (rng.standard_normal(size) for size in sizes)
        return tuple(10.0**decade * x * np.abs(y).max() for x, y in zip(numbers, (answer.a, answer.qdd), strict=True))

    for decades in rng.uniform(-18, -3, (200, 2)):
        one, other = (part(decade) for decade in decades)
        errors = [acceleration_errors(compulsion, answer, x) for x in (one, other, tuple(map(np.add, one, other)))]
        assert (errors[2] <= (1 + 1e-12) * (errors[0] + errors[1])).all()
        assert (errors[0] <= acceleration_errors(compulsion, answer, tuple(2.0 * x for x in one))).all()
    expected = reference(compulsion).error(compulsion, active_set(compulsion, answer)[1])
    assert expected <= gauss.solve(compulsion).certificate.error


@pytest.mark.slow
def test_problems_are_made_again_by_their_numbers():
    for number in range(len(KINDS)):
        (kind, first), (_, again), (_, other) = fuzzed(3, number), fuzzed(3, number), fuzzed(4, number)
        assert kind == list(KINDS)[number]
        assert np.array_equal(first.impressed, again.impressed) and np.array_equal(first.D, again.D)
        assert not np.array_equal(first.Phi, other.Phi)


def dying(function, seed, numbers, backends, timeout):
    """Call of a process that dies at one problem."""
    if 9 in numbers:
        return Reply("crashed", reason="SIGSEGV")
    return Reply("answered", function(seed, numbers, backends))


def test_a_crash_costs_one_problem():
    (row,) = _block(dying, 0, [0, 9, 18], ["kkt"])
    assert (row["problems"], row["crashed"], row["number"]) == (3, 1, 9)
    assert sum(row[count] for count in ("certified", "flagged", "refused")) == 2


@pytest.mark.slow
def test_the_examination_goes_on_and_is_reported(tmp_path):
    first = fuzz(tmp_path, count=9, backends=["recursion"], progress=False)
    before = first.path.read_text()
    assert len(first.rows) == 7  # of nine kinds, two have inequality rows
    app(["bench", "fuzz", f"--output={tmp_path}", "--count=9", "--backend=auto", "--backend=daqp"], standalone_mode=False)
    assert first.path.read_text().startswith(before)
    report = (tmp_path / "fuzz.md").read_text()
    assert "worse than the certificate says 0" in report and "| auto |" in report and "* **box**" in report
    row = dict.fromkeys(COUNTS, 1) | {"backend": "daqp", "kind": "box", "seed": 0, "number": 3, "ratio": 2.0}
    row |= dict.fromkeys(("error", "certificate", "seconds"), np.nan)
    assert "crashes 1" in markdown([row], ["date"])
    with pytest.raises(BackendError, match="no backend 'recursions'"):
        fuzz(tmp_path, backends=["recursions"])
