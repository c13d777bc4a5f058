"""Problems of the IFToMM library: errors far below what is asked, and a table that has all of them."""

from dataclasses import replace

import pytest

from benchmarks import iftomm
from gauss.bench.table import read_table

PROBLEMS = {problem.name: problem for problem in iftomm.problems()}
QUICK = ("A01 pendulum", "A02 ladder, N = 1", "A03 Andrews' squeezer", "A04 Bricard")  # to compile; references from files
COARSE = {"rtol": 1e-5, "atol": 1e-5}


@pytest.mark.parametrize("name", QUICK)
def test_errors_are_far_less_than_asked_and_grow_with_the_tolerance(name):
    fine, coarse = iftomm.measure([PROBLEMS[name], replace(PROBLEMS[name], settings=COARSE)], rounds=1)
    assert fine["times_less"] >= iftomm.MARGIN
    assert coarse["energy"] > 100 * fine["energy"]
    assert name == "A04 Bricard" or coarse["error"] > 100 * fine["error"]  # there energy alone is judged


def test_table_has_every_problem_and_its_margin():
    rows = read_table(iftomm.RESULTS / "iftomm.csv")
    assert [row["problem"] for row in rows] == list(PROBLEMS)
    for row in rows:
        worst = max(row["energy"], row["error"]) if row["error"] == row["error"] else row["energy"]
        assert row["times_less"] == pytest.approx(row["asked"] / worst)
    page = iftomm.report(rows, [])
    assert "than asked: all." in page
    assert "than asked: missed by A05 flyball governor." in iftomm.report([*rows[:-1], rows[-1] | {"times_less": 99.0}], [])
