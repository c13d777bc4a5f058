"""Opaque laws beside held inputs, in simulators, prepared motions, batches: the results of the same laws, traced."""

import numpy as np
import pytest

import gauss
from gauss.dynamics.laws.traced_laws import Laws
from gauss.errors import SceneError, SimulationError, StateError

SAME = 1e-12  # of coordinates, rates, outputs: the same operations in another order
DURATION, RATE, STEP = 0.2, 50.0, 1e-3
LIMIT = 5.0  # N, N m
MODELS = ("cart_pole", "four_bar")
pytestmark = pytest.mark.filterwarnings("ignore::gauss.errors.SwitchingWarning")  # opaque laws are evaluated at few points
SMOOTH = ("rk4", "semi_implicit_euler", "time_stepping")
CASES = [(model, method) for model in MODELS for method in SMOOTH] + [("friction_oscillator", "time_stepping")]


def with_boxes(scene: gauss.Scene, at: float = 5.0) -> gauss.Scene:
    """The scene with a box on its last body beside a wall: more operations of contacts than are written out."""
    scene.box("plate", list(scene.bodies)[-1], (0.1, 0.1, 0.1))
    scene.box("wall", "ground", (0.2, 2.0, 2.0), at=(at, 0.0, 0.0))
    scene.contact("touch", "plate", "wall", friction=0.2)
    return scene


def systems(model: str, at: float | None = None) -> list[gauss.System]:
    """A system with an opaque law of a rate, and that with the same law, traced; with a wall if its place is given."""

    def made(number) -> gauss.System:
        scene = gauss.load(model) if at is None else with_boxes(gauss.load(model), at)
        hinges = [name for name, joint in scene.joints.items() if joint.pair.n_v == 1]
        scene.input("u", hinges[0], limits=LIMIT)
        scene.drive(hinges[-1], torque=lambda t, at: -0.3 * number(at.rate(hinges[-1])) + 0.1 * number(t))
        body = list(scene.bodies)[-1]
        scene.output("felt", "accelerometer", body)
        scene.output("place", "position", body)
        return gauss.compile_scene(scene)

    opaque, traced = made(float), made(lambda value: value)
    assert Laws(opaque).called and not Laws(traced).called
    return [opaque, traced]


def same(one, other):
    np.testing.assert_allclose(one, other, rtol=SAME, atol=SAME * max(1.0, np.abs(other).max()))


@pytest.mark.slow
@pytest.mark.parametrize("model, method", CASES)
def test_held_inputs(model, method):
    for how in (
        ({"integrator": method, "step": STEP}, {"rtol": 1e-10})
        if method == "rk4"
        else [{"integrator": method, "step": STEP}]
    ):
        run = {"control": lambda t, q, v: 3.0 * np.sin(7.0 * t), "rate": RATE, "times": np.linspace(0.0, DURATION, 5)}
        found, expected = (gauss.simulate(one, DURATION, progress=False, **run, **how) for one in systems(model))
        assert found.stats.plan.dynamics == "callbacks" and expected.stats.plan.dynamics in ("compiled", "embedded loops")
        for part in ("q", "v", "work"):
            same(getattr(found, part), getattr(expected, part))


@pytest.mark.slow
@pytest.mark.parametrize("model, method", CASES)
def test_simulators_batches_and_rollouts(model, method):
    simulators, batches, rollouts = [], [], []
    inputs = np.array([[1.0], [-2.0], [9.0]])
    for system in systems(model):
        simulator = gauss.Simulator(system, step=STEP, integrator=method)
        for k in range(20):
            simulator.step([np.sin(k)])
        simulator.step([2.0], n=30)
        simulators.append([*simulator.coordinates, simulator.output_vector()])
        batch = gauss.SimulatorBatch(system, step=STEP, batch=3, integrator=method)
        batch.step(inputs, n=50)
        batches.append([batch.q, batch.v, batch.output_vectors()])
        start = system.initial_state()
        tiled = np.tile(start.q, (3, 1)), np.tile(start.v, (3, 1))
        found = gauss.rollout(system, *tiled, steps=50, step=STEP, integrator=method, control=inputs[:, None])
        rollouts.append([found.q, found.v, found.output("place")])
        if not system.nonsmooth:
            rollouts[-1].append(found.output("felt"))
        same(found.q[:, -1], batch.q)
        assert len(found.trajectory(1)) == 51
    for kind in (simulators, batches, rollouts):
        for one, other in zip(*kind, strict=True):
            same(one, other)


@pytest.mark.slow
@pytest.mark.parametrize("at, close", [(5.0, SAME), (0.35, 1e-8)])  # a wall out of reach, and one that is hit
def test_contacts_of_many_operations(at, close):
    motions, held, stepped = [], [], []
    control = {"control": lambda t, q, v: 3.0 * np.sin(7.0 * t), "rate": RATE}
    for system in systems("double_pendulum", at):
        motions.append(gauss.simulate(system, 1.0, integrator="time_stepping", step=STEP, progress=False))
        run = {"integrator": "time_stepping", "step": STEP, "progress": False}
        held.append(gauss.simulate(system, DURATION, **run, **control).q)
        simulator = gauss.Simulator(system, step=STEP)
        simulator.step([1.0], n=50)
        kept = simulator.snapshot()
        simulator.step([2.0], n=300)
        reached = np.concatenate([*simulator.coordinates, simulator.output_vector()])
        simulator.restore(kept)
        simulator.step([2.0], n=300)
        assert np.array_equal(np.concatenate([*simulator.coordinates, simulator.output_vector()]), reached)
        stepped.append(reached)
    opaque, traced = motions
    assert opaque.stats.plan.dynamics == traced.stats.plan.dynamics == "pair kernels"
    assert len(opaque.events) == len(traced.events) and bool(opaque.events) == (at < 1.0)
    for one, other in ((opaque.q, traced.q), (opaque.v, traced.v), (opaque.work, traced.work), stepped, held):
        np.testing.assert_allclose(one, other, rtol=close, atol=close * max(1.0, np.abs(other).max()))


