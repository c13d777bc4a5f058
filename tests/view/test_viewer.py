"""The viewer: what stands on the stage is the motion, files play without a network, a browser has nothing to complain of."""

import json
import re
import shutil
import subprocess
import sys

import numpy as np
import pytest
import rich

import gauss
from gauss.errors import FileError
from gauss.system import coordinate_rates
from gauss.view.skeleton import placed
from gauss.view.viewer import export_html, page, show
from gauss.view.viewer.forms import forms
from gauss.view.viewer.framing import CAMERAS, FIELD, framing, joined, placed_camera
from gauss.view.viewer.show import LOOPBACK, _free_port
from gauss.view.viewer.shown import _slopes, resampled
from gauss.view.viewer.stage import colour_of

FLOATS = 1e-6  # relative: positions travel in single precision
CHROMIUM = shutil.which("chromium") or shutil.which("google-chrome")
SOFTWARE = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]  # no graphics card is needed


@pytest.fixture(scope="module")
def motion():
    return gauss.simulate(gauss.load("four_bar"), 0.5, times=np.linspace(0, 0.5, 31))


@pytest.fixture(scope="module")
def viewer(motion):
    found = show(motion, joints=["C"], port=_free_port())
    found.player.play(False)
    yield found
    found.close()


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::gauss.errors.NonUniqueReactionWarning")  # a planar loop is redundant in space
def test_the_stage_shows_the_motion(viewer):
    stage = viewer.player.stage
    for k in (0, 17, len(stage.trajectory) - 1):
        stage.to(k)
        for name, node in zip(stage.bodies, stage.nodes, strict=True):
            assert node.position == pytest.approx(stage.trajectory.body(name).position[k], abs=FLOATS)
        root, tip = stage.arrows.points[0]
        pin = stage.positions[k, 1] + stage.trajectory.body("coupler").rotation[k] @ [1, 0, 0]
        assert root == pytest.approx(pin, abs=1e-3)
        along = (tip - root) / np.linalg.norm(tip - root)
        force = stage.reactions["C"][k]
        assert along == pytest.approx(force / np.linalg.norm(force), abs=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("camera", CAMERAS)
@pytest.mark.parametrize("others", [0, 1])
@pytest.mark.parametrize("width, height, right, lower", [(1280, 800, 330, 0), (390, 844, 0, 506)])  # of the controls
def test_cameras_show_the_motions_beside_the_controls(motion, others, camera, width, height, right, lower):
    alone = framing(motion)
    displacement = alone.reach * alone.right
    view = joined(alone, alone, displacement) if others else alone
    eye, aim = placed_camera(view, camera, width / height)
    assert (eye - view.floor) @ view.up > 0
    ahead = (aim - eye) / np.linalg.norm(aim - eye)
    across = np.cross(ahead, view.up) / np.linalg.norm(np.cross(ahead, view.up))
    points = np.concatenate([part.reshape(-1, 3) for part in placed(motion).values()])
    seen = np.concatenate([points, points + others * displacement]) - eye
    scale = height / 2 / np.tan(FIELD / 2)  # pixels
    x, y = (scale * (seen @ axis) / (seen @ ahead) for axis in (across, np.cross(across, ahead)))
    assert -width / 2 < x.min() and x.max() < width / 2 - right
    assert lower - height / 2 < y.min() and y.max() < height / 2


@pytest.mark.slow
def test_the_viewer_is_seen_by_this_machine_only(viewer):
    assert viewer.url.startswith(f"http://{LOOPBACK}:")
    with pytest.raises(FileError, match="is taken"):
        show(gauss.load("pendulum"), port=int(viewer.url.rpartition(":")[2]))


@pytest.mark.slow
def test_play_and_pause(viewer):
    player = viewer.player
    player.play(False)
    before = player.now
    player._go(0.25)
    assert player.now == 0.25 != before and player.button.label == "Play"
    player.play(True)
    assert player.button.label == "Pause"
    player.play(False)


def test_steps_pause_and_move_by_a_picture(viewer):
    player = viewer.player
    player._go(float(player.times[3]))
    for pictures, expected in ((1, 4), (-1, 3), (-9, 0), (10**6, len(player.times) - 1)):
        player.step(pictures)
        assert player.now == player.times[expected] and not player.playing


@pytest.mark.slow
def test_two_motions_stand_side_by_side_at_the_same_time(motion):
    longer = gauss.simulate(gauss.load("double_pendulum"), 0.8)
    with_two = show(motion, beside=longer, port=_free_port())
    try:
        first, second = with_two.player.stages
        with_two.player.play(False)
        with_two.player._go(0.8)
        assert first.trajectory.t[-1] == 0.5 and with_two.player.times[-1] == 0.8
        assert second.nodes[1].position == pytest.approx(second.positions[-1, 1], abs=FLOATS)
        apart = first.place_beside(second) @ first.framing.right
        assert apart > 0.0
    finally:
        with_two.close()


def test_a_slider_poses_a_loop_and_the_others_follow():
    posed = show(gauss.load("four_bar"), port=_free_port())
    try:
        player = posed.player
        player.pose("A", 0.4)
        state = player.state
        assert [state.q[0], player.sliders["A"].value] == pytest.approx([0.4, 0.4], abs=1e-12)
        residual, *_ = player.system.loop_constraints(state.q, state.v)
        assert abs(residual).max() < 1e-12
        node = dict(zip(player.stage.bodies, player.stage.nodes, strict=True))["coupler"]
        assert node.position == pytest.approx(gauss.Kinematics(player.system, state).position("coupler"), abs=FLOATS)
        player.reset()
        assert np.array_equal(player.state.q, player.begun.q)
    finally:
        posed.close()


def test_sliders_show_angles_within_a_turn_in_steps_of_theirs():
    posed = show(gauss.load("double_pendulum"), port=_free_port())
    try:
        player, slider = posed.player, posed.player.sliders["A"]
        for angle, seen in ((2 * np.pi + 0.3, 0.3), (-np.pi - 0.2, np.pi - 0.2), (0.123456789, 0.123)):
            player._place(player.system.state([angle, 0.0], [0.0, 0.0]))
            assert abs(slider.value - seen) <= slider.step and round(slider.value, 3) == slider.value
            assert player.state.q[0] == angle
    finally:
        posed.close()


@pytest.mark.slow
def test_a_spring_pulls_a_point_to_the_pointer():
    scene = gauss.Scene("puck", gravity=(0, 0, 0))
    scene.free("F", "ground", scene.body("puck", mass=2.0, inertia=(0.1, 0.1, 0.1)))
    posed = show(scene, port=_free_port())
    try:
        player = posed.player
        player._grasp("puck", np.array([0.1, 0.0, 0.0]))
        player.play(False)
        player.pull.goal = np.array([0.3, 0.2, 0.1])
        for _ in range(150):
            player.advance(1 / 60)
        held = gauss.Kinematics(player.system, player.state).position("puck", player.pull.local)
        assert held == pytest.approx(player.pull.goal, abs=1e-3)  # m: after 30 times 1/ω
    finally:
        posed.close()


@pytest.mark.slow
def test_a_page_has_curves_cameras_and_layers_beside_the_scene(motion):
    text = page(motion, joints=["C"], dark=True).html
    panel = text[text.index('<aside id="panel" class="dark">') :]
    given = json.loads(re.search(r"const given = (.*);", panel)[1])
    assert set(given["cameras"]) == set(CAMERAS) and given["span"] == pytest.approx(0.5)
    distances = [np.linalg.norm(np.subtract(place, given["middle"])) for place in given["cameras"].values()]
    assert distances == pytest.approx([distances[0]] * len(distances))
    assert not given["layers"]["frames"]["visible"] and given["layers"]["reactions"]["nodes"] == ["/reactions"]
    for label in ("coordinates [rad]", "rates [rad/s]", "energies [J]"):
        assert label in panel


@pytest.mark.slow
def test_curves_of_two_motions_say_which_side_they_are_of(motion):
    both = page(motion, beside=motion).html
    for label in ("coordinates [rad]", "rates [rad/s]", "energies [J]"):
        assert [both.count(f">{label}{side}<") for side in ("", ", left", ", right")] == [0, 1, 1]


@pytest.mark.slow
def test_meshes_of_both_motions_are_drawn(motion):
    from gauss.io.visuals import Visual

    triangle = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    first, second = ([Visual(body, triangle, np.array([[0, 1, 2]]), (1.0, 1.0, 1.0))] for body in ("crank", "rocker"))
    both = show(motion, visuals=first, beside=motion, beside_visuals=second, port=_free_port())
    try:
        for stage, body in zip(both.player.stages, ("crank", "rocker"), strict=True):
            drawn = [handle for name, handle in stage.solids if name == body]
            assert [len(handle.vertices) for handle in drawn] == [len(triangle)]
    finally:
        both.close()


@pytest.mark.slow
def test_pictures_between_samples_lie_on_the_motion():
    coarse = gauss.simulate(gauss.load("four_bar"), 0.5, times=np.linspace(0, 0.5, 11))
    fine = gauss.simulate(gauss.load("four_bar"), 0.5, times=np.linspace(0, 0.5, 41))
    shown = resampled(coarse, 41)
    assert shown.t == pytest.approx(fine.t)
    assert abs(shown.q - fine.q).max() < 0.02  # rad, of a crank at 10 rad/s: not to be seen
    assert shown.q[::4] == pytest.approx(coarse.q, abs=1e-12)


def test_pictures_of_quaternions_are_rotations():
    shown = resampled(gauss.simulate(gauss.load("heavy_top"), 0.2), 50)
    for places in shown.system.quaternions.values():
        assert np.linalg.norm(shown.q[:, places], axis=1) == pytest.approx(1.0)


@pytest.mark.parametrize("name", ["four_bar", "cart_pole", "box_on_plane_4", "newtons_cradle", "free_body", "cardan"])
def test_every_body_has_a_form(name):
    system = gauss.compile_scene(gauss.load(name))
    found = forms(system)
    assert {form.body for form in found if form.role != "joint"} >= set(system.structure.bodies)
    for form in found:
        assert np.isfinite(form.mesh.vertices).all() and len(form.mesh.faces)


@pytest.mark.slow
def test_shapes_of_contact_are_in_the_picture():
    scene = gauss.Scene("tower", gravity=(0, 0, -9.81))
    box = scene.body("box", 1.0, (0.1, 0.1, 0.1), position=(0, 0, 1.0))
    scene.free("F", "ground", box, at=(0, 0, 1.0))
    scene.box("hull", box, size=(0.4, 0.4, 2.0))
    view = framing(gauss.simulate(scene, 0.01, times=[0.0, 0.01]))
    assert view.reach >= np.linalg.norm([0.4, 0.4, 2.0])
    np.testing.assert_allclose(view.middle, [0.0, 0.0, 1.0], atol=1e-3)  # it falls 0.5 mm


@pytest.mark.slow
def test_paths_are_those_of_centres_of_mass_and_of_frames():
    scene = gauss.load("four_bar")
    scene.frame("tip", "rocker", (0.2, 0.1, 0.0))
    moving = gauss.simulate(scene, 0.1, times=np.linspace(0.0, 0.1, 5))
    viewer = show(moving, traces=("coupler", "tip"), port=_free_port())
    paths = viewer.player.stage.parts["path"]
    for handle, name, part in zip(paths, ("coupler", "tip"), ("com", "position"), strict=True):
        ends = getattr(moving.body(name), part)[[0, -1]]
        np.testing.assert_allclose(handle.points[[0, -1], [0, 1]], ends, atol=FLOATS)
    viewer.close()


def test_terrain_is_drawn_and_lies_above_the_floor():
    scene = gauss.Scene("land")
    heights = np.array([[0.3, 0.0, 0.2], [-0.4, 0.1, 0.0]])
    field = scene.height_field("land", "ground", heights, (2, 1), at=(0.1, 0.2, 0.3))
    scene.body("ball", 1.0, (0.1, 0.1, 0.1))
    scene.free("F", "ground", "ball")
    scene.sphere("round", "ball", 0.1)
    scene.start("F", position=(0, 0, 2, 1, 0, 0, 0))
    motion = gauss.simulate(scene, 0.1)
    (drawn,) = [form.mesh for form in forms(motion.system) if form.body == "ground" and form.role == "contact"]
    assert drawn.bounds == pytest.approx(np.array([[-0.9, -0.3, -0.1], [1.1, 0.7, 0.6]]))
    assert len(drawn.faces) == 4
    assert (drawn.face_normals[:, 2] > 0.0).all()
    assert framing(motion).floor[2] < np.array(field.heights).min() + 0.3
    seen = {colour_of(form, ["ball"]) for form in forms(motion.system) if form.role == "contact"}
    assert len(seen) == 2  # the ball is seen against it


def test_shapes_of_bodies_beside_each_other_have_colours_of_their_own():
    scene = gauss.Scene("pair")
    for name, x in (("left", 0.0), ("right", 1.0)):
        scene.body(name, 1.0, (0.1, 0.1, 0.1), com=(x, 0, 0))
        scene.free(f"F {name}", "ground", name)
        scene.sphere(f"ball {name}", name, 0.1)
    shapes = [form for form in forms(gauss.dynamics.compile_scene(scene)) if form.role == "contact"]
    assert len({colour_of(form, ["left", "right"]) for form in shapes}) == len(shapes) == 2


def test_slopes_of_all_samples_are_the_rates_of_the_coordinates():
    for name in ("heavy_top", "cart_pole"):
        motion = gauss.simulate(gauss.load(name), 0.1)
        one_by_one = [coordinate_rates(motion.system, q, v) for q, v in zip(motion.q, motion.v, strict=True)]
        np.testing.assert_allclose(_slopes(motion.system, motion.q, motion.v), one_by_one, rtol=1e-14, atol=1e-14)


@pytest.mark.slow
def test_meshes_of_a_robot_are_in_place():
    from gauss.io.visuals import read_visuals

    found = read_visuals("robot:panda")
    bodies = set(gauss.load("robot:panda").bodies) | {"ground"}
    assert {visual.body for visual in found} <= bodies and len(found) == 11
    for visual in found:  # links are of about the size of a hand, around the origin of their body
        assert np.ptp(visual.vertices, axis=0).max() < 0.5 and abs(visual.vertices).max() < 0.5
        assert visual.faces.max() < len(visual.vertices)
    assert read_visuals("four_bar") == []


@pytest.mark.parametrize("path, words", [("motion.htm", "written as .html"), ("none/motion.html", "cannot be written")])
def test_a_file_that_cannot_be_written_is_named(tmp_path, path, words):
    with pytest.raises(FileError, match=words):
        export_html(gauss.load("pendulum"), tmp_path / path)


@pytest.mark.slow
def test_a_motion_on_disk_is_the_motion(motion, tmp_path):
    again = gauss.load_motion(gauss.save(motion, tmp_path / "motion.nc"))
    for part in ("t", "q", "v", "work"):
        assert getattr(again, part) == pytest.approx(getattr(motion, part), abs=0)
    assert again.stats == motion.stats
    (tmp_path / "text.nc").write_text("no motion")
    with pytest.raises(FileError, match="not a motion"):
        gauss.load_motion(tmp_path / "text.nc")


@pytest.mark.slow
@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium on this machine")
def test_a_browser_plays_the_file_and_does_not_complain(motion, tmp_path):
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright drives the browser")
    path = export_html(motion, tmp_path / "motion.html")
    said, asked = [], []
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=SOFTWARE)
        page = browser.new_page(viewport={"width": 320, "height": 240})
        page.on("console", lambda message: said.append((message.type, message.text)))
        page.on("pageerror", lambda error: said.append(("error", str(error))))
        page.on("request", lambda request: asked.append(request.url))
        page.goto(path.as_uri())
        page.wait_for_selector("canvas", timeout=60_000)
        clock = page.locator("input").first
        times = {clock.input_value()}
        for _ in range(100):
            page.wait_for_timeout(100)
            times.add(clock.input_value())
            if len(times) > 2:
                break
        browser.close()
    assert len(times) > 2, "the motion does not play"
    assert [entry for entry in said if entry[0] == "error"] == []
    assert [url for url in asked if not re.match(r"(file|data|blob):", url)] == []


