"""Pages of the comparison: fronts, errors, classes, levels."""

import numpy as np
import pytest

from gauss.bench.class_page import class_page, sentence
from gauss.bench.classes import classes_named
from gauss.bench.fronts import FrontPoint, front, fronts
from gauss.bench.instances import FILE, of_arrays
from gauss.bench.measure import FIGURES, measure
from gauss.bench.problems import INCONSISTENT, SOLVABLE
from gauss.bench.publish import publish
from gauss.bench.report import markdown
from gauss.bench.table import write_table
from gauss.view.backends import ZERO, height
from tests.support import qp_solvers
from tests.support.qp_solvers import GOOD


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


def test_answers_without_a_reference_are_named_by_their_residuals():
    """No error is known of them, which is no fault of the answer."""
    instance = of_arrays("plain", "mine", np.eye(2), np.ones(2), np.ones((1, 2)), [1.0], None, None)
    found = {solver: measure(instance, solver, FILE, "high") for solver in ("daqp", f"{qp_solvers.__name__}:LiarInY")}
    key = {"problem": "plain", "form": FILE, "level": "high", "group": "mine", "verdict": SOLVABLE}
    text = markdown([row | key | {"backend": name} for name, row in found.items()], [], ["date: today"])
    errors = text[text.index("## Errors") : text.index("## Class")]
    assert "| daqp | kept |" in errors and "LiarInY | **claimed** |" in errors
    assert "class mine, file" in text and "Level low" not in text


@pytest.mark.slow
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
