"""Figures of motions: what is drawn is the motion, and every axis says its unit."""

import warnings
from dataclasses import replace

import numpy as np
import pytest

import gauss
from gauss import view
from gauss.errors import FileError, NonUniqueReactionWarning, StateError
from gauss.scene import GROUND
from gauss.system import coordinate_units
from gauss.view.skeleton import lines, placed, skeleton
from gauss.view.style import FLAT_CHANGE

ROUNDING = 1e-12  # of positions along a chain of rotations [m]
FIGURES = {
    name: getattr(view, f"plot_{name}")
    for name in ("motion", "coordinates", "speeds", "energy", "reactions", "phase", "stroboscope")
}


@pytest.fixture(scope="module")
def motions():
    times = np.linspace(0, 0.2, 21)
    return {name: gauss.simulate(gauss.load(name), 0.2, times=times) for name in ("four_bar", "cart_pole", "heavy_top")}


def _axes(figure):
    return [axes for axes in figure.axes if axes.get_visible()]


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::gauss.errors.NonUniqueReactionWarning")  # a planar loop is redundant in space
@pytest.mark.parametrize("scene", ["four_bar", "cart_pole"])
@pytest.mark.parametrize("name", FIGURES)
def test_every_axis_has_a_label_with_its_unit(motions, scene, name):
    figure = FIGURES[name](motions[scene])
    for axes in _axes(figure):
        label = axes.get_ylabel()
        assert "[" in label and "]" in label, name
        if axes.get_xlabel():
            assert "[" in axes.get_xlabel()
    assert motions[scene].system.scene.name in figure.get_suptitle()


@pytest.mark.slow
@pytest.mark.parametrize("ending, starts", [(".png", b"\x89PNG"), (".svg", b"<?xml"), (".pdf", b"%PDF")])
def test_figures_are_saved_in_three_formats(motions, tmp_path, ending, starts):
    path = tmp_path / f"figure{ending}"
    view.plot_phase(motions["cart_pole"], path=path)
    assert path.read_bytes().startswith(starts)


@pytest.mark.parametrize("draw", FIGURES.values())
def test_other_formats_are_refused_at_once(motions, draw):
    with pytest.raises(FileError, match="saved as one of .png, .svg, .pdf"):
        draw(motions["cart_pole"], path="figure.jpeg")


def test_a_folder_that_does_not_exist_is_named(motions, tmp_path):
    with pytest.raises(FileError, match="there is no folder"):
        view.plot_phase(motions["cart_pole"], path=tmp_path / "none" / "figure.png")


def test_curves_are_the_coordinates_of_one_unit(motions):
    motion = motions["cart_pole"]
    first, second = view.plot_coordinates(motion).axes
    assert first.get_ylabel() == "coordinate [rad]" and second.get_ylabel() == "coordinate [m]"
    for axes, joint in ((first, "pin"), (second, "rail")):
        (line,) = axes.lines
        assert line.get_label() == joint
        assert line.get_ydata() == pytest.approx(motion.coordinate(joint), abs=0)


def test_rounding_is_drawn_as_a_flat_line(motions):
    """The coordinate of a slide that rests but for 1e-35 m, beside one that moves."""
    motion = motions["cart_pole"]
    rail = list(motion.system.coordinates).index("rail")
    q = motion.q.copy()
    q[:, rail] = 1e-35 * np.sin(motion.t)
    moving, resting = view.plot_coordinates(replace(motion, q=q)).axes
    assert np.ptp(resting.get_ylim()) == pytest.approx(2 * FLAT_CHANGE * motion.system.scale.length)
    low, high = moving.get_ylim()
    assert np.ptp(motion.coordinate("pin")) <= high - low <= 1.2 * np.ptp(motion.coordinate("pin"))


