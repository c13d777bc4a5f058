"""A trajectory in a notebook: a table with a row for every coordinate, a figure by one call."""

import xml.etree.ElementTree as ET
from dataclasses import replace

import numpy as np
import pytest

import gauss


@pytest.mark.parametrize("name", ["double_pendulum", "heavy_top"])
def test_the_table_has_a_row_with_a_curve_for_every_coordinate(name):
    motion = gauss.simulate(gauss.load(name), 0.2, times=np.linspace(0.0, 0.2, 5))
    table = ET.fromstring(f"<div>{motion._repr_html_()}</div>")
    rows = table.findall("./table/tbody/tr")
    assert len(rows) == motion.system.n_q
    for row, column in zip(rows, motion.q.T, strict=True):
        assert float(row[2].text) == pytest.approx(column[-1], rel=1e-5, abs=1e-12)
        assert len(row[-1][0][0].get("points").split()) == len(motion)


@pytest.mark.slow
def test_a_motion_plots_itself(tmp_path):
    pytest.importorskip("matplotlib")
    motion = gauss.simulate(gauss.load("pendulum"), 0.2)
    figure = motion.plot(tmp_path / "motion.png")
    assert len(figure.axes) == 4 and (tmp_path / "motion.png").stat().st_size


@pytest.mark.parametrize("size, levels", [(1e-12, 1), (1e-3, 5)])
def test_what_changes_by_rounding_is_drawn_level(size, levels):
    motion = gauss.simulate(gauss.load("pendulum"), 0.2, times=np.linspace(0.0, 0.2, 5))
    moved = replace(motion, q=size * np.arange(5.0)[:, None])
    curve = ET.fromstring(f"<div>{moved._repr_html_()}</div>").find(".//polyline").get("points").split()
    assert len({point.partition(",")[2] for point in curve}) == levels
