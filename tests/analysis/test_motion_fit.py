import numpy as np
import pytest

import gauss
from gauss.errors import ArgumentError, FileError, SceneError, SimulationError, StateError

EXACT = 1e-5  # relative: the steps of the fit have errors of 1e-9, times the condition of the parameters
NOISE = 1e-3  # rad
RUNS, WITHIN = 8, 5.0  # noisy fits, and standard deviations of the sums of their squared errors


def sprung():
    scene = gauss.load("four_bar")
    scene.joint_spring("spring", "A", stiffness=5.0, damping=0.3, rest=0.2)
    return scene


def driven():
    scene = gauss.load("cart_pole")
    scene.input("push", "rail", limits=(-50.0, 50.0))
    return scene


# scene, duration, measured, parameters with first values, true values
CASES = {
    "pendulum": (
        lambda: gauss.load("pendulum"),
        1.0,
        ("A",),
        {"gravity.y": -9.0, "A.rate": 0.1},
        {"gravity.y": -9.81, "A.rate": 0.0},
    ),
    "four-bar": (
        sprung,
        0.5,
        ("A", "D"),
        {"spring.stiffness": 4.0, "spring.damping": 0.2, "A.rate": 9.0},
        {"spring.stiffness": 5.0, "spring.damping": 0.3, "A.rate": 10.0},
    ),
    "double pendulum": (
        lambda: gauss.load("double_pendulum"),
        0.5,
        ("A", "B rate"),
        {"lower.mass": 1.4, "lower.com.x": 0.45},
        None,
    ),
}


def motion(scene, duration, columns, count=51):
    t = np.linspace(0.0, duration, count)
    found = gauss.simulate(scene, duration, times=t, progress=False)
    names = [*found.system.coordinates]
    take = lambda name: (found.v if name.endswith(" rate") else found.q)[:, names.index(name.removesuffix(" rate"))]  # noqa: E731
    return t, {name: take(name) for name in columns}


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_exact_motions_give_the_true_parameters(name):
    make, duration, columns, first, true = CASES[name]
    scene = make()
    t, measured = motion(scene, duration, columns)
    found = gauss.fit_motion(scene, t, measured, first, step=0.005)
    true = true or {"lower.mass": scene.bodies["lower"].mass, "lower.com.x": scene.bodies["lower"].com[0]}
    for parameter, value in true.items():
        assert found.values[parameter] == pytest.approx(value, rel=EXACT, abs=EXACT)
    assert str(found) and found.residual.max() <= EXACT


@pytest.mark.slow
def test_confidence_of_noisy_motions():
    """Σ (p − p̂)ᵀ C⁻¹ (p − p̂) over independent runs is χ² of all their degrees."""
    scene, rng = gauss.load("pendulum"), np.random.default_rng(5)
    t, measured = motion(scene, 1.0, ("A",))
    true = {"gravity.y": -9.81, "A.rate": 0.0}
    total, wanted = 0.0, RUNS * len(true)
    for _ in range(RUNS):
        noisy = {"A": measured["A"] + NOISE * rng.standard_normal(t.size)}
        found = gauss.fit_motion(scene, t, noisy, {"gravity.y": -9.5, "A.rate": 0.05}, step=0.02, noise=[NOISE])
        error = np.array([found.values[key] - true[key] for key in true])
        total += error @ np.linalg.solve(found.covariance, error)
    assert abs(total - wanted) <= WITHIN * np.sqrt(2.0 * wanted)


@pytest.mark.slow
def test_inputs_are_held_between_samples():
    scene, t = driven(), np.linspace(0.0, 0.4, 41)
    table = np.sin(np.arange(40))[:, None]
    true = gauss.simulate(scene, 0.4, times=t, control=table, rate=100.0, progress=False)
    found = gauss.fit_motion(
        scene, t, {"rail": true.q[:, 0]}, {"pole.mass": 0.9 * scene.bodies["pole"].mass}, step=0.01, inputs=table
    )
    assert found.values["pole.mass"] == pytest.approx(scene.bodies["pole"].mass, rel=EXACT)


@pytest.mark.slow
def test_parameters_that_are_not_identified_are_named():
    scene = gauss.load("pendulum")
    t, measured = motion(scene, 0.5, ("A",), 11)
    with pytest.raises(StateError, match="identify 1 combination.*rod.mass, gravity.y"):
        gauss.fit_motion(scene, t, measured, ["rod.mass", "gravity.y"], step=0.05)
    with pytest.raises(StateError, match="'rod.inertia\\[2\\]'"):
        gauss.fit_motion(scene, t, measured, ["rod.mass", "rod.inertia[2]"], step=0.05)
    with pytest.raises(StateError, match="gravity.z"):
        gauss.fit_motion(scene, t, measured, {"gravity.y": -9.0, "gravity.z": 0.1}, step=0.05)


