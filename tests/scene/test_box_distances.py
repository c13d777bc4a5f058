"""Boxes that touch boxes, capsules and points: distances of Coal, slopes, sliding over a rim, crossed planks, collisions."""

from dataclasses import replace

import coal
import numpy as np
import pytest

import gauss
from gauss.dynamics.gap_functions import gaps
from gauss.dynamics.kinematics import kinematics
from gauss.errors import NonUniqueReactionWarning, SimulationError
from gauss.scene.box_distances import FAR_APART, Edges
from gauss.scene.contact_pairs import places
from gauss.system import guards, random_state, retract

pytestmark = pytest.mark.slow

g = 9.81
TIGHT = {"rtol": 1e-10, "atol": 1e-12, "progress": False}
EXACT = 1e-8  # a motion at rtol 1e-10 over a second against its closed form
COAL = 1e-9  # of its distances, found by an iteration
CENTRAL_DIFFERENCE = 1e-6  # h² of a step 1e-5 times third derivatives, plus rounding/h
RIM = 2e-7  # m: how far beyond the rim a corner rests on a face, see REACH

SIZE = (1.0, 0.6, 0.3)
SHAPES = {
    "box": (lambda s, *args: s.box(*args, SIZE), coal.Box(*SIZE)),
    "capsule": (lambda s, *args: s.capsule(*args, 0.2, 1.0), coal.Capsule(0.2, 1.0)),
    "sphere": (lambda s, *args: s.sphere(*args, 0.3), coal.Sphere(0.3)),
    "points": (lambda s, *args: s.points(*args, [(0, 0, 0)], 0.1), coal.Sphere(0.1)),
}


def _pair(first, second):
    scene = gauss.Scene("pair", gravity=(0, 0, 0))
    for body, kind in (("a", first), ("b", second)):
        scene.body(body, 1.0, (0.1, 0.2, 0.25))
        scene.free(body.upper(), "ground", body)
        SHAPES[kind][0](scene, f"of {body}", body)
    scene.contact("C", "of a", "of b")
    return gauss.compile_scene(scene)


def _poses(system, n, seed=0):
    """Random poses, from apart to overlapping."""
    rng = np.random.default_rng(seed)
    for _ in range(n):
        state = random_state(system, rng)
        q = state.q.copy()
        q[0:3], q[7:10] = 0.0, rng.normal(size=3) * rng.choice([0.4, 0.7, 1.2])
        yield system.state(q, state.v)


PAIRS = [("box", "box"), ("capsule", "box"), ("box", "capsule"), ("sphere", "box"), ("points", "box")]
PAIRS += [("capsule", "capsule"), ("sphere", "capsule"), ("sphere", "sphere")]


@pytest.mark.peer
@pytest.mark.parametrize(("first", "second"), PAIRS)
def test_the_least_gap_is_the_signed_distance(first, second):
    system = _pair(first, second)
    request = coal.DistanceRequest()
    request.gjk_tolerance, request.epa_tolerance = 1e-12, 1e-10
    apart = inside = 0
    for state in _poses(system, 300):
        motion = kinematics(system, state)
        poses = [coal.Transform3s(motion.rotation(body), motion.position(body)) for body in "ab"]
        shapes = SHAPES[first][1], SHAPES[second][1]
        distance = coal.distance(shapes[0], poses[0], shapes[1], poses[1], request, coal.DistanceResult())
        found = gaps(motion)
        least = found.width.min()
        if distance > -0.01:  # shapes deep in each other have no one way out
            assert least == pytest.approx(distance, abs=COAL)
            apart, inside = apart + (distance > 0), inside + (distance < 0)
        else:
            assert least < 0.0 or guards(system.scene)[0].positions(motion)[0] < 0.0
    assert apart > 100
    assert inside >= (1 if first == second == "box" else 0)


