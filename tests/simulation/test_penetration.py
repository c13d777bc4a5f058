"""Penetration in time stepping: third order in smooth steps, removed from positions in others, without energy."""

import numpy as np
import pytest

import gauss
from benchmarks.convex_meshes import heap
from benchmarks.free_bodies import bin_of_balls, dominoes, floor, free_body
from gauss import Plan
from gauss.dynamics.contact.free_body_step import FreeBodyStepper
from gauss.dynamics.contact.position_projection import ACCEPTED_DEPTH
from gauss.errors import SimulationError
from gauss.system import State

STEP = 1e-3  # [s]
LEFT = 2.0  # of the accepted depth: impacts are supposed to change a second derivative by half, and may change all of it
NEAR = 1e-3  # [m]: gaps that are looked at
GAIN = 1e-3  # of the largest energy: what steps of the midpoint rule may add, all together
ORDER, ORDER_ERROR = 3.0, 0.1  # of what a smooth step leaves of a gap, by steps of 2 and 1 ms
DRIFT = 1e-9  # [m]: after ten seconds
FASTER = 3.0  # of a slender body whose spin goes over to its axis of least inertia
SAME = 1e-13  # of coordinates of the order of 1: rounding
KERNELS, WRITTEN_OUT = Plan("time stepping", "pair kernels"), Plan("time stepping", "compiled")


def rocking() -> gauss.Scene:
    """A block that rocks on its edges."""
    scene = floor("rocking block")
    free_body(scene, "block", (0.1**2 + 0.4**2) / 12.0, (0.0, 0.0, 0.2), rate=(0.2, 0.0, 0.0, 0.0, 1.0, 0.0))
    scene.box("box", "block", (0.1, 0.2, 0.4))
    scene.contacts_all(friction=0.8)
    return scene


def rolling() -> gauss.Scene:
    """A cylinder and a ball that roll along x."""
    scene = floor("rolling")
    for k, name in enumerate(("wheel", "ball")):
        free_body(scene, name, 0.002, (0.0, 0.3 * k, 0.05), rate=(0.5, 0.0, 0.0, 0.0, 10.0, 0.0))
    scene.cylinder("cylinder", "wheel", 0.05, 0.1, axis=(0, 1, 0))
    scene.sphere("sphere", "ball", 0.05)
    scene.contacts_all(friction=0.5)
    return scene


def falling_rod() -> gauss.Scene:
    """A rod that turns about its lower edge, which sticks to the floor."""
    length, width, turn, rate = 1.0, 0.02, 0.3, 1.0
    scene, c, s = floor("falling rod"), np.cos(turn), np.sin(turn)
    centre = -np.array([c * width - s * length, 0.0, -s * width - c * length]) / 2.0
    free_body(
        scene,
        "rod",
        (length**2 + width**2) / 12.0,
        centre,
        rate=(rate * centre[2], 0.0, -rate * centre[0], 0.0, rate, 0.0),
        turn=(np.cos(turn / 2.0), 0.0, np.sin(turn / 2.0), 0.0),
    )
    scene.box("box", "rod", (width, 0.1, length))
    scene.contacts_all(friction=5.0)
    return scene


def moved(system, end: float, step: float, **options):
    """Motion by time stepping."""
    return gauss.simulate(system, end, integrator="time_stepping", step=step, progress=False, **options)


def least_gaps(stepper: FreeBodyStepper, found) -> np.ndarray:
    """Least gap at each sample [m]."""
    least = []
    for q, v in zip(found.q, found.v, strict=True):
        near, _ = stepper.detection.find(stepper.begin(State(0.0, q, v), 0.0, 0.0).bodies, NEAR)
        least.append(near.gap.min(initial=NEAR))
    return np.array(least)


SCENES = {
    "dominoes": (lambda: dominoes(5, push=3.0), 0.4),
    "rocking block": (rocking, 1.0),
    "balls": (lambda: bin_of_balls(12), 0.4),
    "meshes": (lambda: heap(4), 0.3),
}


@pytest.mark.slow
@pytest.mark.parametrize("step", [STEP, 0.5 * STEP])
@pytest.mark.parametrize("name", SCENES)
def test_impacts_leave_no_penetration_and_gain_no_energy(name, step):
    make, end = SCENES[name]
    system = gauss.compile_scene(make())
    found, stepper = moved(system, end, step, plan=KERNELS), FreeBodyStepper(system)
    assert least_gaps(stepper, found).min() >= -LEFT * ACCEPTED_DEPTH * system.scale.length
    energy = gauss.energy(found)
    kinetic, potential = energy.kinetic, energy.potential
    risen = np.diff(kinetic + potential).clip(min=0.0).sum()
    assert risen <= GAIN * max(kinetic.max(), np.ptp(potential))


