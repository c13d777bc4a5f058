"""The crosscheck itself: it agrees where it should, and says so when it does not."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import gauss
from gauss.analysis.crosscheck import CrossCheck, Row, comparison, crosscheck, random_states
from gauss.analysis.crosscheck.pinocchio_ import twin
from gauss.dynamics.assemble import position_residual
from gauss.dynamics.kinematics import kinematics
from gauss.scene import PAIRS
from tests.support import mechanisms

CLOSED = 1e-10  # gap of a state that is called consistent


def loaded():
    """Two bodies under every kind of load, one spring to the ground."""
    scene = mechanisms.two_bodies("universal")
    scene.drive("A", torque=lambda t, motion: 0.3 * motion.rate("A"))
    scene.force("wind", "b", force=(1.0, -2.0, 0.5), moment=(0.1, 0.2, -0.3), at=(0.3, 0.1, 0.2), axes="body")
    scene.force("push", "a", force=lambda t, motion: 3.0 * motion.velocity("a"))
    scene.spring("s", "a", "b", at=(0.1, 0, 0), other_at=(0, 0.2, 0), stiffness=40.0, damping=2.0, length=0.3)
    scene.spring("to ground", "ground", "b", at=(2.0, 0, 0), stiffness=10.0)
    scene.body("c", 0.7, (0.1, 0.1, 0.1), com=(0.1, 0.2, 0.3), position=(1, 1, 1))
    scene.revolute("C", "c", "b", at=(1, 1, 1), axis=(1, 1, 0))  # the tree passes it from child to parent
    scene.joint_spring("torsion", "C", stiffness=5.0, damping=0.4, rest=0.2)
    scene.body("d", 0.4, (0.1, 0.1, 0.1), com=(0.1, 0.2, 0.3), position=(1, 1, 1))
    scene.fixed("weld", "c", "d")
    scene.force("behind the weld", "d", force=(1, 2, 3), moment=(3, 2, 1))
    return scene


def geared():
    """Two wheels on a carrier, tied by a gear, and the second tied to a slider."""
    scene = gauss.Scene("gears")
    for name, parent in (("carrier", "ground"), ("wheel", "carrier"), ("pinion", "carrier")):
        scene.body(name, 2.0, (0.2, 0.3, 0.4), com=(0.1, 0.2, 0.3), on=parent, position=(0.5, 0, 0))
        scene.revolute(name, parent, name, frame=name, axis=(0.1, 0.2, 1.0))
    scene.body("rack", 1.0, (0.1, 0.1, 0.1))
    scene.prismatic("rack", "ground", "rack", axis=(1, 2, 0))
    scene.couple("mesh", "pinion", "wheel", ratio=-3.0, offset=0.2)
    scene.couple("feed", "rack", "pinion", ratio=0.05)
    return scene


def closed_by(kind: str, parent: str = "d", child: str = "a"):
    """Four bodies on balls and universal joints, closed by a joint of one kind; loads on it, too."""
    rng = np.random.default_rng(4)
    scene, previous = gauss.Scene(f"closed by {kind}"), "ground"
    for name, joint in zip("abcd", ("universal", "ball", "ball", "universal"), strict=True):
        pose = {"on": previous, "position": rng.normal(size=3), "rotation": rng.normal(size=3)}
        scene.body(name, rng.uniform(0.5, 2.0), mechanisms.inertia(rng), com=rng.normal(size=3), **pose)
        scene.joint(name.upper(), joint, previous, name, frame=name)
        previous = name
    pitch = {"pitch": 0.3} if kind == "screw" else {}
    pair = scene.joint("closing", kind, parent, child, at=rng.normal(size=3), frame="c", **pitch).pair
    if pair.n_v:
        scene.drive("closing", torque=rng.normal(size=pair.n_v))
    return scene


def elbow(kind: str):
    """The same joint from the ground, which has no Jacobian."""
    return closed_by(kind, "ground", "c")


SCENES = {
    "loads": loaded,
    "gears": geared,
    "four-bar": mechanisms.four_bar,
    "four-bar cut elsewhere": lambda: mechanisms.four_bar("BDAC"),
    "four-bar with a joint twice": lambda: mechanisms.four_bar(twice=True),
    "rods": lambda: mechanisms.rods(5),
    **{f"two {kind}": lambda kind=kind: mechanisms.two_bodies(kind) for kind in PAIRS},
    **{f"closed by {kind}": lambda kind=kind: closed_by(kind) for kind in PAIRS},
    **{f"closed by {kind}, swapped": lambda kind=kind: closed_by(kind, "a", "d") for kind in PAIRS},
    **{f"closed by {kind} at the ground": lambda kind=kind: elbow(kind) for kind in PAIRS},
}


@pytest.mark.slow
@pytest.mark.peer
@pytest.mark.parametrize("name", SCENES)
def test_agreement(name):
    outcome = crosscheck(SCENES[name](), states=5, seed=3)
    assert outcome.passed, f"\n{outcome}"


@pytest.mark.slow
@pytest.mark.peer
@pytest.mark.parametrize(
    "change",
    [
        {"Phi": lambda system: system.Phi * np.where(np.arange(system.Phi.size) == 0, 1 + 1e-8, 1)},
        {"joints": lambda system: (replace(system.joints[0], p_child=system.joints[0].p_child + 1e-8), *system.joints[1:])},
    ],
    ids=["inertia", "frame"],
)
@pytest.mark.parametrize("scene", [mechanisms.four_bar, lambda: mechanisms.two_bodies("revolute", 1)], ids=["loop", "tree"])
def test_a_small_difference_is_found(monkeypatch, change, scene):
    """A crosscheck that cannot fail is none: Pinocchio gets a system that is wrong in the eighth digit."""
    system = gauss.compile_scene(scene())
    other = replace(system, **{key: value(system) for key, value in change.items()})
    if "Phi" in change:
        other.Phi[2] *= 1 + 1e-8  # the moment about the axis of a planar link
    monkeypatch.setattr(comparison, "twin", lambda _: twin(other))
    outcome = crosscheck(system, states=3)
    assert not outcome.passed
    assert "DISAGREEMENT" in str(outcome)


@pytest.mark.peer
def test_a_backend_that_fails_is_reported():
    """The rows of a planar four-bar are redundant; the plain KKT matrix is singular."""
    outcome = crosscheck(mechanisms.four_bar(), states=2, backend="kkt")
    assert not outcome.passed
    assert outcome.table[0].difference == np.inf
    assert any("singular" in note for note in outcome.notes)


def test_pairs_without_counterpart_are_named():
    system = gauss.compile_scene(mechanisms.two_bodies("revolute"))
    strange = replace(system.joints[1], pair=replace(system.joints[1].pair, kind="rubber"))
    with pytest.raises(gauss.GaussError, match="joint 'B'.*rubber.*Known: ball, cylindrical"):
        crosscheck(replace(system, joints=(system.joints[0], strange)))


@pytest.mark.peer
def test_relations_without_counterpart_are_named():
    system = gauss.compile_scene(geared())
    constraints = (*system.structure.constraints[:-1], replace(system.structure.constraints[-1], name="cam"))
    model = twin(replace(system, structure=replace(system.structure, constraints=constraints)))
    peer = comparison.Comparison(system)
    peer.twin = model
    with pytest.raises(gauss.GaussError, match="'cam'.*joints and couplings"):
        peer.take(system.initial_state(), np.zeros(system.n_v))


def test_a_tree_that_moves_no_inertia_is_refused():
    scene = gauss.Scene("point")
    scene.body("point", 1.0)
    scene.ball("A", "ground", "point")
    with pytest.raises(gauss.GaussError, match="'point'.*moves no inertia"):
        crosscheck(scene)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["loads", "gears", "closed by screw"])
def test_random_states_are_consistent_and_repeatable(name):
    system = gauss.compile_scene(SCENES[name]())
    first, again, other = (list(random_states(system, 3, seed)) for seed in (1, 1, 2))
    for a, b in zip(first, again, strict=True):
        assert np.array_equal(a.q, b.q) and np.array_equal(a.v, b.v)
        assert np.abs(position_residual(kinematics(system, a))).max() <= CLOSED
    assert not np.array_equal(first[0].q, other[0].q)
    assert not np.array_equal(first[0].q, first[1].q)


def test_text():
    rows = Row("accelerations", 1.23e-15, 1e-10), Row("power", 2.0, 1e-10)
    outcome = CrossCheck("arm", "Pinocchio 9", "4 random states (seed 7)", "kkt", rows, ("all well",))
    assert not outcome.passed
    assert str(outcome).splitlines() == [
        "scene 'arm', backend 'kkt' against Pinocchio 9: DISAGREEMENT in 4 random states (seed 7)",
        "  quantity       largest relative difference  tolerance",
        "  accelerations                      1.2e-15      1e-10  ok",
        "  power                              2.0e+00      1e-10  FAILED",
        "  note: all well",
    ]
    assert CrossCheck("arm", "Pinocchio 9", "4 random states (seed 7)", "kkt", rows[:1]).passed


@pytest.mark.slow
def test_pinocchio_is_imported_only_when_asked_for():
    code = "import sys, gauss.analysis.crosscheck; sys.exit('pinocchio' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], cwd=Path(__file__).parents[2]).returncode == 0