@pytest.mark.slow
@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium on this machine")
def test_a_browser_plays_what_the_server_shows(viewer):
    """The button in the browser starts the clock of the server, which moves the time in the browser."""
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright drives the browser")
    said, player = [], viewer.player
    player.play(False)
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=SOFTWARE)
        page = browser.new_page(viewport={"width": 640, "height": 480})
        page.on("console", lambda message: said.append((message.type, message.text)))
        page.on("pageerror", lambda error: said.append(("error", str(error))))
        page.goto(viewer.url)
        page.wait_for_selector("canvas", timeout=60_000)
        page.get_by_role("button", name="Play", exact=True).click(timeout=60_000)
        for _ in range(100):
            page.wait_for_timeout(100)
            if player.playing and player.now > 0.05:
                break
        assert player.playing and page.get_by_text("energies [J]").count() == 1
        player.play(False)
        browser.close()
    assert [entry for entry in said if entry[0] == "error"] == []


def test_the_library_says_nothing_of_its_own(motion):
    with rich.get_console().capture() as said:  # what a notebook would show beside the viewer
        show(motion, port=_free_port()).close()
    assert said.get() == ""


WITHOUT = """
import sys
sys.modules["viser"] = None  # as if it were not installed
import gauss
try:
    gauss.show(gauss.load("pendulum"))
except ImportError as error:
    print(type(error).__name__, error)
from gauss.cli import main
sys.argv = ["gauss", "show", "pendulum"]
main()
"""


@pytest.mark.slow
def test_without_the_library_the_remedy_is_said():
    remedy = "viser is not installed: pip install viser"
    ran = subprocess.run([sys.executable, "-c", WITHOUT], capture_output=True, text=True)
    assert ran.stdout.startswith(f"MissingPackageError {remedy}")
    assert ran.returncode != 0 and remedy in ran.stderr and "Traceback" not in ran.stderr
