"""What is stepped moves like what was written: every pass, by itself and all together, on every shipped scene and more."""

import numpy as np
import pytest

import gauss
from gauss.dynamics.conditions import obstacles
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.mechanism import forward_dynamics
from gauss.dynamics.traced_system import Program
from gauss.system import passes, random_state
from tests.support import mechanisms
from tests.support.reducible import SCENES, SHIPPED, islands, locked, tilted, welded
from tests.support.reductions import rows, stages

ALIKE = 1e-11  # of accelerations, relative to the largest, and of coordinates after a motion [rad, m]


def _states(system, count: int, seed: int):
    """Consistent random states near the start."""
    rng, start = np.random.default_rng(seed), system.initial_state()
    for _ in range(count):
        guess = random_state(system, rng, spread=0.2, slide=0.05)
        near = system.state(start.q + (guess.q - system.reference.q) if system.is_flat else guess.q, start.v + guess.v)
        yield system.initial_state(near.q, near.v), rng


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_reduced_and_full_accelerations_are_alike(name):
    """Against the certified recursion in maximal coordinates, and against the same recursion on the unreduced system."""
    system = gauss.compile_scene(SCENES[name]())
    assert not obstacles(system)
    kernel = Program(system, Laws(system)).forward()
    for state, rng in _states(system, 3, 1):
        load = rng.standard_normal(system.n_v)
        expected = gauss.solve(gauss.assemble(system, state, load), "recursion").qdd
        found = kernel(np.concatenate([[0.0], state.q, state.v, load]))[: system.n_v]
        assert np.abs(found - expected).max() <= ALIKE * np.abs(expected).max()


@pytest.mark.slow
@pytest.mark.parametrize("name", [*SHIPPED, "welded", "truss"])
def test_reduced_and_full_motions_are_alike(name):
    """Where a loop is cut is felt as much as the method errs: the step is short enough for that to be rounding."""
    scene = SCENES[name]()
    options = {"integrator": "rk4", "step": 2.5e-4, "times": [0.005, 0.01]}
    fast, slow = (gauss.simulate(scene, 0.01, backend=backend, **options) for backend in ("auto", "recursion"))
    assert fast.stats.plan.dynamics in ("compiled", "embedded loops") and fast.stats.handed_over is None
    assert np.abs(fast.q - slow.q).max() <= ALIKE
    assert np.abs(fast.v - slow.v).max() <= ALIKE * max(1.0, np.abs(slow.v).max())
    assert np.abs(fast.work - slow.work).max() <= ALIKE * max(1.0, np.abs(slow.work).max())


