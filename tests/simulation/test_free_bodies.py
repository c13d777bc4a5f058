"""Time stepping of free bodies with many contacts: kernels of pairs of shapes, laws of contact, momentum, rest."""

from itertools import combinations

import numpy as np
import pytest

import gauss
from benchmarks.free_bodies import EDGE, RADIUS, bin_of_balls, dominoes, floor, free_body, stack
from gauss import Plan
from gauss.dynamics.contact.free_body_step import FreeBodyStepper, rates
from gauss.dynamics.gap_functions import gaps, slips
from gauss.dynamics.kinematics import kinematics
from gauss.errors import SceneError, StateError
from gauss.simulation.moreau.contact_motion import ContactMotion
from gauss.system import State

STEP = 1e-3  # [s]
ROUNDING = 1e-12  # of values of the order of 1 by two ways of computing
LAWS = 1e-8  # of the largest force or speed: residual of the laws of contact
DEPTH = 1e-7  # [m], [m/s]: penetration, which steps remove, and what it does to a motion
SAME_STEPS = 1e-7  # coordinates after two hundred steps of two solvers, each with laws met to 1e-10
FREE = Plan("time stepping", "pair kernels")
SHAPES = {
    "ball": lambda scene, body: scene.sphere(f"{body} shape", body, 0.1, at=(0.02, 0.0, 0.01)),
    "capsule": lambda scene, body: scene.capsule(f"{body} shape", body, 0.05, 0.2, at=(0.0, 0.03, 0.0), axis=(1, 2, 0)),
    "box": lambda scene, body: scene.box(f"{body} shape", body, (0.2, 0.3, 0.1), rotation=(0.3, 0.2, 0.1)),
    "points": lambda scene, body: scene.points(f"{body} shape", body, [(0.1, 0, 0), (0, 0.1, 0)], radius=0.04),
    "plane": lambda scene, body: scene.half_space("plane", at=(0, 0, -0.1), normal=(0.1, 0.2, 1.0)),
}
PAIRS = [pair for pair in combinations(SHAPES, 2) if pair != ("box", "points")] + [("ball", "ball"), ("box", "points")]
SLOW_PAIRS = [pytest.param("box", "box", marks=pytest.mark.slow)]


def moved(scene, duration: float, **options):
    """Motion by time stepping."""
    return gauss.simulate(scene, duration, integrator="time_stepping", step=STEP, progress=False, **options)


def facing(one: str, other: str):
    """Two shapes that have a contact with friction."""
    scene = gauss.Scene("two shapes")
    for name, kind in (("A", one), ("B", other)):
        if kind != "plane":
            free_body(scene, name, 0.02, (0.0, 0.0, 0.0))
        SHAPES[kind](scene, name)
    scene.contact("touch", *list(scene.shapes), friction=0.3)
    return scene


@pytest.mark.slow
@pytest.mark.parametrize(("one", "other"), [*PAIRS, *SLOW_PAIRS])
def test_kernels_of_pairs_are_the_gap_functions_of_the_scene(one, other):
    system, rng = gauss.compile_scene(facing(one, other)), np.random.default_rng(3)
    stepper, seen = FreeBodyStepper(system), 0
    for _ in range(10):
        q, v = system.reference.q.copy(), rng.standard_normal(system.n_v)
        for k in range(0, system.n_q, 7):
            q[k : k + 3], q[k + 3 : k + 7] = 0.25 * rng.standard_normal(3), rng.standard_normal(4)
            q[k + 3 : k + 7] /= np.linalg.norm(q[k + 3 : k + 7])
        motion = kinematics(system, State(0.0, q, v))
        found, across = gaps(motion), slips(motion)
        begun = stepper.begin(motion.state, 0.0, 0.0)
        near, _ = stepper.detection.find(begun.bodies, 10.0)
        places = stepper.table.gap_places(near.key)
        missing = np.setdiff1d(np.arange(found.width.size), places)
        assert (found.width[missing] > 10.0).all()
        np.testing.assert_allclose(near.gap, found.width[places], atol=ROUNDING)
        rate = rates(near, begun.both)[..., 0]
        scale = 1.0 + np.abs(found.D).max()
        np.testing.assert_allclose(rate[:, 0], found.rate[places], atol=ROUNDING * scale)
        np.testing.assert_allclose(near.bias[:, 0], -found.D[places], atol=1e3 * ROUNDING * scale)
        speeds = np.hypot(*across.rate[places].T)  # the tangents of a pair of swapped shapes are turned
        np.testing.assert_allclose(np.hypot(*rate[:, 1:].T), speeds, atol=ROUNDING * scale)
        seen += near.gap.size
    assert seen


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["ball", "capsule", "box"])
def test_small_scenes_move_as_by_the_machine_code_of_the_scene(kind):
    scene = floor("one body")
    free_body(scene, "A", 0.02, (0.0, 0.0, 0.3), rate=(1.0, 0.2, 0.0, 1.0, 2.0, 3.0))
    SHAPES[kind](scene, "A")
    scene.contacts_all(friction=0.4)
    system = gauss.compile_scene(scene)
    one, other = moved(system, 0.2), moved(system, 0.2, plan=FREE)
    assert (one.stats.plan.dynamics, other.stats.plan.dynamics) == ("compiled", "pair kernels")
    np.testing.assert_allclose(one.q, other.q, atol=SAME_STEPS)
    np.testing.assert_allclose(one.work, other.work, atol=SAME_STEPS)