def test_rows_of_places_with_fixed_features_are_their_derivatives():
    """Of all corners and crossings of two boxes, in the features at hand."""
    system, h = _pair("box", "box"), 1e-5
    state = next(_poses(system, 1))
    here = kinematics(system, state)
    kept = [place.fixed(here) for place in places(*system.scene.shapes.values())]
    scene = replace(system.scene, contacts={})
    for k, place in enumerate(kept):
        scene.one_sided(f"c{k}", lambda at, place=place: place.touch(at).gap)
        scene.one_sided(f"m{k}", lambda at, place=place: place.margin(at))
    system = gauss.compile_scene(scene)
    rate = np.random.default_rng(1).standard_normal(system.n_v)

    def moved(s):
        theta = s * state.v + 0.5 * s * s * rate
        return kinematics(system, replace(state, q=retract(system, state.q, theta), v=state.v + s * rate))

    here, before, after = (gaps(moved(s)) for s in (0.0, -h, h))
    scale = np.abs(here.rate).max()
    assert here.rate == pytest.approx((after.width - before.width) / (2 * h), abs=CENTRAL_DIFFERENCE * scale)
    a = (moved(h).quasi_velocities() - moved(-h).quasi_velocities()) / (2 * h)
    acceleration = here.J @ np.concatenate([a, rate]) - here.D
    scale = np.abs(acceleration).max()
    assert acceleration == pytest.approx((after.rate - before.rate) / (2 * h), abs=CENTRAL_DIFFERENCE * scale)


def test_parallel_edges_do_not_cross():
    scene = gauss.Scene("cubes")
    for name in "ab":
        scene.body(name, 1.0, (1, 1, 1))
        scene.free(name.upper(), "ground", name)
        scene.box(f"of {name}", name, (1, 1, 1))
    scene.contact("C", "of a", "of b")
    system = gauss.compile_scene(scene)
    motion = kinematics(system, system.state([0, 0, 1.0, 1, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0]))
    width = gaps(motion).width
    assert sorted(np.flatnonzero(np.abs(width) < 1e-12)) == [0, 2, 4, 6, 9, 11, 13, 15]  # four corners of each
    assert (width[16:] == FAR_APART).all()


def _block(scene, name, size, at, rotation=(0, 0, 0), mass=1.0):
    x, y, z = size
    inertia = mass / 12.0 * np.array([y * y + z * z, x * x + z * z, x * x + y * y])
    scene.body(name, mass, inertia, position=at, rotation=rotation)
    scene.free(f"moves {name}", "ground", name, at=at)
    scene.box(f"of {name}", name, size)


def test_a_block_that_slides_off_a_table_tips_over_the_rim_when_its_middle_is_there():
    """Corners slide off first, then edges of the block bear it on the rim; then it turns about the rim and slides."""
    scene = gauss.Scene("table", gravity=(0, 0, -g))
    scene.box("table", "ground", (2, 2, 1), at=(0, 0, -0.5))
    _block(scene, "block", (0.2, 0.2, 0.1), (0.7, 0, 0.05))
    scene.contact("C", "of block", "table")
    scene.start("moves block", rate=(1, 0, 0, 0, 0, 0))
    motion = gauss.simulate(scene, 0.45, **TIGHT)
    opens = [event.t for event in motion.events if event.kind == "opens"]
    assert opens[0] == pytest.approx(0.2, abs=2 * RIM)  # the front gets to the rim
    assert opens[1] == pytest.approx(0.3, abs=1e-6)  # the middle does
    assert 0.4 < opens[2] < 0.42  # the rear
    still = motion.t < opens[1]
    assert np.abs(motion.q[still, 2]).max() < EXACT
    assert motion.q[still, 0] == pytest.approx(motion.t[still], abs=EXACT)
    # while it turns, the rim stays on its bottom face: distance of the rim (1, 0) from the plane of the face
    turns = (motion.t > opens[1] + 1e-9) & (motion.t < opens[2])
    block = motion.body("block")
    rim = np.array([1.0, 0, 0])
    heights = [R[:, 2] @ (rim - p) for R, p in zip(block.rotation[turns], block.position[turns], strict=True)]
    assert heights == pytest.approx(np.full(len(heights), -0.05), abs=EXACT)
    assert np.abs(gauss.energy(motion).balance).max() < EXACT


def test_crossed_planks_rest_on_four_crossings_of_edges():
    scene = gauss.Scene("planks", gravity=(0, 0, -g))
    scene.box("lower", "ground", (0.2, 2, 0.1), at=(0, 0, -0.05))
    _block(scene, "plank", (2, 0.2, 0.1), (0, 0, 0.15))
    scene.contact("C", "of plank", "lower")
    motion = gauss.simulate(scene, 0.4, **TIGHT)
    impact, closes = motion.events
    assert impact.t == pytest.approx(np.sqrt(0.2 / g), abs=EXACT)
    assert impact.loss == pytest.approx(g * 0.1, rel=EXACT)
    assert len(closes.gaps) == 4
    assert np.abs(motion.v[-1]).max() < EXACT
    kinds = places(*(scene.shapes[name] for name in ("of plank", "lower")))
    assert all(isinstance(kinds[int(name.split(".")[1]) - 1], Edges) for name in closes.gaps)
    with pytest.warns(NonUniqueReactionWarning):
        assert gauss.contact_forces(motion, "C")[-1].sum() == pytest.approx(g, rel=EXACT)


