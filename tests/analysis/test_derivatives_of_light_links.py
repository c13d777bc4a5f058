"""Derivatives of loops with nearly massless links: right, or refused; against the reduced mass matrix."""

from dataclasses import replace

import numpy as np
import pytest

import gauss
from gauss.errors import SimulationError
from gauss.system import random_state

DIGITS = 1e-4  # relative error up to which derivatives are given: constraints are left by a hundredth of it


def four_bar(share: float) -> gauss.System:
    """Four-bar whose coupler has a share of its mass."""
    scene = gauss.load("four_bar")
    coupler = scene.bodies["coupler"]
    scene.bodies["coupler"] = replace(coupler, mass=share * coupler.mass, inertia=tuple(share * np.array(coupler.inertia)))
    return gauss.compile_scene(scene)


@pytest.mark.slow
@pytest.mark.parametrize("share", [1.0, 1e-3, 1e-6, 1e-8, 1e-10, 1e-13])
def test_derivatives_by_forces_are_right_or_refused(share):
    system, refused = four_bar(share), 0
    for seed in range(3):
        state = random_state(system, np.random.default_rng(seed))
        tree = slice(0, 3)  # the fourth joint closes the loop
        K = system.loop_constraints(state.q, state.v)[1][:, tree]
        N = np.linalg.svd(K)[2][np.linalg.matrix_rank(K) :].T
        expected = N @ np.linalg.solve(N.T @ system.mass_matrix(state.q)[tree, tree] @ N, N.T)
        found = system.acceleration_derivatives(state.q, state.v, np.zeros(system.n_v))
        try:
            by_load = gauss.derivatives(system, state).load
        except SimulationError:
            refused += 1
        else:
            assert np.abs(by_load[tree, tree] - expected).max() < DIGITS * np.abs(expected).max()
        known = not np.isnan(found[2]).any()
        assert known or all(np.isnan(part).any() for part in found)  # entries that are zero in every state stay so
        assert not known or np.abs(found[2][tree, tree] - expected).max() < DIGITS * np.abs(expected).max()
    assert refused == (3 if share < 1e-9 else 0) or share == 1e-8
