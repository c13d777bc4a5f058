"""Problems of the IFToMM library: errors far below what is asked, references by two routes, a table that has all of them."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks import iftomm
from benchmarks.command import RESULTS
from benchmarks.iftomm import exact
from benchmarks.iftomm.problems import BETA, CRANK, tables
from gauss.bench.table import read_table
from tests.support import mechanisms

PROBLEMS = {problem.name: problem for problem in iftomm.problems()}
QUICK = (  # to compile, and to run
    "A01 pendulum, 2000 s",
    "A01 pendulum, 10 s",
    "A02 ladder, N = 1, 20 s",
    "A03 Andrews' squeezer, 0.05 s",
    "A04 Bricard, 10 s",
    "A05 governor, 10 s",
)
COARSE = {"rtol": 1e-5, "atol": 1e-5}
TEN_DIGITS = 2e-10  # of tables by DOP853


@pytest.mark.slow
@pytest.mark.parametrize("name", QUICK)
def test_errors_are_far_less_than_asked_and_grow_with_the_tolerance(name):
    problem = PROBLEMS[name]
    coarse = replace(problem, settings=problem.settings | COARSE)
    fine, coarse = iftomm.measure([problem, coarse], rounds=1)
    assert fine["times_less"] >= iftomm.MARGIN
    assert coarse["error"] > 100 * fine["error"]


def test_closed_forms_are_those_of_the_references():
    data = mechanisms.reference("pendulum")["table"]
    angle = -np.array(data["angle_from_vertical"])
    found = exact.swinging(-1.0, np.array(data["t"]))
    assert found == pytest.approx(np.column_stack([np.sin(angle), -np.cos(angle)]), abs=1e-13)
    data = mechanisms.reference("n-four-bar")["table"]
    for n in (1, 2, 10, 40):
        theta, speed = np.array(data[str(n)]["theta"]), np.array(data[str(n)]["speed"])
        known = np.column_stack([np.sin(theta), np.cos(theta), speed * np.cos(theta), -speed * np.sin(theta)])
        assert exact.turning(n, np.array(data["t"])) == pytest.approx(known, abs=TEN_DIGITS)


def test_squeezer_is_that_of_an_independent_table():
    """Every eighth of 400 samples in 50 ms is one of the table's, which ends at 30 ms, where end values are published."""
    data = mechanisms.reference("andrews-squeezer")
    found = np.array(tables()["A03 Andrews' squeezer, 0.05 s"])[: 8 * 30 + 1 : 8]
    angle = np.array(data["table"]["q"])[:, 0]
    assert angle[0] == BETA
    assert found == pytest.approx(CRANK * np.column_stack([np.cos(angle), np.sin(angle)]), abs=1e-14)
    published = data["published_end"]["q"][0]
    assert found[-1] == pytest.approx([CRANK * np.cos(published), CRANK * np.sin(published)], abs=2e-9 * CRANK)


def test_tables_of_long_runs_begin_as_the_short_ones():
    """Samples that both have: 0.05 s of 0.5 s, 9 s of Bricard's 600 s."""
    for short, long, shared in (
        ("A03 Andrews' squeezer, 0.05 s", "A03 Andrews' squeezer, 0.5 s", ([0, 10, 400], [0, 1, 40])),
        ("A04 Bricard, 10 s", "A04 Bricard, 600 s", ([0, 60, 360], [0, 1, 6])),
        ("A05 governor, 10 s", "A05 governor, 350 s", ([0, 35, 350], [0, 1, 10])),
    ):
        one, two = (np.array(tables()[name])[rows] for name, rows in zip((short, long), shared, strict=True))
        assert one == pytest.approx(two, abs=1e-14)


def test_table_has_every_problem_and_its_margin():
    rows = read_table(RESULTS / "iftomm.csv")
    assert [row["problem"] for row in rows] == list(PROBLEMS)
    for row in rows:
        reached = row["energy"] if row["what"] == "energy" else row["error"]
        assert row["times_less"] == pytest.approx(row["asked"] / reached)
    page = "\n".join(iftomm.page(rows, []))
    assert "than asked: all." in page
    assert f"than asked: missed by {list(PROBLEMS)[-1]}." in "\n".join(
        iftomm.page([*rows[:-1], rows[-1] | {"times_less": 99.0}], [])
    )