def test_colliding_boxes_keep_momentum_spin_and_energy():
    scene = gauss.Scene("collision", gravity=(0, 0, 0))
    _block(scene, "a", (1, 0.6, 0.3), (0, 0, 0))
    _block(scene, "b", (0.5, 0.4, 0.8), (1.5, 0.1, 0.05), rotation=(0.3, 0.2, 0.5))
    scene.contact("C", "of a", "of b", restitution=1.0)
    scene.start("moves a", rate=(1, 0, 0, 0.5, 1.0, -0.7))
    scene.start("moves b", rate=(-1, 0, 0, 1.3, -0.4, 0.6))
    motion = gauss.simulate(scene, 1.5, **TIGHT)
    assert len([event for event in motion.events if event.kind == "impact"]) >= 2
    assert motion.work[-1, 2] == pytest.approx(0.0, abs=EXACT)  # nothing is lost
    assert np.abs(gauss.energy(motion).balance).max() < EXACT
    momentum, spin = np.zeros((len(motion), 3)), np.zeros((len(motion), 3))
    for index, shown in enumerate(motion.motions):
        for i, (mass, J) in enumerate(zip((1.0, 1.0), scene_inertias(shown.system), strict=True)):
            momentum[index] += mass * shown.u[i]
            spin[index] += shown.R[i] @ (J * (shown.R[i].T @ shown.W[i])) + mass * np.cross(shown.x[i], shown.u[i])
    assert momentum == pytest.approx(np.tile(momentum[0], (len(motion), 1)), abs=EXACT)
    assert spin == pytest.approx(np.tile(spin[0], (len(motion), 1)), abs=EXACT)


def scene_inertias(system):
    """Principal moments of each body."""
    return system.Phi.reshape(-1, 6)[:, :3]


def test_a_box_on_a_large_box_moves_as_on_a_plane():
    """It is pushed so hard that it slides and tips: corners on a face against corners over a half-space."""
    ends = []
    for ground in ("half-space", "box"):
        scene = gauss.Scene("tipping", gravity=(0, 0, -g))
        _block(scene, "block", (0.4, 0.3, 0.4), (0, 0, 0.2), mass=2.0)
        if ground == "box":
            scene.box("floor", "ground", (20, 20, 1), at=(0, 0, -0.5))
        else:
            scene.half_space("floor")
        scene.contact("C", "of block", "floor")
        scene.force("push", "block", force=(25.0, 0, 0), at=(0, 0, 0.2))
        motion = gauss.simulate(scene, 0.2, **TIGHT)
        ends.append(np.concatenate([motion.q[-1], motion.v[-1]]))
    assert ends[0] == pytest.approx(ends[1], abs=EXACT)


def test_a_stack_of_equal_cubes_rests_and_a_capsule_lies_on_it():
    scene = gauss.Scene("stack", gravity=(0, 0, -g))
    scene.half_space("floor")
    _block(scene, "lower", (1, 1, 1), (0, 0, 0.5))
    _block(scene, "upper", (1, 1, 1), (0, 0, 1.5))
    scene.body("log", 3.0, (0.4, 0.4, 0.03), position=(0.1, 0, 2.1), rotation=(0, np.pi / 2, 0))
    scene.free("moves log", "ground", "log", at=(0.1, 0, 2.1), axis=(0, 0, 1))
    scene.capsule("of log", "log", 0.1, 1.4)
    scene.contact("C0", "of lower", "floor")
    scene.contact("C1", "of upper", "of lower")
    scene.contact("C2", "of log", "of upper")
    motion = gauss.simulate(scene, 0.2, times=[0.2], **TIGHT)
    assert np.abs(motion.v).max() < EXACT
    with pytest.warns(NonUniqueReactionWarning):
        for name, weight in (("C0", 5.0 * g), ("C1", 4.0 * g)):
            assert gauss.contact_forces(motion, name).sum() == pytest.approx(weight, rel=EXACT)
    # the log overhangs at both ends: two edges of the cube bear it, 0.4 and 0.6 m from its middle
    forces = gauss.contact_forces(motion, "C2")[0]
    assert sorted(forces[forces > EXACT]) == pytest.approx([3 * g * 0.4, 3 * g * 0.6], rel=EXACT)


