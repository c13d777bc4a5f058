"""Redundant, singular and contradictory constraints: freedoms by rank, names, and reactions that are unique or not."""

import warnings

import numpy as np
import pytest

import gauss
from gauss.backends.closure import Factor
from gauss.backends.motions import allowed
from gauss.errors import AssemblyError, NonUniqueReactionWarning, SceneError
from tests.support import mechanisms

ROUNDING = 1e-11  # of products with rows of order 1 to 10 in a state that meets its constraints to 1e-13


def _parallelogram(angle=0.3, bars=2):
    """Equal cranks under one long coupler: with three cranks one row is redundant in the plane, too."""
    scene = gauss.Scene("parallelogram", gravity=(0, -9.81, 0))
    turned = {"rotation": (0, 0, np.pi / 2)}
    for k in range(bars):
        scene.body(f"crank{k}", 1.0, mechanisms.SLENDER, com=(0.5, 0, 0), position=(k, 0, 0), **turned)
        scene.revolute(f"A{k}", "ground", f"crank{k}", at=(k, 0, 0))
    scene.body("coupler", 2.0, mechanisms.SLENDER, com=(1.0, 0, 0), position=(0, 1, 0))
    for k in range(bars):
        scene.revolute(f"B{k}", f"crank{k}", "coupler", at=(k, 1, 0))
    scene.start("A0", position=angle)
    return scene


# (scene, freedoms by counting, by rank, redundant rows)
COUNTS = {
    "tree": (lambda: mechanisms.rods(3), 3, 3, 0),
    "four-bar of spatial hinges": (mechanisms.four_bar, -2, 1, 3),
    "hinge given twice": (lambda: mechanisms.four_bar(twice=True), -7, 1, 8),
    "cardan": (lambda: gauss.load("cardan"), -1, 1, 2),
    "ladder": (lambda: gauss.load("n_four_bar", n=3), -8, 1, 9),
    "three cranks": (lambda: _parallelogram(bars=3), -6, 1, 7),
}


@pytest.mark.slow
@pytest.mark.parametrize("case", COUNTS)
def test_freedoms(case):
    make, counted, freedoms, redundant = COUNTS[case]
    found = gauss.mobility(gauss.compile_scene(make()))
    assert (found.counted, found.freedoms, sum(g.count for g in found.redundant)) == (counted, freedoms, redundant)
    assert found.freedoms - found.counted == redundant
    assert not found.is_singular


@pytest.mark.parametrize("case", COUNTS)
def test_allowed_motions_meet_every_row_and_redundancies_exert_nothing(case):
    system = gauss.compile_scene(COUNTS[case][0]())
    compulsion = gauss.assemble(system, system.initial_state())
    found = allowed(Factor(compulsion))
    assert np.abs(compulsion.A @ found.a + compulsion.B @ found.rates).max() <= ROUNDING
    assert found.a.T @ (compulsion.Phi[:, None] * found.a) == pytest.approx(np.eye(found.a.shape[1]), abs=1e-11)
    for exerted in (compulsion.A.T @ found.redundancies, compulsion.B.T @ found.redundancies):
        assert np.abs(exerted).max(initial=0.0) <= ROUNDING * np.abs(found.redundancies).max(initial=1.0)


@pytest.mark.slow
def test_redundant_constraints_are_named_group_by_group():
    """Two loops that share nothing but the ground are two groups; a free body is in none."""
    scene = mechanisms.four_bar()
    scene.body("door", 5.0, (0.4, 0.4, 0.1), com=(0.5, 0, 0), position=(5, 0, 0))
    scene.revolute("upper hinge", "ground", "door", at=(5, 0, 1))
    scene.revolute("lower hinge", "ground", "door", at=(5, 0, -1))
    scene.body("ball", 1.0, (0.1, 0.1, 0.1))
    scene.free("flight", "ground", "ball")
    system = gauss.compile_scene(scene)
    found = gauss.mobility(system)
    assert [(g.constraints, g.count) for g in found.redundant] == [
        (("A", "B", "C", "D"), 3),
        (("upper hinge", "lower hinge"), 5),
    ]
    assert "flight" not in found.loose
    assert found.loose["A"] == ("moment x", "moment y", "force z")
    assert all(line in system.explain() for line in str(found).splitlines())