def test_turns_of_a_free_body_go_on_over_whole_turns():
    scene = gauss.Scene("spinning", gravity=(0, 0, 0))
    scene.body("disk", 1.0, (0.1, 0.1, 0.2))
    scene.free("F", "ground", "disk")
    scene.start("F", rate=(0, 0, 0, 0, 0, 10.0))
    motion = gauss.simulate(scene, 2.0, times=np.linspace(0, 2, 101))
    left, right = view.plot_motion(motion).axes[:2]
    names = [line.get_label() for line in left.lines]
    assert names == [line.get_label() for line in right.lines] == list(motion.system.coordinates)
    assert left.lines[-1].get_ydata() == pytest.approx(10.0 * motion.t, abs=1e-6)


def test_many_coordinates_have_the_colours_of_their_joints():
    scene = gauss.Scene("three")
    for name in "abc":
        scene.body(name, 1.0, (0.1, 0.1, 0.2))
        scene.free(f"F{name}", "ground", name)
    left, right = view.plot_motion(gauss.simulate(scene, 0.1)).axes[:2]
    assert [text.get_text() for text in right.get_legend().get_texts()] == ["Fa", "Fb", "Fc"]
    assert len({line.get_color() for line in left.lines}) == 3


def test_the_energy_of_a_scene_at_rest_is_drawn_in_the_scale_of_the_scene():
    scene = gauss.Scene("resting")
    scene.body("box", 2.0, (0.1, 0.1, 0.1))
    scene.free("F", "ground", "box")
    scene.box("cube", "box", (0.2, 0.2, 0.2))
    scene.half_space("floor", "ground")
    scene.contact("on", "cube", "floor", friction=0.5)
    scene.start("F", position=(0, 0, 0.1, 1, 0, 0, 0))
    motion = gauss.simulate(scene, 0.1, integrator="time_stepping", step=1e-3)
    energies, balance, _ = view.plot_energy(motion).axes
    assert np.ptp(energies.get_ylim()) > 1e3 * max(np.ptp(line.get_ydata()) for line in energies.lines)
    assert max(balance.lines[0].get_ydata()) < FLAT_CHANGE


def test_reactions_are_the_sizes_of_forces(motions):
    motion = motions["cart_pole"]
    force = view.plot_reactions(motion, ["pin"]).axes[0].lines[0].get_ydata()
    assert force == pytest.approx(np.linalg.norm(gauss.reactions(motion, "pin").force, axis=1), abs=0)


def test_open_reactions_are_not_drawn_and_the_title_says_so(motions):
    """Of a planar loop those out of the plane: what is left is the force in the plane, which is unique."""
    motion = motions["four_bar"]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        force = view.plot_reactions(motion, ["A"]).axes[0]
    with pytest.warns(NonUniqueReactionWarning):
        expected = np.linalg.norm(gauss.reactions(motion, "A").force[:, :2], axis=1)
    assert force.lines[0].get_ydata() == pytest.approx(expected, rel=1e-12)
    assert force.get_title() == "unique components only, in A"


def test_a_phase_portrait_starts_at_the_start(motions):
    motion = motions["cart_pole"]
    (axes,) = _axes(view.plot_phase(motion, ["pin"]))
    curve, dot = axes.lines
    assert (curve.get_xdata()[0], curve.get_ydata()[0]) == (motion.coordinate("pin")[0], motion.rate("pin")[0])
    assert (dot.get_xdata()[0], dot.get_ydata()[0]) == (curve.get_xdata()[0], curve.get_ydata()[0])


def test_parts_of_quaternions_have_no_phase_portrait(motions):
    with pytest.raises(StateError, match="parts of quaternions"):
        view.plot_phase(motions["heavy_top"])


def test_skeletons_of_neighbours_meet_in_their_joint(motions):
    motion = motions["four_bar"]
    shapes = placed(motion)
    for joint in ("crank", "coupler"), ("coupler", "rocker"), ("crank", GROUND), ("rocker", GROUND):
        one, other = (shapes[name] for name in joint)
        distances = np.linalg.norm(one[:, :, None] - other[:, None], axis=-1)
        assert distances.min(axis=(1, 2)).max() < ROUNDING


