"""Many loops are certified by a sparse factorisation that is as exact as the dense one, or says that it is not."""

import numpy as np
import pytest

import gauss
from gauss.backends.certificate import TOLERANCE, certify
from gauss.backends.closure import Factor
from gauss.backends.factorisation import SPARSE_FROM_ROWS, factors
from gauss.backends.recursion import Recursion
from gauss.backends.sparse_factor import SparseFactor
from gauss.bench.problems import make_problem
from gauss.bench.reference import reference
from gauss.dynamics.kinematics import kinematics
from gauss.dynamics.projection import velocity_residual_of

ROUNDING = 1e-13
GENTLE = ("panda", "four-bar", "ladder 10", "stewart", "bricard")
PLAIN = (*GENTLE, "heavy tip 1e9", "mm and g", "stiff Baumgarte", "noisy copies")
WINDOWS = 30  # of a ladder: more than SPARSE_FROM_ROWS rows close its loops


@pytest.mark.slow
@pytest.mark.parametrize("name", [*PLAIN, "ladder 3 near flat"])
def test_answers_are_exact_or_refused(name):
    compulsion = make_problem(name).compulsion
    factor = SparseFactor(compulsion)
    answer, correction = Recursion().solve_with(factor)
    certificate = certify(compulsion, answer, factor, correction)
    if name in PLAIN:
        assert reference(compulsion).error(compulsion, answer) <= certificate.error + ROUNDING
        assert certificate.error <= TOLERANCE
    else:  # only the singular values of a dense matrix distinguish near-dependent rows from redundant ones
        assert certificate.error > TOLERANCE


@pytest.mark.slow
@pytest.mark.parametrize("name", PLAIN)
def test_open_reactions_are_those_that_the_dense_factorisation_finds(name):
    compulsion = make_problem(name).compulsion
    dense, thin = Factor(compulsion), SparseFactor(compulsion)
    answer = Recursion().solve_with(dense)[0]
    np.testing.assert_array_equal(
        certify(compulsion, answer, thin).undetermined, certify(compulsion, answer, dense).undetermined
    )
    free = thin.free_multipliers()
    size = np.abs(compulsion.A.T).max() * np.abs(free).max(initial=0.0)
    assert np.abs(compulsion.A.T @ free).max(initial=0.0) <= 1e-7 * size  # they move nothing; noisy copies are 1e-8 off


def _ladder():
    system = gauss.compile_scene(gauss.load("n_four_bar", n=WINDOWS))
    return system, system.initial_state()


@pytest.mark.slow
def test_a_long_ladder_is_certified_by_it():
    system, state = _ladder()
    load = np.random.default_rng(0).normal(size=system.n_v)
    compulsion = gauss.assemble(system, state, load)
    assert 6 * WINDOWS > SPARSE_FROM_ROWS and factors(compulsion) == (SparseFactor, Factor)
    solution, dense = gauss.solve(compulsion), Recursion()(compulsion)
    assert str(solution.status) == "solved"
    assert np.abs(solution.qdd - dense.qdd).max() <= 1e-11 * np.abs(dense.qdd).max()


def test_states_of_a_long_ladder_meet_their_constraints():
    system, state = _ladder()
    assert state.v[system.column("A0")] == pytest.approx(-1.0, abs=1e-13)
    assert np.abs(state.v[[system.column(f"A{i}") for i in range(WINDOWS + 1)]] + 1.0).max() <= 1e-12
    assert np.abs(velocity_residual_of(system, kinematics(system, state))).max() <= 1e-12


@pytest.mark.slow
def test_near_dependent_rows_are_left_to_the_dense_factorisation():
    """The flat ladder: the sparse answer is not certified, so the dense one is given."""
    system, _ = _ladder()
    signs = np.array([-1.0 if name.startswith("B") else 1.0 for name in system.coordinates])
    state = system.state(-(np.pi / 2 - 1e-7) * signs, -2.0 * signs)
    compulsion = gauss.assemble(system, state)
    factor = SparseFactor(compulsion)
    answer, correction = Recursion().solve_with(factor)
    assert not certify(compulsion, answer, factor, correction).error <= TOLERANCE
    assert gauss.solve(compulsion).status.certified
