"""Steps by kernels of pairs of shapes one after the other: held inputs, simulators, batches, events, initial overlaps."""

import numpy as np
import pytest

import gauss
from gauss import Plan
from gauss.errors import SimulationError, StateError
from tests.simulation.test_mechanism_contacts import GAIN, SAME_STEPS, STEP, arm, driven

KERNELS, WRITTEN_OUT = Plan("time stepping", "pair kernels"), Plan("time stepping", "compiled")
TIERS = 1e-11  # of the same steps in quick and in optimised code, or in Python, over 100 steps
CLEARANCE = 1e-6  # of the length of the scene: overlap that counts as none
RATE = 130.0  # Hz: samples of the control law beside the ends of steps


def with_motor(make=driven) -> gauss.Scene:
    """The arm of two links with a motor in its outer hinge, and a box beside a wall far away: many contact operations."""
    scene = make() if make is driven else make("arm")
    scene.input("motor", "hinge 1", limits=(-1.0, 0.5))
    scene.box("plate", "link 0", (0.1, 0.1, 0.1))
    scene.box("wall", "ground", (0.1, 0.1, 0.1), at=(5.0, 0.0, 0.0))
    scene.contact("far", "plate", "wall", friction=0.2)
    return scene


def law(t, q, v):
    return [2.0 * np.sin(9.0 * t) - 0.1 * v[0]]


@pytest.mark.slow
@pytest.mark.parametrize("make", [driven, arm])
@pytest.mark.parametrize("times", [None, np.linspace(0.0, 0.15, 17)])
def test_inputs_are_held_as_by_the_machine_code_of_the_scene(make, times):
    scene = make() if make is driven else make("arm")
    scene.input("motor", "hinge 1", limits=(-1.0, 0.5))
    system, run = gauss.compile_scene(scene), {"integrator": "time_stepping", "step": STEP, "progress": False}
    one, other = (
        gauss.simulate(system, 0.15, control=law, rate=RATE, times=times, plan=plan, **run)
        for plan in (WRITTEN_OUT, KERNELS)
    )
    np.testing.assert_array_equal(one.t, other.t)
    np.testing.assert_allclose(one.q, other.q, atol=SAME_STEPS)
    np.testing.assert_allclose(one.work, other.work, atol=1e2 * SAME_STEPS)
    assert len(other.events) > 0


def test_a_simulator_makes_the_steps_of_simulate_and_continues_from_a_snapshot():
    scene = with_motor()
    scene.output("push", "contact_force", "touch")
    scene.output("felt", "accelerometer", "link 1")
    simulator, values = gauss.Simulator(scene, STEP), np.sin(np.arange(20.0))
    kept, ends = None, []
    for k, value in enumerate(values):
        kept = simulator.snapshot() if k == 10 else kept
        simulator.step([value], n=5)
    motion = gauss.simulate(simulator.system, 0.1, control=values, rate=200.0, integrator="time_stepping", step=STEP)
    assert motion.stats.plan.dynamics == "pair kernels"
    np.testing.assert_allclose(simulator.state.q, motion.q[-1], atol=TIERS)
    np.testing.assert_allclose(simulator.work, motion.work[-1], atol=TIERS)
    for _ in range(2):
        simulator.restore(kept)
        for value in values[10:]:
            simulator.step([value], n=5)
        ends.append((*simulator.state.q, *simulator.state.v, *simulator.work, *simulator.output_vector()))
    assert ends[0] == ends[1]
    assert simulator.outputs["push"].max() > 0.0


def test_batches_are_motions_one_after_the_other():
    system = gauss.compile_scene(with_motor())
    start, run = system.initial_state(), {"integrator": "time_stepping", "step": STEP}
    control = np.array([np.sin(np.arange(4.0)), np.cos(np.arange(4.0))])[:, :, None]
    found = gauss.rollout(system, [start.q] * 2, [start.v] * 2, steps=40, every=10, control=control, **run)
    alone = gauss.simulate(system, 0.04, control=control[1], rate=100.0, times=found.t, **run)
    np.testing.assert_allclose(found.q[1], alone.q, atol=TIERS)


