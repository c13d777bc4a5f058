"""Large ladders: certified accelerations, and work in proportion to the number of windows."""

import numpy as np
import pytest

import gauss
from gauss.dynamics.conditions import obstacles
from gauss.dynamics.engines.certified import CertifiedEngine
from gauss.dynamics.plan import motion_plan
from tests.support import mechanisms

pytestmark = pytest.mark.slow


def test_a_large_ladder_has_the_certified_accelerations():
    system = mechanisms.ladder(60)
    state, load = system.initial_state(), np.random.default_rng(0).standard_normal(system.n_v)
    expected = CertifiedEngine().rates(system, state, load).acceleration
    assert not obstacles(system)
    assert np.abs(system.accelerations(state, load) - expected).max() <= 1e-11 * np.abs(expected).max()


def test_work_grows_with_the_number_of_windows():
    estimated = [sum(part.loop_elimination_work for part in mechanisms.ladder(n).parts) for n in (20, 40, 80)]
    written = [system.dynamics.operations(system, system.subsystems) for system in map(mechanisms.ladder, (3, 6, 12))]
    for small, middle, large in (estimated, written):
        assert large - middle == pytest.approx(2 * (middle - small), rel=0.05)


def test_loops_that_share_one_long_branch_are_not_written_down():
    scene, previous = gauss.Scene("mast"), "ground"
    for i in range(90):
        body = scene.body(f"b{i}", mass=1.0, inertia=(0.1, 0.1, 0.1), com=(0.1, 0.2, 0.3), on=previous, position=(0, 0, 1))
        scene.ball(f"J{i}", previous, body, at=(0, 0, i))
        previous = body.name
        if i:
            scene.distance(f"stay{i}", f"b{i - 1}", body)
    assert motion_plan(gauss.compile_scene(scene)).dynamics == "certified"