def test_a_stack_stays():
    found = moved(stack(5), 0.3)
    assert found.stats.plan.dynamics == "pair kernels"
    assert np.abs(found.q - found.q[0]).max() <= 1e-10


def test_a_sliding_ball_rolls_with_five_sevenths_of_its_speed():
    scene = floor("bowling")
    free_body(scene, "ball", 0.4 * RADIUS**2, (0.0, 0.0, RADIUS), rate=(1.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    scene.sphere("sphere", "ball", RADIUS)
    scene.contacts_all(friction=0.5)
    found = moved(scene, 0.2, plan=FREE)
    assert found.v[-1][0] == pytest.approx(5.0 / 7.0, abs=1e-9)


def test_collisions_keep_momentum():
    scene, rng = gauss.Scene("billiard in space", gravity=(0, 0, 0)), np.random.default_rng(1)
    for k in range(12):
        place = np.array([k % 3, k // 3 % 2, k // 6]) * 2.2 * RADIUS
        free_body(scene, f"ball {k}", 0.4 * RADIUS**2, place, rate=(*(-place + 0.1 * rng.standard_normal(3)), 0, 0, 5.0))
        scene.sphere(f"sphere {k}", f"ball {k}", RADIUS)
    scene.contacts_all(friction=0.3, restitution=0.5)
    found = moved(scene, 0.3)
    v = found.v.reshape(len(found.t), 12, 6)
    assert np.abs(v[-1] - v[0]).max() > 0.1
    np.testing.assert_allclose(v[..., :3].sum(axis=1), np.tile(v[0, :, :3].sum(axis=0), (len(v), 1)), atol=1e-11)


@pytest.mark.parametrize(("make", "n"), [(bin_of_balls, 20), (dominoes, 6)])
def test_contact_forces_obey_the_laws_of_signorini_and_coulomb(make, n):
    system = gauss.compile_scene(make(n))
    stepper, state, pressed = FreeBodyStepper(system), system.initial_state(), 0
    stepper.forget()
    for _ in range(200):
        found = stepper.python_step(state, STEP)
        near, (normal, *across) = found.contacts, found.force.T
        state = State(state.t + STEP, found.q, found.v)
        assert (near.gap > -1e-5).all()
        largest = 1.0 + normal.max(initial=0.0)
        assert (normal >= -LAWS * largest).all()
        friction = stepper.table.friction[near.law]
        assert (np.hypot(*across) <= friction * normal + LAWS * largest).all()
        assert found.error <= LAWS
        pressed = max(pressed, int((normal > 0.0).sum()))
    assert pressed >= n


def test_forces_of_a_stack_carry_its_weight():
    found = moved(stack(3), 5 * STEP)
    weight = 9.81 * np.arange(3, 0, -1)
    for k, name in enumerate(("cube 0 on floor", "cube 1 on cube 0", "cube 2 on cube 1")):
        borne = gauss.contact_forces(found, name).sum(axis=1)
        np.testing.assert_allclose(borne, weight[k], rtol=1e-7)
        assert np.abs(gauss.friction_forces(found, name).sum(axis=1)).max() <= 1e-6


def test_near_contacts_are_all_that_are_nearer():
    scene, rng = gauss.Scene("cloud"), np.random.default_rng(5)
    for k in range(40):
        free_body(scene, f"body {k}", 0.01, rng.uniform(-0.5, 0.5, 3))
        if k % 2:
            scene.sphere(f"shape {k}", f"body {k}", 0.1)
        else:
            scene.box(f"shape {k}", f"body {k}", (0.1, 0.2, 0.3), rotation=tuple(rng.standard_normal(3)))
    scene.contacts_all()
    system = gauss.compile_scene(scene)
    stepper = FreeBodyStepper(system)
    bodies = stepper.begin(system.initial_state(), 0.0, 0.0).bodies
    every = stepper.detection.find(bodies, 10.0)[0]
    for reach in (0.0, 0.05, 0.2):
        near = stepper.detection.find(bodies, reach)[0]
        expected = every.key[every.gap <= reach]
        assert expected.size < every.key.size
        np.testing.assert_array_equal(near.key, expected)


def test_contacts_all_leaves_out_what_cannot_touch():
    scene = floor("choice")
    scene.half_space("wall", normal=(1, 0, 0))
    for name in "ABC":
        free_body(scene, name, 0.1, (0.0, 0.0, 1.0))
        scene.sphere(f"ball {name}", name, 0.1)
    scene.sphere("ear", "A", 0.05, at=(0, 0, 0.1))
    pairs = {frozenset((c.shape, c.other)) for c in scene.contacts_all(exclude=[("A", "B"), ("ball C", "wall")])}
    assert frozenset(("ball A", "ear")) not in pairs and frozenset(("floor", "wall")) not in pairs
    assert frozenset(("ball A", "ball B")) not in pairs and frozenset(("ear", "ball B")) not in pairs
    assert frozenset(("ball C", "wall")) not in pairs
    assert {frozenset(("ball A", "ball C")), frozenset(("ear", "floor")), frozenset(("ball B", "wall"))} <= pairs
    assert len(pairs) == 10 and not scene.contacts_all(exclude=[("A", "B"), ("ball C", "wall")])
    with pytest.raises(SceneError, match="'ball D'"):
        scene.contacts_all(exclude=[("ball D", "floor")])


@pytest.mark.parametrize("aside", [0.05, 1e-5, 0.0])
def test_shapes_in_each_other_at_the_start_are_refused(aside):
    scene = stack(2)
    scene.start("box 1 floats", position=(aside, aside, 1.4 * EDGE, 1, 0, 0, 0))
    with pytest.raises(StateError, match=f"{0.1 * EDGE:.3g} .*inside of 'cube 1 on cube 0'"):
        moved(scene, STEP)


@pytest.mark.slow
@pytest.mark.parametrize("step", [1e-2, 1e-3])
@pytest.mark.parametrize("turned", [0.0, 1e-6])
def test_equal_cubes_that_fall_on_each_other_face_to_face_come_to_rest(step, turned):
    """Their corners meet rims of faces exactly: the face counts across which the cubes meet, not a side at no distance."""
    scene = stack(3)
    for k in range(3):
        pose = (0, 0, (0.5 + 1.3 * k) * EDGE, 1, 0, 0, 0.5 * turned * k)
        scene.start(f"box {k} floats", position=pose, rate=(0, 0, -1.0 * k, 0, 0, 0))
    motion = gauss.simulate(scene, 0.5, integrator="time_stepping", step=step, progress=False)
    assert motion.q[-1, 2::7] == pytest.approx(EDGE * np.array([0.5, 1.5, 2.5]), abs=DEPTH)
    assert np.abs(motion.v[-1]).max() < LAWS


@pytest.mark.parametrize("speed", [0.3, 1.0])
@pytest.mark.parametrize("width", [0.2, 1.0, 1.4])
def test_a_box_that_comes_over_the_rim_of_a_table_slides_on(speed, width):
    """Its corners beside the table are no contacts with the sides of that: the box lies on the top."""
    scene = gauss.Scene("table")
    scene.box("table", "ground", (1.0, 1.0, 0.1), at=(0, 0, -0.05))
    free_body(scene, "block", 0.01, (-0.45, 0.0, 0.1), rate=(speed, 0, 0, 0, 0, 0))
    scene.box("hull", "block", (0.2, width, 0.2))
    scene.contact("lies", "hull", "table")
    motion = moved(scene, 0.5)
    assert motion.q[-1, :3] == pytest.approx([-0.45 + 0.5 * speed, 0.0, 0.1], abs=DEPTH)
    assert motion.v[-1] == pytest.approx([speed, 0, 0, 0, 0, 0], abs=DEPTH)


@pytest.mark.slow
@pytest.mark.parametrize("h", [1e-3, 5e-4])
def test_dominoes_with_redundant_contacts_meet_the_laws_in_each_step(h):
    system = gauss.compile_scene(dominoes(10, push=3.0))
    motion = ContactMotion(system)
    motion.begin(system.initial_state())
    motion.advance(h * np.arange(1.0, round(0.6 / h) + 1.0))
    assert motion.relaxed == 0
    assert motion.largest <= LAWS