@pytest.mark.parametrize(
    ("change", "error", "words"),
    [
        ({"times": [0.0, 0.0, 1.0]}, ArgumentError, "increasing"),
        ({"measured": {"B": [0.0, 0.0]}}, ArgumentError, "'B'"),
        ({"measured": {"A": [0.0, np.nan]}}, ArgumentError, "finite"),
        ({"parameters": ["rod.mas"]}, SceneError, "mass"),
        ({"parameters": []}, ArgumentError, "names"),
        ({"bounds": {"gravity.y": (1.0, 2.0)}}, ArgumentError, "between"),
        ({"noise": [-1.0]}, ArgumentError, "noise"),
        ({"step": 0.0}, ArgumentError, "step"),
        ({"inputs": [[1.0]]}, ArgumentError, "shape"),
        ({"integrator": "euler"}, ArgumentError, "rk4"),
        ({"confidence": 95}, ArgumentError, "confidence"),
    ],
)
def test_bad_input_is_refused(change, error, words):
    given = {"times": [0.0, 0.1], "measured": {"A": [0.0, 0.01]}, "parameters": ["gravity.y"], "step": 0.01} | change
    with pytest.raises(error, match=words):
        gauss.fit_motion(gauss.load("pendulum"), **given)


def bouncing():
    scene = gauss.Scene("ball", gravity=(0, 0, -9.81))
    scene.prismatic("z", "ground", scene.body("ball", 1.3), axis=(0, 0, 1))
    scene.stop("z", lowest=-0.3, name="floor", restitution=0.6)
    scene.start("z", rate=-0.1)
    return scene


def stopped_four_bar():
    scene = gauss.load("four_bar")
    scene.starts.clear()
    scene.start("A", rate=2.5)
    scene.stop("A", highest=0.1, name="buffer", restitution=0.6)
    return scene


def sliding():
    scene = gauss.Scene("slider", gravity=(0, 0, 0))
    scene.prismatic("x", "ground", scene.body("mass", 1.0))
    scene.joint_spring("spring", "x", stiffness=100.0, rest=-0.3)
    scene.joint_friction("x", 9.0)
    scene.start("x", rate=0.5)
    return scene


# scene, duration, measured, first values, true values; each passes through an event
WITH_EVENTS = {
    "bouncing ball": (
        bouncing,
        0.6,
        ("z",),
        {"floor.restitution": 0.5, "floor.lowest": -0.31, "gravity.z": -9.6, "z.rate": 0.0},
        {"floor.restitution": 0.6, "floor.lowest": -0.3, "gravity.z": -9.81, "z.rate": -0.1},
    ),
    "four-bar": (
        stopped_four_bar,
        0.2,
        ("A",),
        {"buffer.restitution": 0.5, "A.rate": 2.4},
        {"buffer.restitution": 0.6, "A.rate": 2.5},
    ),
    "dry friction": (
        sliding,
        0.5,
        ("x",),
        {"friction of x.limit": 8.5, "spring.stiffness": 90.0},
        {"friction of x.limit": 9.0, "spring.stiffness": 100.0},
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", WITH_EVENTS)
def test_motions_with_events_give_the_true_parameters(name):
    make, duration, columns, first, true = WITH_EVENTS[name]
    t, measured = motion(make(), duration, columns, round(duration / 0.02) + 1)
    found = gauss.fit_motion(make(), t, measured, first, step=0.02, integrator="dop853", noise=[NOISE])
    for parameter, value in true.items():
        assert found.values[parameter] == pytest.approx(value, rel=EXACT, abs=EXACT)


@pytest.mark.parametrize(
    ("times", "parameters", "words"),
    [
        ([0.0, 0.1], ["z.at[0]"], "no derivatives by 'z.at"),
        ([0.0, 0.015], ["floor.restitution"], "whole multiples of step"),
    ],
)
def test_what_cannot_be_fitted_through_events_is_named(times, parameters, words):
    with pytest.raises(ArgumentError, match=words):
        gauss.fit_motion(bouncing(), times, {"z": [0.0, 0.0]}, parameters, step=0.01)


def test_events_without_derivatives_are_refused_by_name():
    scene = gauss.Scene("rolling ball")
    body = scene.body("body", 1.0, (0.1, 0.1, 0.1), position=(0, 0, 0.5))
    scene.free("flight", "ground", body)
    scene.contact("rough", scene.sphere("ball", body, 0.1), scene.half_space("floor", "ground"), friction=0.3)
    with pytest.raises(SimulationError, match="rough"):
        gauss.fit_motion(scene, [0.0, 0.1], {"flight.x": [0.0, 0.0]}, ["body.mass"], step=0.01)


@pytest.mark.slow
def test_the_figure_shows_each_column(tmp_path):
    pytest.importorskip("matplotlib")
    scene = gauss.load("pendulum")
    t, measured = motion(scene, 0.5, ("A", "A rate"), 11)
    found = gauss.fit_motion(scene, t, measured, ["gravity.y"], step=0.05)
    assert [axes.get_ylabel() for axes in found.plot(tmp_path / "fit.svg").axes[::2]] == ["A", "A rate"]
    assert (tmp_path / "fit.svg").exists()
    with pytest.raises(FileError, match="no_format"):
        found.plot(tmp_path / "fit.no_format")
    text = found.report(tmp_path / "fit.html").read_text(encoding="utf-8")
    assert "gravity.y" in text and text.count("<svg") == 2