@pytest.mark.slow
@pytest.mark.parametrize("model", MODELS)
def test_prepared_motions_and_adaptive_rollouts(model):
    run = {"integrator": "dop853", "rtol": 1e-10, "times": [0.0, 0.07, DURATION]}
    opaque, traced = systems(model)
    q, v = (part.copy() for part in gauss.prepare(opaque, DURATION, **run)())
    expected = gauss.simulate(opaque, DURATION, progress=False, **run)
    np.testing.assert_array_equal(q, expected.q)
    np.testing.assert_array_equal(v, expected.v)
    start = traced.initial_state()
    batch = [gauss.rollout(system, [start.q] * 2, [start.v] * 2, **run) for system in (opaque, traced)]
    same(batch[0].q, batch[1].q)
    same(batch[0].q[0], q)
    with pytest.raises(StateError, match="finite"):
        gauss.prepare(opaque, DURATION)(np.full(opaque.n_q, np.nan), start.v)


def _ending(last: float) -> gauss.System:
    """Cart-pole whose law fails beyond a place of the cart."""
    scene = gauss.load("cart_pole")
    scene.input("push", "rail")

    def law(t, at):
        if float(at.coordinate("rail")) > last:
            raise ValueError("no more")
        return 0.0

    scene.drive("pin", torque=law)
    return gauss.compile_scene(scene)


@pytest.mark.slow
@pytest.mark.parametrize("failed", [lambda: 1 / 0, lambda: np.nan])
def test_a_law_that_fails_beside_contacts_of_many_operations_leaves_the_state_before(failed):
    scene = with_boxes(gauss.load("double_pendulum"))
    scene.drive("A", torque=lambda t, at: 0.1 if float(t) < 0.1 else failed())
    system = gauss.compile_scene(scene)
    simulator = gauss.Simulator(system, step=1e-2)
    simulator.step(n=10)
    reached = simulator.coordinates
    simulator.reset()
    with pytest.raises(SimulationError, match="drive of A"):
        simulator.step(n=200)
    assert simulator.t == pytest.approx(0.1, rel=SAME)
    np.testing.assert_array_equal(simulator.coordinates, reached)
    with pytest.raises(SimulationError, match="drive of A") as caught:
        gauss.simulate(system, 1.0, integrator="time_stepping", step=1e-2, progress=False)
    assert len(caught.value.trajectory) == 11


def test_a_law_that_raises_leaves_a_simulator_as_it_was():
    simulator = gauss.Simulator(_ending(0.1), step=1e-2)
    simulator.step([50.0], n=5)
    before = simulator.snapshot()
    with pytest.raises(SimulationError, match="no more"):
        simulator.step(n=200)
    assert simulator.snapshot() == before and simulator.t == pytest.approx(0.05, rel=SAME)
    simulator.step([-500.0], n=5)
    assert simulator.t == pytest.approx(0.1, rel=SAME)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["rk4", "time_stepping"])
def test_a_law_that_raises_ends_its_own_motion_of_a_batch(method):
    system, steps = _ending(0.1), 50
    inputs = np.array([[50.0], [0.0]])
    batch = gauss.SimulatorBatch(system, step=1e-2, batch=2, integrator=method)
    batch.step(inputs, n=steps)
    assert batch.diverged.tolist() == [True, False] and "no more" in batch.reasons[0]
    start = batch.system.initial_state()
    tiled = np.tile(start.q, (2, 1)), np.tile(start.v, (2, 1))
    found = gauss.rollout(system, *tiled, steps=steps, step=1e-2, integrator=method, control=inputs[:, None])
    assert found.diverged == (0,) and list(found.reasons) == [0] and "no more" in found.reasons[0]
    same(found.q[1, -1], batch.q[1])
    batch.reset()
    assert not batch.reasons and not batch.diverged.any()
    with pytest.raises(SimulationError, match="laws of time or state"):
        batch.restart([0], *(part[:1] for part in tiled))


def test_a_start_where_a_law_raises_is_refused():
    simulator = gauss.Simulator(_ending(0.1), step=1e-2)
    with pytest.raises(SceneError, match="no more"):
        simulator.reset(gauss.State(0.0, np.array([0.5, 0.0]), np.zeros(2)))


@pytest.mark.slow
@pytest.mark.parametrize("method", [{"integrator": "time_stepping", "step": STEP}, {"integrator": "rk4", "step": STEP}, {}])
@pytest.mark.parametrize("failed", [lambda t: [][0], lambda t: None, lambda t: "x", lambda t: 1j])
def test_a_law_that_fails_at_the_start_is_named(failed, method):
    scene = gauss.load("pendulum")
    scene.drive("A", torque=failed, name="broken")
    with pytest.raises(SimulationError, match=r"drive 'broken': at t = 0 s its law") as caught:
        gauss.simulate(scene, DURATION, progress=False, **method)
    assert len(caught.value.trajectory.t) == 1


def test_forces_of_joints_beside_opaque_laws_come_from_reactions():
    opaque, _ = systems("four_bar")
    opaque.scene.output("pull", "joint_force", next(iter(opaque.scene.joints)))
    with pytest.raises(SimulationError, match="opaque laws"):
        gauss.Simulator(gauss.compile_scene(opaque.scene), step=STEP).output_vector()
