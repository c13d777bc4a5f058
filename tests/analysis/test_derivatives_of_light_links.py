"""Loops of bodies that differ in mass by many orders: what is given of their derivatives is right, and the rest refused.

Against the equations of motion of the tree and its loops, solved and differentiated in 50 digits; against the limit of a
body without mass; and no refusal of loops as they are shipped.
"""

from dataclasses import replace

import numpy as np
import pytest

import gauss
from gauss.analysis.crosscheck import random_states
from gauss.analysis.tangents import Tangents
from gauss.dynamics.constraint_leak import LARGEST_LEAK, constraint_leak, may_leak
from gauss.dynamics.mechanism import Mechanism
from gauss.errors import GaussError
from tests.dynamics.test_rigid_loops import _dyad as dyad
from tests.support.many_digits import ConstrainedAccelerations, InManyDigits, along

pytestmark = pytest.mark.slow

DIGITS = 1e-7  # relative to the largest entry: redundant rows leave eight digits, a leak of 1e-11 eight or more
FEWEST_DIGITS = 1e-5  # where nothing has more digits than elimination
ROUND_OFF = 1e-13  # of leaks of shipped loops
LOOPS = {
    "four-bar, coupler": (lambda: gauss.load("four_bar"), ["coupler"]),
    "slider-crank, rod": (lambda: gauss.load("slider_crank"), ["rod"]),
    "parallelogram, crank": (lambda: gauss.load("parallelogram"), ["crank2"]),
    "Bricard, a rod": (lambda: gauss.load("bricard"), ["rod3"]),
    "Bricard, four rods": (lambda: gauss.load("bricard"), ["rod1", "rod2", "rod3", "rod4"]),
    "Cardan, drive shaft": (lambda: gauss.load("cardan"), ["drive shaft"]),
    "Cardan, driven shaft": (lambda: gauss.load("cardan"), ["driven shaft"]),
    "rigid loop": (dyad, ["one"]),
    "base of a rigid loop": (dyad, ["base"]),
    "ladder, couplers": (lambda: gauss.load("n_four_bar", n=2), ["coupler1", "coupler2"]),
}
SHARES = (1e-3, 1e-5, 1e-6, 1e-8, 1e-10, 1e-12, 1e9)


def with_share(make, bodies, share: float) -> gauss.System:
    """System without loads, of whose bodies some have a share of their mass and inertia."""
    scene = make()
    scene.loads.clear()
    for name in bodies:
        one = scene.bodies[name]
        scene.bodies[name] = replace(one, mass=share * one.mass, inertia=tuple(share * np.ravel(one.inertia)))
    return gauss.compile_scene(scene)


def moving_state(system, seed: int = 5):
    """State on the constraints with random rates."""
    start = system.initial_state()
    return system.initial_state(start.q, start.v + np.random.default_rng(seed).standard_normal(system.n_v))


@pytest.mark.parametrize("share", SHARES)
@pytest.mark.parametrize("name", LOOPS)
def test_changes_along_the_constraints_and_by_forces(name, share):
    system = with_share(*LOOPS[name], share)
    state, rng = moving_state(system), np.random.default_rng(6)
    exact, tangents, still = ConstrainedAccelerations(system, state), Tangents(system, state), np.zeros(system.n_v)
    load = still.copy()
    load[exact.tree] = rng.standard_normal(len(exact.tree))
    y, w = (rng.standard_normal(part.shape[1]) for part in (tangents.position, tangents.rate))
    push = still.copy()
    push[exact.tree] = rng.standard_normal(len(exact.tree))
    displaced = tangents.position @ y, tangents.rate @ w + tangents.change @ y, still
    found = gauss.derivatives(system, state, load)
    single = system.acceleration_derivatives(state.q, state.v, load)
    rows = system.acceleration_derivatives(*(np.tile(part, (3, 1)) for part in (state.q, state.v, load)))
    for changes in (displaced, (still, still, push)):
        expected = along(exact, state, load, changes)
        size = max(np.abs(expected).max(), np.abs(changes[0]).max())
        for three in ((found.q, found.v, found.load), single, [part[1] for part in rows]):
            mine = sum(part @ change for part, change in zip(three, changes, strict=True))
            assert np.abs(mine[exact.tree] - expected).max() <= DIGITS * size