@pytest.mark.slow
@pytest.mark.parametrize("plan", [KERNELS, WRITTEN_OUT])
def test_smooth_steps_leave_gaps_of_third_order(plan):
    system = gauss.compile_scene(falling_rod())
    stepper = FreeBodyStepper(system)
    coarse, fine = (np.abs(least_gaps(stepper, moved(system, 0.3, h, plan=plan))[1:]).max() for h in (2 * STEP, STEP))
    assert np.log2(coarse / fine) == pytest.approx(ORDER, abs=ORDER_ERROR)


@pytest.mark.slow
def test_what_rolls_does_not_drift():
    system = gauss.compile_scene(rolling())
    found = moved(system, 10.0, STEP)
    places = found.q[-1].reshape(-1, 7)[:, 1:3]
    np.testing.assert_allclose(places, [[0.0, 0.05], [0.3, 0.05]], atol=DRIFT)


def test_positions_alone_are_projected():
    """The step that begins to close a gap leaves penetration; removing it changes no rate, no force and no work."""
    system = gauss.compile_scene(dominoes(2, push=3.0))
    projected, left = (FreeBodyStepper(system) for _ in range(2))
    left.settings = left.settings | {"accepted": np.inf}
    one, other = (stepper.python_step(system.initial_state(), STEP) for stepper in (projected, left))
    for name in ("v", "force", "power"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    before, after = (
        stepper.detection.find(stepper.begin(State(STEP, step.q, step.v), 0.0, 0.0).bodies, NEAR)[0].gap.min()
        for stepper, step in ((left, other), (projected, one))
    )
    assert before < -10.0 * ACCEPTED_DEPTH * system.scale.length
    assert abs(after) <= SAME + (one.q - other.q).max() ** 2 / 0.01  # of second order, with the thickness of a domino


@pytest.mark.slow
def test_projections_keep_the_centre_of_mass():
    """Boxes that turn and hit each other in space: displacements in the metric of the masses move no common centre."""
    scene = gauss.Scene("boxes in space", gravity=(0, 0, 0))
    for k, x in enumerate((-0.2, 0.2)):
        free_body(scene, f"box {k}", 0.01, (x, 0.02 * k, 0.0), rate=(-5.0 * x, 0.0, 0.0, 1.0, 5.0, 20.0 * x))
        scene.box(f"cube {k}", f"box {k}", (0.2, 0.2, 0.2))
    scene.contacts_all(friction=0.3)
    system = gauss.compile_scene(scene)
    found = moved(system, 0.4, STEP, plan=KERNELS)
    assert len(found.events)
    centre = found.q.reshape(-1, 2, 7)[..., :3].mean(axis=1)
    np.testing.assert_allclose(centre, np.tile(centre[0], (len(centre), 1)), atol=SAME)


@pytest.mark.parametrize("step", [0.01, 0.05])
@pytest.mark.parametrize("plan", [KERNELS, WRITTEN_OUT], ids=str)
def test_steps_in_which_a_body_turns_too_far_add_no_speed(plan, step):
    """Second derivatives tell nothing of such a step: it is refused, or its speeds stay of the size of those before."""
    scene, size, spin = floor("fast box"), np.array([0.1, 0.1, 0.4]), np.array([30.0, 20.0, 50.0])
    scene.body("body", mass=1.0, inertia=tuple((size @ size - size**2) / 12.0))
    scene.free("floats", "ground", "body")
    scene.start("floats", position=(0.0, 0.0, 0.3, 1.0, 0.0, 0.0, 0.0), rate=(0.0, 0.0, -2.0, *spin))
    scene.box("box", "body", size)
    scene.contacts_all(friction=0.5)
    run = {"integrator": "time_stepping", "step": step, "plan": plan, "progress": False}
    try:
        motion = gauss.simulate(scene, 0.5, **run)
    except SimulationError:
        return
    assert np.abs(motion.v).max() < FASTER * np.abs(spin).max()


@pytest.mark.slow
@pytest.mark.parametrize("plan", [KERNELS, WRITTEN_OUT], ids=str)
def test_steps_that_fail_because_a_body_turns_too_far_are_named(plan):
    scene, step = floor("spinning box"), 0.01
    scene.body("box", 1.0, (0.01, 0.02, 0.03))
    scene.free("floats", "ground", "box")
    scene.box("cuboid", "box", size=(0.2, 0.3, 0.4))
    scene.contacts_all(friction=0.3)
    spin = 3.0 / step  # rad a step
    scene.start("floats", position=(0, 0, 0.6, 1, 0, 0, 0), rate=(0, 0, 0, 0.3 * spin, spin, 0.2 * spin))
    with np.errstate(all="ignore"), pytest.raises(SimulationError, match=f"^t = .*{step} s: "):
        gauss.simulate(scene, 0.5, integrator="time_stepping", step=step, plan=plan, progress=False)
