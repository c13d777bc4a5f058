"""Terms of the equations of motion: inverse dynamics undoes forward dynamics, closing rows are those of the motion."""

import numpy as np
import pytest

import gauss
from gauss.errors import SimulationError, StateError
from tests.support import mechanisms

ROUNDING = 1e-11  # relative to the largest force or acceleration
TREES = {
    "panda": lambda: gauss.load("robot:panda", mimic=False),
    "tree of all kinds": lambda: gauss.load("random_tree", n=6, seed=0),
    "damped": lambda: gauss.load("cart_pole"),
}
LOOPS = {
    "four-bar": lambda: gauss.load("four_bar"),
    "bricard": lambda: gauss.load("bricard"),
    "coupled": lambda: gauss.load("gear_pair"),
    "rolling disk": lambda: gauss.load("rolling_disk"),
}
STEP = 1e-6  # of central differences, whose error is its square


@pytest.mark.slow
@pytest.mark.parametrize("name", TREES)
def test_inverse_dynamics_undoes_forward_dynamics(name):
    system = gauss.compile_scene(TREES[name]())
    for state, load in zip(*mechanisms.consistent_states(system), strict=True):
        found = system.inverse_dynamics(state.q, state.v, system.accelerations(state, load), t=state.t)
        assert np.abs(found - load).max() <= ROUNDING * max(np.abs(load).max(), np.abs(found).max())


@pytest.mark.slow
@pytest.mark.parametrize("name", LOOPS)
def test_what_inverse_dynamics_adds_in_loops_are_forces_of_the_rows(name):
    system = gauss.compile_scene(LOOPS[name]())
    for state, load in zip(*mechanisms.consistent_states(system), strict=True):
        for closing in system.structure.closures:
            if closing < len(system.joints):  # a force there is no force along a coordinate of the tree
                load[system.joints[closing].v] = 0.0
        acceleration = system.accelerations(state, load)
        found = system.inverse_dynamics(state.q, state.v, acceleration, t=state.t)
        _, J, _ = system.loop_constraints(state.q, state.v, t=state.t)
        multipliers = np.linalg.lstsq(J.T, found - load, rcond=1e-10)[0]
        assert np.abs(J.T @ multipliers - (found - load)).max() <= 1e-9 * max(1.0, np.abs(found).max())


@pytest.mark.slow
@pytest.mark.parametrize("name", LOOPS)
def test_closing_rows_hold_along_the_motion(name):
    system = gauss.compile_scene(LOOPS[name]())
    for state, load in zip(*mechanisms.consistent_states(system), strict=True):
        c, J, gamma = system.loop_constraints(state.q, state.v, t=state.t)
        acceleration = system.accelerations(state, load)
        size = np.abs(gamma).max() + np.abs(acceleration).max()
        assert np.abs(c).max() <= 1e-10
        assert np.abs(J @ state.v).max() <= 1e-9 * max(1.0, np.abs(state.v).max())
        assert np.abs(J @ acceleration - gamma).max() <= 1e-9 * size


def test_the_jacobian_is_the_derivative_of_the_residual():
    system = gauss.compile_scene(gauss.load("four_bar"))
    rows, start = system.loop_constraints, system.initial_state()
    _, J, _ = rows(start.q, start.v)
    moved = [
        rows(start.q + STEP * unit, start.v)[0] - rows(start.q - STEP * unit, start.v)[0] for unit in np.eye(system.n_v)
    ]
    columns = np.flatnonzero(J.any(axis=0))
    assert np.array(moved).T[:, columns] / (2 * STEP) == pytest.approx(J[:, columns], abs=1e-8)


def test_an_open_system_has_no_closing_rows():
    c, J, gamma = gauss.compile_scene(mechanisms.rods(2)).loop_constraints([0.1, 0.2], [0.0, 0.0])
    assert c.shape == gamma.shape == (0,) and J.shape == (0, 2)


def test_wrong_input_is_refused():
    system = gauss.compile_scene(mechanisms.rods(2))
    f = system.inverse_dynamics
    with pytest.raises(StateError, match="acceleration: expected 2 numbers"):
        f([0.0, 0.0], [0.0, 0.0], [0.0])
    with pytest.raises(StateError, match="q: expected 2 finite numbers"):
        f([np.nan, 0.0], [0.0, 0.0], [0.0, 0.0])
    with pytest.raises(StateError, match="inverse_dynamics"):
        f([0.0, 0.0], [0.0, 0.0], [np.inf, 0.0])
    with pytest.raises(StateError, match="length 2, not 1"):
        free = gauss.compile_scene(gauss.load("free_body"))
        free.inverse_dynamics([0, 0, 0, 2, 0, 0, 0], np.zeros(6), np.zeros(6))
    scene = mechanisms.rods(1)
    scene.drive("J1", torque=lambda t: 1.0 if float(t) < 0.1 else 0.0)
    with pytest.raises(SimulationError, match="'drive of J1'"):
        _ = gauss.compile_scene(scene).inverse_dynamics