def test_a_flat_parallelogram_is_singular():
    flat, folded = (gauss.compile_scene(_parallelogram(angle)) for angle in (-np.pi / 2, 0.3))
    assert gauss.mobility(flat, flat.state([-np.pi / 2, -np.pi / 2, np.pi / 2, np.pi / 2])).freedoms == 2
    found = gauss.mobility(flat, flat.state([-np.pi / 2, -np.pi / 2, np.pi / 2, np.pi / 2]))
    assert found.is_singular and "singular configuration: 1" in str(found)
    assert not gauss.mobility(folded).is_singular


def _door():
    scene = gauss.Scene("door", gravity=(0, 0, -9.81))
    scene.body("door", 20.0, (2.0, 2.0, 0.5), com=(0.5, 0, 0))
    scene.revolute("upper", "ground", "door", at=(0, 0, 1))
    scene.revolute("lower", "ground", "door", at=(0, 0, -1))
    return gauss.simulate(scene, 0.01, times=[0.0, 0.01])


def test_reactions_of_two_hinges_are_open_until_a_compliance_decides():
    """The weight is shared in proportion to stiffness; the moment of the weight is carried by the pair of side forces."""
    trajectory, weight = _door(), 20.0 * 9.81
    with pytest.warns(NonUniqueReactionWarning, match="force z"):
        gauss.reactions(trajectory, "upper")
    bearing = np.array([1.0, 1.0, 0.0, 1e-6, 1e-6, 1e-6])  # soft against moments
    compliance = {"upper": bearing, "lower": bearing * np.array([1, 1, 1, 1, 1, 3.0])}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        upper, lower = (gauss.reactions(trajectory, name, compliance=compliance) for name in ("upper", "lower"))
    assert upper.force[:, 2] == pytest.approx([0.75 * weight] * 2, rel=1e-9)
    assert lower.force[:, 2] == pytest.approx([0.25 * weight] * 2, rel=1e-9)
    # the hinges are 2 m apart: side forces of weight · 0.5 m / 2 m, but for the share of the soft moments
    assert upper.force[0, 0] == pytest.approx(-weight / 4, rel=1e-4)
    assert upper.force[0, 0] == pytest.approx(-lower.force[0, 0], rel=1e-9)


@pytest.mark.slow
def test_a_compliance_that_leaves_something_open_says_so():
    with pytest.warns(NonUniqueReactionWarning, match="moment"):
        gauss.reactions(_door(), "upper", compliance={"upper": [0, 0, 0, 0, 0, 1e-6]})
    for wrong, words in (({"uper": np.ones(6)}, "Did you mean 'upper'"), ({"upper": [1.0]}, "six numbers")):
        with pytest.raises(SceneError, match=words):
            gauss.reactions(_door(), "upper", compliance=wrong)


@pytest.mark.slow
def test_redundant_rows_change_no_motion_and_no_unique_reaction():
    plain, doubled = (
        gauss.simulate(mechanisms.four_bar(twice=twice), 0.1, times=[0.1], rtol=1e-11, atol=1e-12) for twice in (False, True)
    )
    assert doubled.q[0, :4] == pytest.approx(plain.q[0], abs=1e-10)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NonUniqueReactionWarning)
        one, two = (gauss.reactions(trajectory, "B").force[:, :2] for trajectory in (plain, doubled))
    assert two == pytest.approx(one, rel=1e-8)


def test_rows_that_contradict_each_other_are_an_error_with_the_name():
    """Two drives that agree at the start only: the position is the same, the accelerations are not."""
    scene = mechanisms.rods(1)
    scene.drive("J1", angle=lambda t: 0.0 * t, name="hold")
    scene.drive("J1", angle=lambda t: t**2, name="push")
    system = gauss.compile_scene(scene)
    solution = gauss.solve(gauss.assemble(system, system.initial_state()))
    assert not solution.status.certified and ("hold" in str(solution.status) or "push" in str(solution.status))
    with pytest.raises(gauss.GaussError, match="'(hold|push)'"):
        gauss.simulate(scene, 1.0)


@pytest.mark.slow
def test_explain_says_what_cannot_be_assembled():
    scene = mechanisms.rods(2)
    scene.distance("far", "rod2", "ground", at=(1, 0, 0), length=3.0)
    system = gauss.compile_scene(scene)
    with pytest.raises(AssemblyError, match="'far'") as caught:
        system.initial_state()
    assert str(caught.value) in system.explain()
