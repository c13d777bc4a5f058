"""Linkages from files to tables and pictures, as a user of the command line meets them."""

import csv
import re

import numpy as np
import pytest

import gauss
from gauss.errors import FileError
from gauss.io import linkages
from gauss.linkages import table
from gauss.view import animate_linkage, plot_linkage
from gauss.view.linkage_drawing import Drawing
from gauss.view.linkages import coupler_points
from tests.support import mechanisms
from tests.support.files import call


def test_the_command_says_what_a_linkage_is_and_does():
    result = call("linkage", "four_bar", "--fluctuation", 0.05, "--run", 1.0)
    assert result.exit_code == 0, result.output
    quality = mechanisms.reference("linkage-extra")["quality"]
    least = np.degrees(quality["minimum_transmission_angle"])
    for words in ("RRR", "crank-rocker", f"least angle {least:.4g}°", "0 J in a turn", "flywheel", "last speed"):
        assert words in result.output


@pytest.mark.slow
@pytest.mark.parametrize("name", linkages())
def test_every_shipped_linkage_is_reported(name):
    result = call("linkage", name, "--steps", 24)
    assert result.exit_code == 0, result.output
    assert "power balance" in result.output


def test_the_table_holds_every_number(tmp_path):
    path = tmp_path / "table.csv"
    assert call("linkage", "shaper", "--steps", 24, "--csv", path).exit_code == 0
    with open(path, newline="") as file:
        head, *rows = csv.reader(file)
    columns = dict(zip(head, np.array(rows, dtype=float).T, strict=True))
    expected = mechanisms.reference("linkage-rpr-shaper")["table"]
    for ours, theirs in (
        ("driving torque M1 [N m]", "M1"),
        ("reaction P23 n [N]", "R_P23_n"),
        ("reaction P23 m [N m]", "R_P23_m"),
        ("reaction F y [N]", "R_F_y"),
        ("lever acceleration [rad/s^2]", "link_3_acceleration"),
        ("slide P50 position [m]", "slide_5_position"),
    ):
        assert columns[ours][:-1] == pytest.approx(expected[theirs], rel=1e-9, abs=1e-9)
        assert columns[ours][-1] == pytest.approx(columns[ours][0], rel=1e-9)  # a turn
    assert list(columns) == list(table(gauss.load_linkage("shaper").cycle()))


@pytest.mark.slow
def test_a_linkage_that_does_not_turn_is_swept_where_it_closes(tmp_path):
    linkage = gauss.load_linkage("four_bar")
    pin = linkage.joints.pop("B")
    linkage.revolute("B", pin.parent, pin.child, at=(1.0, 0.0))
    angles = linkage.sweep(50)
    (low, high), _ = linkage.closing_ranges()  # between folded and stretched, on either side
    assert angles[[0, -1]] == pytest.approx([low + 0.005 * (high - low), high - 0.005 * (high - low)])
    figure = plot_linkage(linkage.cycle(angles), tmp_path / "figure.png")
    assert figure.axes[1].get_xlim() == pytest.approx(np.degrees(angles[[0, -1]]))
    linkage.set_speed(-3.0)
    assert linkage.sweep(50) == pytest.approx(angles[::-1])


def _cycle(name):
    linkage = gauss.load_linkage(name)
    return linkage.cycle(linkage.sweep(36))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["shaper", "class_three"])
def test_figures_show_the_numbers(tmp_path, name):
    found, path = _cycle(name), tmp_path / "figure.png"
    figure = plot_linkage(found, path)
    assert path.read_bytes().startswith(b"\x89PNG")
    drawing, torque, reactions, bearings, transmission, curves = figure.axes
    assert drawing.get_aspect() == 1.0
    assert torque.lines[0].get_ydata() == pytest.approx(found.torque)
    assert torque.get_ylabel() == "driving torque [N m]" and torque.get_xlabel() == "crank angle [°]"
    for line, joint in zip(reactions.lines, found.chain.joints, strict=True):
        assert line.get_ydata() == pytest.approx(np.hypot(*found.reaction(joint.name).force.T))
    angle, size = bearings.lines[0].get_data()
    assert size * np.exp(1j * angle) == pytest.approx(-found.reaction("A").force @ [1, 1j])
    for line, angle in zip(transmission.lines, found.transmission().values(), strict=True):
        assert line.get_ydata() == pytest.approx(np.degrees(angle))
    for line, (link, point) in zip(curves.lines, coupler_points(found), strict=True):
        assert line.get_xydata().ravel() == pytest.approx(found.link(link).point(complex(*point)).view(float).ravel())


@pytest.mark.parametrize("name", linkages())
def test_links_are_drawn_where_they_are(name):
    """Every pin of every position lies on the artists of both of its links, inside the axes."""
    found = _cycle(name)
    from matplotlib.figure import Figure

    axes = Figure().add_subplot()
    drawing = Drawing(axes, found)
    (x0, x1), (y0, y1) = axes.get_xlim(), axes.get_ylim()
    for joint in found.chain.joints:
        if joint.kind == "revolute":
            x = found.point(joint.child, joint.child_at).position
            assert (x >= [x0, y0]).all() and (x <= [x1, y1]).all()
            for link in (joint.parent, joint.child):
                assert link == "ground" or joint.point(link) in drawing.corners[link]
    artists = drawing.links(0)
    assert len(artists) >= len(found.chain.links)


@pytest.mark.slow
def test_an_animation_has_as_many_pictures_as_positions(tmp_path):
    from PIL import Image

    linkage = gauss.load_linkage("four_bar")
    path = animate_linkage(linkage.cycle(linkage.sweep(6)), tmp_path / "turn.gif")
    with Image.open(path) as movie:
        assert movie.n_frames == 6


def test_formats_that_are_none(tmp_path, monkeypatch):
    found = _cycle("four_bar")
    with pytest.raises(FileError, match="saved as one of .png"):
        plot_linkage(found, tmp_path / "figure.txt")
    with pytest.raises(FileError, match="saved as one of .gif, .mp4"):
        animate_linkage(found, tmp_path / "movie.avi")
    monkeypatch.setattr("matplotlib.animation.FFMpegWriter.isAvailable", lambda: False)
    with pytest.raises(FileError, match="needs the program ffmpeg"):
        animate_linkage(found, tmp_path / "movie.mp4")
    result = call("linkage", "four_bar", "--csv", tmp_path / "table.txt")
    assert isinstance(result.exception, FileError) and "written as .npz or .csv" in str(result.exception)


@pytest.mark.slow
def test_speeds_and_steps():
    """Inertia forces grow with the square of the speed."""
    outputs = (call("linkage", "slider_crank", "--speed", speed, "--steps", 36).output for speed in (1.0, 100.0))
    slow, fast = (float(re.search(r"shaking force +at most (\S+) N", output)[1]) for output in outputs)
    assert fast == pytest.approx(1e4 * slow, rel=1e-5)
    assert call("linkage", "four_bar", "--steps", 1).exit_code == 2
