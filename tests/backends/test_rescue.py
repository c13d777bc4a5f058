"""No answer is worse than its certificate says; where the first method fails another steps in, and says so."""

from dataclasses import replace

import numpy as np
import pytest

import gauss
from gauss.backends import BACKENDS, certify, make
from gauss.backends.solution import Answer
from gauss.bench.problems import make_problem
from gauss.bench.reference import reference
from gauss.errors import BackendError
from tests.support import mechanisms

ROUNDING = 1e-14
EQUALITIES = ("panda", "heavy tip 1e9", "alternating 1e6", "ladder 3 near flat", "bricard", "noisy copies", "mm and g")
INEQUALITIES = ("three stops", "box on 8 points", "box about to tilt")


@pytest.mark.slow
@pytest.mark.parametrize("name", EQUALITIES)
def test_no_certified_answer_is_worse_than_its_certificate_says(name):
    compulsion = make_problem(name).compulsion
    right = reference(compulsion)
    for backend in BACKENDS:
        solution = gauss.solve(compulsion, backend)
        if solution.status.certified:
            assert right.error(compulsion, solution.answer) <= solution.certificate.error + ROUNDING, backend


@pytest.mark.parametrize("distance", [1e-1, 1e-3, 1e-5, 1e-7, 1e-9, 1e-11])
def test_accuracy_near_a_singular_configuration(distance):
    """Ladder of one window near flat: the error of q̈ is at most a few √rounding, however near; none is exact there."""
    system = gauss.compile_scene(gauss.load("n_four_bar", n=1))
    signs = np.array([-1.0 if name.startswith("B") else 1.0 for name in system.coordinates])
    state = system.state(-(np.pi / 2 - distance) * signs, -2.0 * signs)
    solution = gauss.solve(gauss.assemble(system, state))
    assert solution.status.certified  # of the reactions see test_duals
    # one freedom: kinetic energy ½ (1/3 + 1/3 + 1) q̇², potential 2 g cos q for rods of 1 kg and 1 m
    expected = 2.0 * 9.81 * np.sin(state.q[0]) / (5 / 3) * signs
    assert np.abs(solution.qdd - expected).max() <= 1e-7 * np.abs(expected).max()


def rocker_without_mass():
    scene = gauss.load("four_bar")
    scene.bodies["rocker"] = replace(scene.bodies["rocker"], mass=0.0, inertia=(0.0, 0.0, 0.0))
    return scene


@pytest.mark.slow
def test_a_link_without_inertia_is_rescued_and_says_so():
    """The tree cannot move it, the loop can; a link of a microgram moves nearly the same."""
    system = gauss.compile_scene(rocker_without_mass())
    compulsion = gauss.assemble(system, system.initial_state())
    refused = gauss.solve(compulsion, "recursion")
    assert not refused.status.certified and "'C'" in str(refused.status)
    solution = gauss.solve(compulsion)
    assert str(solution.status) == "solved" and solution.backend == "svd"
    assert "recursion: joint 'C'" in solution.status.rescued
    light = rocker_without_mass()
    light.bodies["rocker"] = replace(light.bodies["rocker"], mass=1e-9, inertia=(0.0, 1e-10, 1e-10))
    near = gauss.compile_scene(light)
    assert solution.qdd == pytest.approx(near.accelerations(near.initial_state()), rel=1e-8)
    trajectory = gauss.simulate(system, 0.01, times=[0.01])
    assert trajectory.stats.rescued == 0  # steps cut the loop so that the tree does not end there
    assert abs(gauss.energy(trajectory).balance).max() <= 1e-8


def test_what_nothing_determines_is_named():
    scene = gauss.Scene("two pins in one line, a ring without mass between them")
    scene.body("ring", mass=0.0)
    scene.body("rod", 1.0, mechanisms.SLENDER, com=(0.5, 0, 0))
    scene.revolute("inner", "ground", "ring")
    scene.revolute("outer", "ring", "rod")
    system = gauss.compile_scene(scene)
    solution = gauss.solve(gauss.assemble(system, system.state([0.0, 0.0])))
    assert not solution.status.certified and "svd" in str(solution.status)
    with pytest.raises(BackendError, match="determine the acceleration of '(ring|rod|inner|outer)'"):
        make("svd")(solution.compulsion)


@pytest.mark.parametrize("name", INEQUALITIES)
def test_answers_with_inequalities_are_refined_to_rounding(name):
    compulsion = make_problem(name).compulsion
    right, solution = reference(compulsion), gauss.solve(compulsion)
    assert str(solution.status) == "solved" and not solution.status.rescued
    assert right.error(compulsion, solution.answer) <= solution.certificate.error
    assert solution.certificate.complementarity <= 1e-12
    assert right.error(compulsion, solution.answer) <= 1e-12


def test_rows_that_contradict_each_other_are_not_hidden_by_large_multipliers():
    """Redundant rows leave their multipliers open; as large as one likes, they excuse nothing."""
    scene = mechanisms.rods(1)
    scene.drive("J1", angle=lambda t: 0.0 * t, name="hold")
    scene.drive("J1", angle=lambda t: t**2, name="push")
    system = gauss.compile_scene(scene)
    compulsion = gauss.assemble(system, system.state([1e-6]))
    fair = gauss.solve(compulsion, "nullspace").answer
    multipliers = fair.multipliers + 1e12 * np.array([0, 0, 0, 0, 0, 0, 1.0, -1.0])
    pumped = Answer(fair.a, fair.qdd, multipliers, fair.inequality_multipliers)
    one, other = certify(compulsion, fair), certify(compulsion, pumped)
    assert one.row_residual > 1e-2 and other.row_residual == pytest.approx(one.row_residual, rel=1e-3)
    assert "contradict each other" in str(gauss.solve(compulsion).status)