def test_the_outline_of_a_platform_does_not_cross_itself():
    scene = gauss.Scene("plate")
    scene.body("plate", mass=1.0, inertia=(0.1, 0.1, 0.1))
    angles = np.deg2rad([0, 200, 80, 280, 140, 30])  # in no order
    scene.free("F", "ground", "plate", at=(1.0, 0.0, 0.0))
    for k, angle in enumerate(angles[1:]):
        scene.body(f"leg {k}", mass=1.0, inertia=(0.1, 0.1, 0.1), position=(np.cos(angle), np.sin(angle), 0))
        scene.ball(f"B{k}", "plate", f"leg {k}", at=(np.cos(angle), np.sin(angle), 0))
    points = skeleton(gauss.compile_scene(scene))["plate"]
    turned = np.unwrap(np.arctan2(points[:, 1], points[:, 0]))
    assert (np.diff(turned) > 0).all() or (np.diff(turned) < 0).all()
    assert len(lines(points)) == len(points) == 6


@pytest.mark.slow
def test_the_stroboscope_shows_the_last_position_in_full(motions):
    motion = motions["four_bar"]
    axes = view.plot_stroboscope(motion, flashes=5).axes[0]
    drawn = axes.collections[4].get_segments()  # of the crank, which is first, at the fifth flash
    ends = sorted(drawn[0].tolist())
    expected = sorted(placed(motion)["crank"][-1][:, :2].tolist())
    assert np.array(ends) == pytest.approx(np.array(expected), abs=ROUNDING)
    assert axes.collections[4].get_alpha() == 1.0


@pytest.mark.parametrize("plane", ["x", "xx", "ab", "xyz"])
def test_a_plane_is_two_axes(motions, plane):
    with pytest.raises(StateError, match="two axes"):
        view.plot_stroboscope(motions["four_bar"], plane=plane)


HERMITE = 1e-6  # rad: h⁴ q⁗ / 384 of the finer one's steps


@pytest.mark.slow
@pytest.mark.parametrize("name", ["double_pendulum", "double_pendulum_stops", "heavy_top"])
def test_differences_between_samples_are_those_of_the_motions(name):
    scene = gauss.load(name)
    fine, coarse = (gauss.simulate(scene, 1.0, rtol=rtol, atol=rtol) for rtol in (1e-12, 1e-5))
    same = gauss.simulate(scene, 1.0, times=np.unique(coarse.t))
    assert len(coarse) < len(fine)
    figure = coarse.plot(fine)
    columns = dict(zip(coordinate_units(fine.system), zip(same.q.T, coarse.q.T, strict=True), strict=True))
    places = np.searchsorted(same.t, coarse.t)
    for values, apart in zip(figure.axes[::2], figure.axes[1::2], strict=True):
        exact, found = columns[values.get_ylabel().partition(" [")[0]]
        (line,) = apart.lines
        assert line.get_ydata() == pytest.approx(abs(found - exact[places]), abs=HERMITE)


@pytest.mark.slow
def test_a_comparison_shows_the_difference_from_the_first_motion(tmp_path):
    scene = gauss.load("pendulum")
    one, two = (
        gauss.simulate(scene, 1.0, rtol=rtol, times=np.linspace(0, 1, samples))
        for rtol, samples in ((1e-12, 51), (1e-4, 101))
    )
    figure = one.plot(two, path=tmp_path / "both.png")
    values, apart = figure.axes
    assert (tmp_path / "both.png").exists() and len(values.lines) == 2 and len(apart.lines) == 1
    assert apart.lines[0].get_ydata() == pytest.approx(abs(two.q[::2, 0] - one.q[:, 0]), abs=1e-12)
    for wrong in (
        {"motions": [one]},
        {"motions": [one, two], "coordinates": ["none"]},
        {"motions": [one, two], "labels": ["a"]},
    ):
        with pytest.raises(gauss.errors.ArgumentError):
            gauss.view.plot_comparison(**wrong)