def test_a_foot_without_radius_leaves_a_box_at_its_rim():
    scene = gauss.Scene("foot", gravity=(0, 0, -g))
    scene.box("table", "ground", (2, 2, 1), at=(0, 0, -0.5))
    scene.body("mass", 1.0, (0.1, 0.1, 0.1), position=(0.9, 0.3, 0.0))
    scene.free("F", "ground", "mass", at=(0.9, 0.3, 0))
    scene.points("foot", "mass", [(0, 0, 0)])
    scene.contact("C", "foot", "table")
    scene.start("F", rate=(0.5, 0, 0, 0, 0, 0))
    motion = gauss.simulate(scene, 0.5, **TIGHT)
    assert [event.kind for event in motion.events] == ["closes", "opens"]
    assert motion.events[1].t == pytest.approx(0.2, abs=4 * RIM)
    assert motion.q[-1, 2] == pytest.approx(-0.5 * g * 0.3**2, abs=1e-5)


def test_a_start_in_each_other_is_refused_though_no_gap_says_so():
    """A capsule through a box: its ends and the edges of the box are farther away than its radius."""
    scene = gauss.Scene("skewer", gravity=(0, 0, -g))
    scene.box("block", "ground", (0.4, 0.4, 0.4))
    scene.body("rod", 1.0, (0.1, 0.1, 0.1))
    scene.free("F", "ground", "rod")
    scene.capsule("of rod", "rod", 0.05, 2.0)
    scene.contact("C", "of rod", "block")
    system = gauss.compile_scene(scene)
    assert gaps(kinematics(system, system.initial_state())).width.min() > 0.1
    with pytest.raises(SimulationError, match="0.2 .*inside of 'C'.*scene.start"):
        gauss.simulate(scene, 0.1, **TIGHT)
    with pytest.raises(SimulationError, match="0.2 m in each other.*'C'"):
        gauss.simulate(scene, 0.1, integrator="time_stepping", step=0.01)


def test_edges_that_meet_in_one_long_step_are_not_missed():
    """Two rods that fly at each other freely, so that steps grow; their edges cross within one of them."""
    scene = gauss.Scene("rods", gravity=(0, 0, 0))
    _block(scene, "a", (1.0, 0.02, 0.02), (0, 0, 0), rotation=(np.pi / 4, 0, 0))
    _block(scene, "b", (0.02, 1.0, 0.02), (0.1, 0.2, 5.0), rotation=(0, np.pi / 4, 0))
    scene.contact("C", "of a", "of b", restitution=1.0)
    scene.start("moves b", rate=(0, 0, -1.0, 0, 0, 0))
    motion = gauss.simulate(scene, 10.0, **TIGHT)
    hit = motion.events[0]
    assert hit.kind == "impact"
    # edges stick out by half a diagonal of the section each
    assert hit.t == pytest.approx(5.0 - 0.02 * np.sqrt(2.0), abs=EXACT)
    assert motion.work[-1, 2] == pytest.approx(0.0, abs=EXACT)


def test_a_rough_block_on_a_box_stops_where_friction_says():
    """Its edges are parallel to those of the table, so most pairs of edges have no normal, and must not be asked for one."""
    scene, h = gauss.Scene("rough", gravity=(0, 0, -g)), 1e-3
    scene.box("table", "ground", (2, 2, 1), at=(0, 0, -0.5))
    _block(scene, "block", (0.2, 0.2, 0.1), (0, 0, 0.05))
    scene.contact("C", "of block", "table", friction=0.3)
    scene.start("moves block", rate=(1, 0, 0, 0, 0, 0))
    motion = gauss.simulate(scene, 0.4, integrator="time_stepping", step=h, progress=False)
    assert motion.q[-1, 0] == pytest.approx(0.5 / (0.3 * g), abs=h)  # less by half a step of its speed
    assert np.abs(motion.v[-1]).max() < EXACT
    assert np.abs(gauss.energy(motion).balance).max() < h
    assert gauss.friction_forces(motion, "C")[100].sum(axis=0) == pytest.approx([-0.3 * g, 0, 0], abs=EXACT)
    assert gauss.contact_forces(motion, "C")[100].sum() == pytest.approx(g, rel=EXACT)
