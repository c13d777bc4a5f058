"""Limits between the collocation points: kept by finer meshes, or named with the size of the excess."""

import warnings
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

import gauss
from gauss.analysis.optimal.limit_excess import limit_excess
from gauss.analysis.optimal.phases import MeshSettings, PhaseProblems
from gauss.errors import LimitWarning

pytest.importorskip("casadi")
G = 9.81
KEPT = 2e-6  # of the units: twice the default tolerance of the mesh
HEIGHT, SPEED = 0.3, -3.0
START, END = {"lift": HEIGHT, "lift rate": SPEED}, {"lift": HEIGHT, "lift rate": 0.0}
SINGLE = {"intervals": 3, "refinements": 0}  # one mesh, too coarse


def ball():
    """Mass of 1 kg above a floor."""
    scene = gauss.Scene("ball")
    scene.prismatic("lift", "ground", scene.body("ball", 1.0, (0.1, 0.1, 0.1)), axis=(0, 0, 1))
    scene.stop("lift", lowest=0.0, name="floor")
    scene.input("push", "lift", limits=100.0)
    return scene


def four_bar():
    scene = gauss.load("four_bar")
    scene.starts.clear()
    scene.input("motor", "A")
    return scene


def sampled(motion):
    """The motion of its inputs, without its stops, at many times."""
    scene = replace(motion.system.scene, contacts={})
    own = replace(motion, system=gauss.compile_scene(scene))
    return own.simulate(times=np.linspace(motion.t[0], motion.t[-1], 4001), rtol=1e-10, atol=1e-10)


@pytest.mark.slow
@pytest.mark.parametrize("intervals", [3, 20])
def test_a_gap_that_is_touched_stays_open(intervals):
    """Two cubics that meet at rest on the floor, at the time of least effort: ∫ (x″ + g)² of each in closed form."""

    def effort(touch):
        down = 4.0 * SPEED**2 / touch + 12.0 * SPEED * HEIGHT / touch**2 + 12.0 * HEIGHT**2 / touch**3
        return down + 12.0 * HEIGHT**2 / (1.0 - touch) ** 3 - 2.0 * G * SPEED + G**2

    found = gauss.optimal_motion(ball(), 1.0, start=START, end=END, intervals=intervals)
    assert found.cost == pytest.approx(minimize_scalar(effort, bounds=(0.05, 0.9), method="bounded").fun, rel=1e-5)
    assert found.limit_error <= KEPT
    assert sampled(found).q.min() >= -KEPT * found.system.scale.length
    assert len(found.meshes) > 1


def test_what_is_beyond_its_limit_is_named_with_its_size():
    with pytest.warns(LimitWarning, match=r"the gap of 'floor.lowest' by (0.0\d+) at t = 0.\d+ s") as caught:
        found = gauss.optimal_motion(ball(), 1.0, start=START, end=END, **SINGLE)
    depth = -sampled(found).q.min()
    named = float(str(caught[0].message).partition("' by ")[2].partition(" ")[0])
    assert 0.9 * depth <= named <= depth * 1.001 and depth > 1e-3  # 16 parts of an interval
    assert found.limit_error * found.system.scale.length == pytest.approx(named, rel=1e-2)


@pytest.mark.slow
def test_a_rate_of_a_linkage_keeps_its_limit():
    rest, limit = {"A": 0.0, "A rate": 0.0}, 6.5
    given = {"start": rest, "end": rest | {"A": 3.0}, "limits": {"A rate": limit}, "tolerance": 1e-5}
    found = gauss.optimal_motion(four_bar(), 0.6, **given)
    unit = found.system.scale.rates[found.system.column("A")]
    assert found.limit_error <= 2e-5 and found.mesh_error <= 1e-5
    assert sampled(found).rate("A").max() - limit <= 3e-5 * unit
    assert found.v[:, found.system.column("A")].max() == pytest.approx(limit, rel=1e-3)


@pytest.mark.parametrize("push, excess", [(12.0, 12.0 - G), (5.0, 0.0)])
def test_a_floor_does_not_pull(push, excess):
    """The force of the floor is m g − u."""
    settings = MeshSettings(4, 6, 1e-6, 6, 100)
    made = PhaseProblems(gauss.compile_scene(ball()), [gauss.MotionPhase(1.0, closed="floor")], settings, {})
    (problem,), t = made.problems, np.linspace(0.0, 1.0, 5)
    found = limit_excess(problem, t, np.zeros((4, 17, 2)), np.full((4, 2, 1), push))
    unit = problem.force_labels[0][1]
    assert found.of_intervals * unit == pytest.approx(np.full(4, excess), abs=1e-9)
    assert found.where.startswith("the force of 'floor.lowest' by 2.19") == (excess > 0.0)


def test_limits_that_are_kept_are_not_warned_of():
    with warnings.catch_warnings():
        warnings.simplefilter("error", LimitWarning)
        far = START | {"lift": 2.0}
        found = gauss.optimal_motion(ball(), 1.0, start=far, end=END | {"lift": 2.0}, **SINGLE)
    assert found.limit_error == 0.0
