"""Any joint may close a loop: maximal coordinates against tree coordinates, and loops cut at any place."""

import numpy as np
import pytest

import gauss
from gauss.errors import SceneError
from gauss.scene import PAIRS
from tests.support import mechanisms

ROUNDING = 1e-11  # relative, of two routes to the same instant
WEIGHT = 10.0  # N, m/s²: gravity and weight are of this size where nothing accelerates, or nothing is held
MOTION = 1e-9  # of motions at rtol 1e-11


def _started(kind, seed=0):
    """Two bodies on two joints of a kind, turned and moving."""
    scene, rng = mechanisms.two_bodies(kind, seed), np.random.default_rng(seed)
    for name, joint in scene.joints.items():
        pair = joint.pair
        if pair.n_v:
            plain = pair.n_q if pair.quaternion is None else pair.quaternion
            position = np.array(pair.reference)
            position[:plain] += 0.4 * rng.standard_normal(plain)
            rates = rng.standard_normal(pair.n_v)
            scene.start(name, *(tuple(x) if len(x) > 1 else float(x[0]) for x in (position, rates)))
    return scene


@pytest.mark.slow
@pytest.mark.parametrize("kind", PAIRS)
def test_every_kind_of_joint_closes_a_loop(kind):
    """Accelerations and reactions of joints that are constraints are those of joints of the tree."""
    scene = _started(kind)
    tree, maximal = (gauss.compile_scene(scene, coordinates) for coordinates in ("tree", "maximal"))
    assert not tree.has_closures and len(maximal.structure.closures) == 2
    solutions = [gauss.solve(gauss.assemble(system, system.initial_state())) for system in (tree, maximal)]
    assert all(str(solution.status) == "solved" for solution in solutions)
    one, two = solutions
    assert np.abs(one.a - two.a).max() <= ROUNDING * max(np.abs(one.a).max(), WEIGHT)
    for name in scene.joints:
        rows = [next(c.rows for c in s.compulsion.structure.constraints if c.name == name) for s in solutions]
        first, second = (s.multipliers[r] for s, r in zip(solutions, rows, strict=True))
        assert np.abs(first - second).max() <= ROUNDING * max(np.abs(one.multipliers).max(), WEIGHT)
        assert maximal.accelerations(maximal.initial_state())[maximal.joint(name).v] == pytest.approx(
            one.qdd[tree.joint(name).v], rel=1e-9, abs=1e-9
        )


SCENES = {
    "four-bar": mechanisms.four_bar,
    "cardan": lambda: gauss.load("cardan"),
    "screw jack": lambda: gauss.load("screw_jack"),
}


@pytest.mark.slow
@pytest.mark.parametrize("scene", SCENES)
def test_maximal_coordinates_move_the_same(scene):
    scene = SCENES[scene]()
    tree, maximal = (
        gauss.simulate(gauss.compile_scene(scene, c), 0.03, times=[0.03], rtol=1e-11, atol=1e-12)
        for c in ("tree", "maximal")
    )
    for joint in scene.joints:
        assert maximal.coordinate(joint) == pytest.approx(tree.coordinate(joint), abs=MOTION)
    energy = gauss.energy(maximal)
    assert np.abs(energy.balance).max() <= MOTION * max(energy.scale, 1.0)


def test_bodies_need_inertia_to_float():
    with pytest.raises(SceneError, match="'crank', 'rod' have no inertia.*maximal"):
        gauss.compile_scene(gauss.load("slider_crank"), "maximal")


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["ball", "universal", "screw", "fixed"])
def test_a_loop_cut_at_any_joint_accelerates_the_same(kind):
    """A spatial loop of six joints, closed by a joint of each kind, or cut elsewhere."""

    def loop(first):
        rng, scene = np.random.default_rng(3), gauss.Scene("loop")
        names = [f"body{i}" for i in range(5)]
        for name in names:
            scene.body(
                name, rng.uniform(0.5, 2.0), mechanisms.inertia(rng), com=rng.normal(size=3), position=rng.normal(size=3)
            )
        kinds = ["revolute", "cylindrical", "ball", kind, "revolute", "universal"]
        ends = ["ground", *names, "ground"]
        joints = []
        for i, this in enumerate(kinds):
            options = {"pitch": 0.2} if this == "screw" else {}
            if this not in ("ball", "fixed"):
                options["axis"] = rng.normal(size=3)
            joints.append((f"J{i}", this, ends[i], ends[i + 1], {"at": rng.normal(size=3), **options}))
        for name, this, parent, child, options in joints[first:] + joints[:first]:
            scene.joint(name, this, parent, child, **options)
        return scene

    accelerations = []
    for first in (0, 5):
        system = gauss.compile_scene(loop(first))
        assert [system.joints[i].name for i in system.structure.closures] == ["J5" if first == 0 else "J4"]
        a = system.accelerations(system.initial_state())
        accelerations.append(np.concatenate([a[system.joint(f"J{i}").v] for i in range(6)]))
    one, two = accelerations
    assert np.abs(one - two).max() <= 1e-10 * np.abs(one).max()
