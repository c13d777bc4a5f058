"""Loops in planes of their own are closed by two rows; links without inertia are never left at the end of the tree."""

import numpy as np
import pytest

import gauss
from gauss.system import random_state

ALIKE = 1e-9  # relative: machine code of the reduced system and the certified solution of the whole one


def rows(system) -> int:
    """Rows of all loops that are integrated."""
    return sum(one.n_loop_constraints for one in system.subsystems)


def assert_exact(scene, freedoms):
    """Reduced and whole system accelerate alike, and Pinocchio agrees."""
    system = gauss.compile_scene(scene)
    state = system.projected(random_state(system, np.random.default_rng(0), spread=0.05))
    expected = gauss.solve(gauss.assemble(system, state)).qdd
    assert system.accelerations(state) == pytest.approx(expected, rel=ALIKE, abs=ALIKE * np.abs(expected).max())
    assert gauss.mobility(system, state).freedoms == freedoms
    assert gauss.crosscheck(scene, states=5).passed
    return system


@pytest.mark.slow
@pytest.mark.parametrize("root", ["free", "fixed"])
def test_four_bars_in_space_take_two_rows_each(root):
    system = assert_exact(gauss.load("four_bar_branch", n=2, root=root), 2 + 6 * (root == "free"))
    assert rows(system) == 4


def test_a_loop_that_leaves_its_plane_keeps_its_rows():
    scene = gauss.load("four_bar_branch", n=2, root="fixed")
    joint = scene.joints.pop("C2")
    scene.ball("C2", joint.parent, joint.child, at=joint.at, frame=joint.frame)
    assert rows(gauss.compile_scene(scene)) == 2 + 3


@pytest.mark.slow
@pytest.mark.parametrize("options, count", [({}, 2), ({"belt": True}, 1), ({"depth": 3, "rung": 3}, 2)])
def test_parallel_chains(options, count):
    options = {"depth": 5, "rung": 2} | options
    belt = options.get("belt", False)
    system = assert_exact(gauss.load("parallel_chains", **options), 2 * options["depth"] - 1)
    assert rows(system) == count and bool(system.scene.relations) == belt


@pytest.mark.slow
def test_rotors_take_no_rows():
    assert rows(assert_exact(gauss.load("rotor_branch", n=3), 9)) == 0


def test_loops_are_cut_beside_links_without_inertia():
    scene = gauss.load("four_bar_branch", n=2, root="fixed")
    scene.body("pin", 0.0, on="rocker2", position=(0.3, 0, 0))
    scene.joints.pop("C2")
    scene.revolute("C2 outer", "coupler2", "pin", frame="pin", axis=(0, 1, 0))
    scene.revolute("C2 inner", "pin", "rocker2", frame="pin")
    system = gauss.compile_scene(scene)
    for one in system.subsystems:
        ends = {edge.outer for edge in one.tree} - {edge.inner for edge in one.tree}
        assert all(one.Phi[6 * body : 6 * body + 6].any() for body in ends)


def hand(tie) -> gauss.Scene:
    """Hand with a finger, and another without mass that something ties to it."""
    scene = gauss.Scene("hand")
    scene.body("palm", 1.0, (0.1, 0.1, 0.1), com=(0.3, 0, 0))
    scene.revolute("wrist", "ground", "palm")
    for name, mass, at in (("left", 0.2, 0.05), ("right", 0.0, -0.05)):
        scene.body(name, mass, (1e-3 * mass,) * 3, com=(0.1, 0, 0), on="palm", position=(0.5, at, 0))
        scene.revolute(f"{name} joint", "palm", name, frame=name, axis=(0, 1, 0))
    tie(scene)
    return scene


@pytest.mark.slow
@pytest.mark.parametrize(
    "tie",
    [
        lambda scene: scene.couple("mimic", "right joint", "left joint", -1.0),
        lambda scene: scene.linear_coupling("sum", {"right joint": 1.0, "left joint": 1.0, "wrist": -1.0}),
    ],
)
def test_a_link_without_mass_may_follow_others(tie):
    assert_exact(hand(tie), 2)


def test_a_link_without_mass_that_nothing_ties_is_refused():
    with pytest.raises(gauss.errors.SceneError, match="'right' has no mass"):
        gauss.compile_scene(hand(lambda scene: None))


@pytest.mark.parametrize(
    "terms, words",
    [
        ({"wrist": 1.0}, "two or more"),
        ({"wrist": 1.0, "left joint": 0.0}, "must not be 0"),
        ({"wrist": 1.0, "elbow": 1.0}, "no joint 'elbow'"),
        ({"wrist": 1.0, "left joint": np.nan}, "coefficients"),
    ],
)
def test_linear_couplings_are_checked(terms, words):
    with pytest.raises(gauss.errors.SceneError, match=words):
        hand(lambda scene: scene.linear_coupling("sum", terms))
