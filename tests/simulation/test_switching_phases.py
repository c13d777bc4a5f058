"""Switching loads in motions with contacts, stops and friction: every phase meets the closed form."""

import math

import numpy as np
import pytest

import gauss
from gauss import math as gm
from gauss.errors import GaussError
from tests.support.switching import moved, slider, verdict


def held_block():
    scene = slider(lambda t: gm.where((t >= 8) & (t < 9), 5.0, 0.0))
    scene.joint_friction("x", 2.0)
    return scene, 20.0, [1.5 + 3.0 * 3.0 / (2 * 2.0), 0.0]  # 3 m/s² for a second, then 2 m/s² against 3 m/s


def lifted_block():
    scene = gauss.Scene("lifted", gravity=(0, 0, -10.0))
    scene.body("b", 1.0)
    scene.prismatic("x", "ground", "b", axis=(0, 0, 1))
    scene.stop("x", lowest=0.0)
    scene.drive("x", force=lambda t: 20.0 if 8 <= t < 9 else 0.0)
    return scene, 9.5, [5.0 + 10.0 * 0.5 - 5.0 * 0.25, 5.0]


def pushed_off_wall():
    scene = slider(lambda t: -1.0 if t < 3 else (4.0 if 5 < t < 5.5 else 0.0))
    scene.stop("x", lowest=0.0)
    return scene, 7.0, [0.5 + 2.0 * 1.5, 2.0]


def braked_for_a_moment():
    scene = slider(lambda t: 0.0 * t, rate=1.0)
    scene.joint_friction("x", lambda t: gm.where(t > 5.3, gm.where(t < 5.305, 100.0, 0.0), 0.0))
    return scene, 20.0, [5.3 + 0.005 * 0.75 + 14.695 * 0.5, 0.5]


def stopped_by_a_gate():
    scene = slider(lambda t: 0.0 * t, rate=1.0)
    scene.one_sided("gate", lambda at: gm.where(at.t > 5.99, gm.where(at.t < 6.01, 6.0, 100.0), 100.0) - at.position("b")[0])
    return scene, 20.0, [6.0, 0.0]


def held_where_it_is_narrow():
    scene = slider(lambda t, m: 1e2 if 3 < m.coordinate("x") < 3.01 else 0.0, rate=1.0)
    scene.stop("x", highest=50.0)
    return scene, 5.0, [None, math.sqrt(3.0)]


@pytest.mark.slow
@pytest.mark.parametrize(
    "case", [held_block, lifted_block, pushed_off_wall, braked_for_a_moment, stopped_by_a_gate, held_where_it_is_narrow]
)
def test_motions_in_phases(case):
    scene, duration, expected = case()
    system = gauss.compile_scene(scene)
    kept = [k for k, value in enumerate(expected) if value is not None]
    for _ in range(2):
        found = verdict(lambda: moved(system, duration)[kept], np.array(expected, dtype=float)[kept], relative=1e-7)
        assert found == "right"


def test_a_gate_that_closes_on_a_body_is_refused():
    scene = slider(lambda t: 0.0 * t, rate=1.0)
    scene.one_sided("gate", lambda at: gm.where(at.t > 5, gm.where(at.t < 5.01, 3.0, 100.0), 100.0) - at.position("b")[0])
    with pytest.raises(GaussError, match="gate"):
        gauss.simulate(scene, 20.0, progress=False)


@pytest.mark.slow
def test_ball_thrown_off_a_floor():
    """Contact of a ball: it lies for eight seconds, then is lifted; by events and by time stepping."""
    scene = gauss.Scene("ball", gravity=(0, 0, -10.0))
    scene.body("ball", 1.0, (0.1, 0.1, 0.1))
    scene.free("f", "ground", "ball")
    scene.force("lift", "ball", force=lambda t: (0.0, 0.0, 20.0 * gm.where(t > 2, gm.where(t < 3, 1.0, 0.0), 0.0)))
    scene.half_space("floor", at=(0, 0, -1.0))
    scene.sphere("round", "ball", 1.0)
    scene.contact("lies", "round", "floor")
    assert verdict(lambda: moved(scene, 3.25)[[2, 9]], [5.0 + 2.5 - 0.3125, 7.5], relative=1e-7) == "right"