def ball(restitution: float, friction: float, height: float, speed: float) -> gauss.Scene:
    """A ball of 1 kg and 0.1 m above a floor, in two dimensions without spin."""
    scene = gauss.Scene("ball")
    scene.half_space("floor")
    scene.body("slide", mass=0.0, position=(0.0, 0.0, 0.1 + height))
    scene.body("ball", mass=1.0, inertia=(0.004,) * 3, position=(0.0, 0.0, 0.1 + height))
    scene.prismatic("x", "ground", "slide", at=(0.0, 0.0, 0.1 + height), axis=(1, 0, 0))
    scene.prismatic("z", "slide", "ball", at=(0.0, 0.0, 0.1 + height), axis=(0, 0, 1))
    scene.sphere("sphere", "ball", 0.1)
    scene.contact("touch", "sphere", "floor", friction=friction, restitution=restitution)
    scene.start("x", rate=speed)
    return scene


@pytest.mark.slow
def test_impacts_are_events_with_the_energy_that_they_lose():
    motion = gauss.simulate(
        ball(0.5, 0.0, 0.2, 0.0), 0.7, integrator="time_stepping", step=STEP, progress=False, plan=KERNELS
    )
    impacts = [event for event in motion.events if event.kind == "impact"]
    fall = np.sqrt(2.0 * 0.2 / 9.81)
    times = fall * np.array([1.0, 2.0, 2.5])
    assert np.abs([event.t for event in impacts[:3]] - times).max() <= 3.0 * STEP
    energies = 9.81 * 0.2 * 0.75 * 0.25 ** np.arange(2)
    np.testing.assert_allclose([event.loss for event in impacts[:2]], energies, rtol=0.02)
    assert {event.gaps for event in motion.events} == {("touch",)}


def test_a_sliding_ball_that_cannot_turn_stops_when_friction_has_its_momentum():
    motion = gauss.simulate(
        ball(0.0, 0.4, 0.0, 1.0), 0.5, integrator="time_stepping", step=STEP, progress=False, plan=KERNELS
    )
    assert [event.kind for event in motion.events] == ["holds"]
    assert motion.events[0].t == pytest.approx(1.0 / (0.4 * 9.81), abs=STEP)


@pytest.mark.slow
def test_overlaps_at_the_start_are_named_and_resolved():
    system = gauss.compile_scene(arm("deep arm", height=0.3))
    run = {"integrator": "time_stepping", "step": STEP, "progress": False, "plan": KERNELS}
    with pytest.raises(StateError, match="resolve_overlaps"):
        gauss.simulate(system, 0.01, **run)
    state = gauss.resolve_overlaps(system)
    motion = gauss.simulate(system, 0.01, state=state, **run)
    energy = gauss.energy(motion)
    assert np.diff(energy.kinetic + energy.potential).max() <= GAIN * energy.scale
    again = gauss.resolve_overlaps(system, state)
    assert np.abs(again.q - state.q).max() <= CLEARANCE


def fingers(axis) -> gauss.Scene:
    """Two equal pads, face to face and 1 mm deep in each other along y, that slide along an axis."""
    scene = gauss.Scene("fingers", gravity=(0, 0, 0))
    for name, side in (("left", -1.0), ("right", 1.0)):
        scene.body(name, mass=0.1, inertia=(1e-4,) * 3, position=(0.0, 0.0035 * side, 0.0))
        scene.prismatic(f"{name} slides", "ground", name, at=(0.0, 0.0035 * side, 0.0), axis=axis)
        scene.box(f"{name} pad", name, (0.016, 0.008, 0.016))
    scene.contact("touch", "left pad", "right pad", friction=0.5)
    return scene


def test_pads_that_start_in_each_other_are_moved_apart_across_their_faces():
    system = gauss.compile_scene(fingers(axis=(0, 1, 0)))
    with pytest.raises(StateError, match=r"0.001 \[m, rad\] inside of 'touch'"):
        gauss.Simulator(system, STEP)
    assert gauss.resolve_overlaps(system).q == pytest.approx([-5e-4, 5e-4], abs=CLEARANCE)


def test_overlaps_that_no_joint_opens_are_named():
    with pytest.raises(StateError, match="'touch' stay in each other; its joints"):
        gauss.resolve_overlaps(gauss.compile_scene(fingers(axis=(0, 0, 1))))


