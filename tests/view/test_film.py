"""Films and pages of motions: what is drawn is where the motion is, files play without gauss, notebooks show them."""

import sys
import warnings

import numpy as np
import pytest
from PIL import Image

import gauss
from benchmarks.free_bodies import stack
from gauss.errors import FileError, StateError
from gauss.view.viewer import export_film, page
from gauss.view.viewer.painter import Painter
from gauss.view.viewer.shown import resampled, shown
from gauss.view.viewer.touches import touches

SIZE = (160, 120)
PIXEL = 2.0  # a body of one colour is found where it is, but for its edges


@pytest.fixture(scope="module")
def motion():
    return gauss.simulate(gauss.load("four_bar"), 0.3, times=np.linspace(0, 0.3, 16))


@pytest.mark.slow
def test_a_film_shows_the_motion(motion, tmp_path):
    with Image.open(export_film(motion, tmp_path / "film.gif", frames=10, size=SIZE)) as film:
        assert film.n_frames == 4 and film.size == SIZE and film.info["duration"] == 100 and film.info["loop"] == 0
        pictures = [np.asarray(film.convert("RGB"), dtype=int) for k in range(film.n_frames) if film.seek(k) is None]
    assert all(np.abs(one - two).max() > 50 for one, two in zip(pictures, pictures[1:], strict=False))


@pytest.mark.slow
def test_bodies_are_drawn_where_they_are(motion):
    painter = Painter(shown(motion, 10, traces=[]), 640, 480)
    for k in (0, 2):
        pixels = painter.picture(k).astype(int)
        blue = (pixels[..., 2] > 1.5 * pixels[..., 0]) & (pixels[..., 2] > pixels[..., 1] + 20)  # the crank
        middle = painter.positions[k, 0] + painter.rotations[k, 0] @ [0.2, 0, 0]
        (x, y), _ = painter._seen(middle)
        across, along = painter.axes.get_xlim()[1], painter.axes.get_ylim()[1]
        expected = 320 * (1 + x / across), 240 * (1 - y / along)
        rows, columns = np.nonzero(blue)
        assert min(np.hypot(columns - expected[0], rows - expected[1])) < PIXEL


@pytest.mark.filterwarnings("ignore::gauss.errors.NonUniqueReactionWarning")  # a planar loop is redundant in space
def test_reactions_are_drawn_at_their_joint(motion):
    painter = Painter(shown(motion, 10, joints=["C"]), *SIZE)
    painter.picture(1)
    pin = painter.positions[1, 1] + painter.rotations[1, 1] @ [1, 0, 0]
    (begin, end), force = painter.arrows[0].get_segments()[0], painter.reactions[0].forces[1]
    assert begin == pytest.approx(painter._seen(pin)[0], abs=1e-3)
    beyond = painter._seen(pin + 1e-3 * force / np.linalg.norm(force))[0] - begin
    x, y = end - begin
    assert beyond[0] * y == pytest.approx(beyond[1] * x, abs=1e-6) and beyond @ (end - begin) > 0


def test_a_film_of_mpeg_is_a_film(motion, tmp_path):
    pytest.importorskip("imageio_ffmpeg", reason="imageio-ffmpeg brings ffmpeg")
    path = export_film(motion, tmp_path / "film.mp4", frames=10, size=SIZE)
    assert path.read_bytes()[4:8] == b"ftyp" and path.stat().st_size > 1000


REFUSED = {
    "another ending": ("film.avi", FileError, "written as .gif or .mp4"),
    "no folder": ("none/film.gif", FileError, "cannot be written: there is no folder"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_film_that_cannot_be_written_is_named(motion, tmp_path, name):
    path, kind, words = REFUSED[name]
    with pytest.raises(kind, match=words):
        export_film(motion, tmp_path / path)


def test_without_ffmpeg_the_remedy_is_said(motion, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(FileError, match="pip install imageio-ffmpeg, or write a .gif"):
        export_film(motion, tmp_path / "film.mp4")


def test_a_trace_of_nothing_is_refused(motion, tmp_path):
    with pytest.raises(StateError, match="'cranc'.*'crank'"):
        export_film(motion, tmp_path / "film.gif", traces=["cranc"])


@pytest.mark.slow
def test_a_notebook_shows_a_page_that_needs_no_server(motion):
    found = page(motion, frames=5)
    shown_there = found._repr_html_()
    assert shown_there.startswith("<iframe srcdoc=") and found.html.lstrip()[:15].lower().startswith("<!doctype html")
    assert repr(found) == "Page()" and "&lt;html" in shown_there


@pytest.mark.slow
def test_contact_forces_bear_what_stands():
    """At rest the places where a box touches bear its weight; once thrown up it touches nowhere."""
    scene = gauss.load("box_on_plane_8")
    scene.loads.clear()
    scene.starts.clear()
    standing = gauss.simulate(scene, 0.1)
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # a picture does not warn of forces that are not unique
        found = touches(standing, resampled(standing, 5), 0.4)
    assert len(found) == sum(place.closed.all() for place in found) == 4
    weight = sum(body.mass for body in scene.bodies.values()) * 9.81
    assert sum(place.forces for place in found)[-1] == pytest.approx([0, 0, weight], rel=1e-6, abs=1e-6)
    scene.start("box moves", rate=(0, 0, 1.0, 0, 0, 0))
    flying = gauss.simulate(scene, 0.1)
    assert not any(place.closed[-1] or place.forces[-1].any() for place in touches(flying, resampled(flying, 5), 0.4))


@pytest.mark.slow
def test_contacts_of_a_stack_bear_its_weight_in_every_picture():
    scene = stack(3)
    standing = gauss.simulate(scene, 0.05, integrator="time_stepping", step=1e-3)
    found = touches(standing, resampled(standing, 4), 1.0)
    assert all(place.closed.all() for place in found)
    weights = 9.81 * np.arange(3, 0, -1).sum()  # each box bears those above it
    assert sum(place.forces for place in found) == pytest.approx(np.tile([0.0, 0.0, weights], (4, 1)), abs=1e-3)
    drawn = shown(scene, 4)
    assert len(touches(drawn.motion, drawn.pictures, 1.0)) == len(found)  # of a scene that is not simulated, without forces


OF_A_SCENE = {
    "pendulum": ("--trace", "rod"),
    "block_on_incline": ("--integrator", "time_stepping", "--step", "0.01"),  # friction of contacts
}


@pytest.mark.slow
@pytest.mark.parametrize("scene", OF_A_SCENE)
def test_the_command_line_writes_films(tmp_path, scene):
    from typer.testing import CliRunner

    from gauss.cli import app

    path = tmp_path / f"{scene}.gif"
    result = CliRunner().invoke(app, ["show", scene, "--duration", "0.1", "--gif", str(path), *OF_A_SCENE[scene]])
    assert result.exit_code == 0 and path.exists() and f"film written to {path}" in result.output.replace("\n", "")


@pytest.mark.parametrize("option", [("--dark",), ("--beside", "motion.nc")])
def test_what_a_film_cannot_show_is_refused_before_the_motion(tmp_path, option):
    from typer.testing import CliRunner

    from gauss.cli import app

    arguments = ["show", "pendulum", "--duration", "1e9", "--gif", str(tmp_path / "film.gif"), *option]
    assert isinstance(CliRunner().invoke(app, arguments).exception, FileError)