# bodies, coordinates, rows of all parts together, and how many rows close loops
SIZES = {
    "four_bar": (3, 4, 12, 2),
    "slider_crank": (3, 4, 12, 2),
    "cardan": (2, 5, 18, 4),
    "gear_pair": (2, 1, 6, 0),
    "heavy_top": (1, 3, 3, 0),
    "layered": (4, 5, 15, 2),
    "welded": (4, 4, 24, 0),
    "wrist": (5, 8, 18, 2),
    "belts": (5, 3, 30, 0),
    "belts across": (5, 4, 31, 1),
    "truss": (2, 2, 6, 0),
    "locked": (2, 2, 12, 0),
    "islands": (10, 13, 39, 6),
    "strutted": (5, 6, 20, 4),
    "tied islands": (14, 19, 60, 9),
    "door on two hinges": (3, 5, 13, 2),
    "ladder": (9, 13, 39, 8),
    "panda": (9, 8, 54, 0),
    "tilted slider-crank": (3, 4, 12, 2),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", SIZES)
def test_no_more_is_modelled_than_a_scene_needs(name):
    parts = gauss.compile_scene(SCENES[name]()).subsystems
    found = [(part.n_bodies, part.n_coordinates, part.n_rows, part.n_loop_constraints) for part in parts]
    assert tuple(map(sum, zip(*found, strict=True))) == SIZES[name]


def test_a_plane_costs_the_same_however_it_lies():
    """The normal of the plane need not be an axis, inertias not be principal, links not lie in one layer."""
    counts = []
    for scene in (mechanisms.four_bar(), tilted(mechanisms.four_bar())):
        system = gauss.compile_scene(scene)
        counts.append(system.dynamics.operations(system, system.subsystems))
    assert counts[1] <= counts[0] + 20  # gravity has more components than one there


@pytest.mark.parametrize(
    "build, what",
    [
        (lambda: _bent_four_bar(1e-7), "mechanisms in a plane"),
        (lambda: _bent_wrist(1e-7), "spherical mechanisms"),
        (lambda: gauss.load("four_bar"), "loops that cannot move"),
        (lambda: gauss.load("n_four_bar", n=1), "loops that cannot move"),
        (lambda: gauss.load("slider_crank"), "joints that repeat others"),
        (lambda: gauss.load("cardan"), "spherical mechanisms"),
    ],
)
def test_what_only_looks_like_it_is_left_alone(build, what):
    stages = gauss.compile_scene(build()).reduction
    assert not next(stage for stage in stages if stage.what.startswith(what)).why


def _bent_four_bar(angle: float) -> gauss.Scene:
    scene = mechanisms.four_bar("ABC")
    scene.revolute("D", "ground", "rocker", at=(1.2, 0, 0), axis=(0, np.sin(angle), np.cos(angle)))
    return scene


def _bent_wrist(offset: float) -> gauss.Scene:
    scene = gauss.Scene("two hinges that miss each other")
    for name in ("a", "b"):
        scene.body(name, 1.0, (0.1, 0.1, 0.1), com=(0.1, 0, 0))
    scene.revolute("A", "ground", "a")
    scene.revolute("B", "a", "b", at=(0, offset, 0.3), axis=(1, 0, 0))
    return scene


def test_a_flat_triangle_may_move_at_first_order_and_is_not_called_rigid():
    """Its rods lie on one line: a loop that is locked, yet not by its velocities."""
    scene = gauss.Scene("flat")
    for name, place in (("one", 0.0), ("two", 1.0)):
        scene.body(name, 1.0, mechanisms.SLENDER, com=(0.5, 0, 0), position=(place, 0, 0))
    scene.revolute("A", "ground", "one")
    scene.revolute("B", "one", "two", at=(1, 0, 0))
    scene.revolute("C", "ground", "two", at=(2, 0, 0))
    assert len(gauss.compile_scene(scene).subsystems[0].joints) == 3


@pytest.mark.slow
def test_what_was_reduced_away_is_still_told():
    """Poses, reactions and energies are those of the scene as it was written."""
    scene = welded()
    options = {"rtol": 1e-11, "atol": 1e-13, "times": [0.05]}
    fast, slow = (gauss.simulate(scene, 0.05, backend=backend, **options) for backend in ("auto", "recursion"))
    for name in ("tool1", "tool3", "tool4"):
        assert np.abs(fast.body(name).position - slow.body(name).position).max() <= 1e-9
    for found, expected in zip(gauss.reactions(fast, "weld2"), gauss.reactions(slow, "weld2"), strict=True):
        assert np.abs(found - expected).max() <= 1e-7 * np.abs(expected).max()
    assert gauss.energy(fast).kinetic == pytest.approx(gauss.energy(slow).kinetic, rel=1e-9)
    assert fast.system.coordinates == ("b1", "b2", "b3", "b4")


def test_a_gear_has_the_reduced_inertia_of_the_book():
    """J1 + r² J2, driven by M1 + r M2."""
    system = gauss.compile_scene(gauss.load("gear_pair"))
    ratio, pinion, wheel = -1 / 3, 0.001, 0.04
    expected = (1.0 + ratio * 2.0) / (pinion + ratio**2 * wheel)
    found = forward_dynamics(system, np.zeros(2), np.zeros(2), np.array([1.0, 2.0]))
    assert found == pytest.approx([expected, ratio * expected], rel=1e-14)


def test_what_is_locked_does_not_move():
    system = gauss.compile_scene(locked())
    found = forward_dynamics(system, *(np.full(4, 0.1),) * 2, np.ones(4))
    assert found[1] == found[3] == 0.0 and np.abs(found[[0, 2]]).min() > 0.0


def test_a_relation_with_nothing_that_moves_is_still_looked_at():
    """A hinge that a second brake holds is driven: what cannot be met is refused, whichever island it is left to."""
    scene = islands()
    scene.body("door", 1.0, (0.1, 0.1, 0.1), com=(0.3, 0, 0))
    scene.revolute("hinge", "ground", "door")
    scene.couple("brake", "hinge", "P", 0.0, 0.2)
    scene.drive("hinge", angle=lambda t: 0.2 + 0.5 * t)
    with pytest.raises(gauss.GaussError):
        gauss.simulate(scene, 0.1)


@pytest.mark.slow
def test_a_scene_that_cannot_move_at_all_has_no_parts():
    """It is solved as it is written, for its reactions."""
    scene = gauss.Scene("monument")
    scene.body("stone", 2.0, (1, 1, 1))
    scene.fixed("foot", "ground", "stone")
    scene.revolute("bolt", "ground", "stone")
    system = gauss.compile_scene(scene)
    assert system.subsystems == ()
    assert gauss.simulate(system, 0.1).q[-1] == pytest.approx([0.0], abs=1e-12)


def test_stages_and_explain_tell_what_was_saved_and_why():
    system = gauss.compile_scene(mechanisms.four_bar(twice=True))
    found, mode = stages(system), system.explain()
    assert rows(system.reduction[0]) == 30 and rows(system.reduction[-1]) == 13
    assert (rows(found[passes.plane]), rows(found[passes.cut]), rows(found[passes.repeated])) == (15, 15, 13)
    assert "(0 0 1)" in found[passes.plane].why[0]
    assert all(f"'{name}'" in found[passes.cut].why[0] for name in "CD")
    assert all(f"'{name}'" in found[passes.repeated].why[0] for name in ("again", "D"))
    assert found[passes.trains].why == ()
    for stage in found.values():
        assert stage.what in mode and all(why in mode for why in stage.why)