def gripper() -> gauss.Scene:
    """Two balls that press a box of 1 kg between them with a force; friction 0.5."""
    scene = gauss.Scene("gripper")
    scene.body("box", mass=1.0, inertia=(0.01,) * 3)
    scene.prismatic("lift", "ground", "box", axis=(0, 0, 1))
    scene.box("block", "box", (0.2, 0.2, 0.2))
    for name, side in (("left", -1.0), ("right", 1.0)):
        scene.body(name, mass=0.1, inertia=(1e-4,) * 3, position=(0.12 * side, 0.0, 0.0))
        scene.prismatic(f"{name} slides", "ground", name, at=(0.12 * side, 0.0, 0.0), axis=(-side, 0, 0))
        scene.sphere(f"{name} tip", name, 0.02)
        scene.input(f"{name} force", f"{name} slides", limits=20.0)
        scene.contact(f"{name} touch", f"{name} tip", "block", friction=0.5)
    return scene


def test_a_batch_makes_the_steps_of_simulators_in_turn():
    scene = with_motor(arm)
    scene.output("push", "contact_force", "touch")
    many, alone = gauss.SimulatorBatch(scene, STEP, batch=3), gauss.Simulator(scene, STEP)
    values = np.sin(np.arange(30.0)).reshape(10, 3, 1)
    for u in values:
        many.step(u, n=10)
        alone.step(u[1], n=10)
    np.testing.assert_allclose(many.q[1], alone.state.q, atol=TIERS)
    np.testing.assert_allclose(many.v[1], alone.state.v, atol=TIERS)
    np.testing.assert_allclose(many.outputs["push"][1], alone.outputs["push"], rtol=SAME_STEPS)
    assert np.abs(many.q[1] - many.q[0]).max() > 1e-3

    fast = np.where(np.arange(2) == 1, 1e200, 0.0)
    many.restart([0, 2], many.q[[1, 1]], [many.v[1], fast])
    many.step(values[0][[1, 1, 1]], n=5)
    alone.reset(alone.state)
    alone.step(values[0][1], n=5)
    assert list(many.diverged) == [False, False, True]
    np.testing.assert_allclose(many.q[0], alone.state.q, atol=TIERS)
    many.restart([2], many.q[:1], many.v[:1])
    assert not many.diverged.any()


def test_a_batch_refuses_starts_off_its_constraints():
    scene = with_motor(arm)
    scene.couple("belt", "hinge 1", "hinge 0", -0.5)
    scene.start("hinge 0", position=0.7, rate=1.0)
    scene.start("hinge 1", position=-0.35, rate=-0.5)
    many = gauss.SimulatorBatch(scene, STEP, batch=2)
    many.step(np.zeros((2, 1)), n=5)
    with pytest.raises(StateError, match="'belt'"):
        many.reset(q=[[0.7, -0.35], [0.7, 0.2]], v=np.zeros((2, 2)))


@pytest.mark.slow
@pytest.mark.parametrize("squeeze", [9.6, 9.7, 9.82, 12.0])
def test_a_gripper_holds_up_to_the_limit_of_friction(squeeze):
    simulator = gauss.Simulator(gripper(), STEP)
    simulator.step([squeeze, squeeze], n=100)
    slides = max(0.0, 9.81 - 2.0 * 0.5 * squeeze)
    assert simulator.state.v[0] == pytest.approx(-0.1 * slides, abs=1e-8)
    assert simulator.state.q[0] == pytest.approx(-0.5 * slides * 0.1**2, abs=1e-6)


def test_a_law_without_numbers_leaves_the_state_before():
    scene = with_motor()
    scene.drive("hinge 1", name="failing", torque=lambda t, at: gauss.math.sqrt(0.1003 - t))
    simulator = gauss.Simulator(gauss.compile_scene(scene), step=1e-3)
    simulator.step(n=100)
    reached = simulator.coordinates
    simulator.reset()
    with pytest.raises(SimulationError, match="not finite"):
        simulator.step(n=200)
    assert simulator.t == pytest.approx(0.1)
    for found, expected in zip(simulator.coordinates, reached, strict=True):
        np.testing.assert_allclose(found, expected, rtol=TIERS, atol=TIERS)  # the code may be optimised meanwhile