@pytest.mark.parametrize("parameter", ["mass:crank", "com:rocker", "gravity", "parent_at:B"])
def test_derivatives_by_parameters_tend_to_those_of_a_massless_body(parameter):
    """Each ten-thousandth of the mass brings them that much nearer."""
    found, state = [], moving_state(gauss.compile_scene(gauss.load("four_bar")))
    for share in (1e-4, 1e-8, 1e-12):
        system = with_share(lambda: gauss.load("four_bar"), ["coupler"], share)
        found.append(system.parameter_derivatives(parameter)(state.q, state.v, np.zeros(system.n_v)))
    far, near, limit = found
    size = np.abs(limit).max()
    assert np.abs(near - limit).max() <= max(1e-3 * np.abs(far - limit).max(), 1e-12 * size)
    assert np.abs(far - limit).max() <= 1e-2 * size


@pytest.mark.parametrize("share", [1e-5, 1e-7, 1e-9, 1e-12])
def test_what_is_traced_is_right_or_not_a_number(share):
    system = with_share(lambda: gauss.load("four_bar"), ["coupler"], share)
    state, load = moving_state(system), np.zeros(system.n_v)
    right = {
        "forward_dynamics": [system.forward_dynamics(state.q, state.v, load)],
        "acceleration_derivatives": system.acceleration_derivatives(state.q, state.v, load),
    }
    for name, parts in right.items():
        exported = [part.astype(float) for part in InManyDigits(system, name)(state.q, state.v, load)]
        for one, two in zip(exported, parts, strict=True):
            if name == "acceleration_derivatives" and np.isnan(exported[2]).any():
                assert share < 1e-6
            elif name == "forward_dynamics" or one is exported[2]:  # others differ off the constraints
                assert np.abs(one - two).max() <= FEWEST_DIGITS * np.abs(two).max()


@pytest.mark.parametrize("share", [1e-5, 1e-7, 1e-9, 1e-12])
def test_functions_of_independent_coordinates_are_right_or_refused(share):
    system = with_share(*LOOPS["Bricard, four rods"], share)
    state, free = moving_state(system), [next(iter(system.coordinates))]
    tangents = Tangents(system, state)
    N = tangents.rate / tangents.rate[0]
    expected = N.T @ system.mass_matrix(state.q) @ N
    try:
        found = system.function("mass_matrix", independent=free)(state.q)
    except GaussError as refusal:
        assert share < 1e-6 and "few digits" in str(refusal)
    else:
        assert np.abs(found - expected).max() <= FEWEST_DIGITS * np.abs(expected).max()


@pytest.mark.parametrize("share", [1e-5, 1e-7, 1e-9])
def test_motions_of_sensitivities_are_right_or_refused(share):
    system = with_share(lambda: gauss.load("four_bar"), ["coupler"], share)
    state = moving_state(system)
    right = gauss.simulate(system, 0.05, state=state, rtol=1e-10, progress=False)
    try:
        found = gauss.sensitivities(system, 0.05, step=0.0005, state=state)
    except GaussError as refusal:
        assert share < 1e-6 and "mass" in str(refusal)
    else:
        assert np.abs(found.q[-1] - right.q[-1]).max() <= FEWEST_DIGITS


SHIPPED = ("four_bar", "slider_crank", "parallelogram", "bricard", "cardan", "andrews_squeezer", "planetary_gears")


@pytest.mark.parametrize("name", SHIPPED)
def test_loops_as_they_are_shipped_are_not_checked_and_leave_round_off(name):
    system = gauss.compile_scene(gauss.load(name))
    assert not may_leak(system)
    for state in random_states(system, 4, seed=1):
        leak = constraint_leak(system, Mechanism(system, state.q, state.v, state.t))
        assert leak <= ROUND_OFF < LARGEST_LEAK
        assert np.isfinite(gauss.derivatives(system, state).load).all()
