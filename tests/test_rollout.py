"""Many motions at once are the same motions."""

import numpy as np
import pytest

import gauss
from gauss.errors import SimulationError, StateError
from gauss.system import random_state
from tests import mechanisms

ROUNDING = 1e-11  # of 50 steps, compiled against certified
SCENES = {
    "arm": lambda: mechanisms.chain([1.0, 2.0, 0.5]),
    "ball": lambda: mechanisms.two_bodies("ball", 3),
    "floating": lambda: gauss.load("free_body"),
    "coupled": lambda: gauss.load("gear_pair"),
    "damped": lambda: gauss.load("cart_pole"),
}


@pytest.mark.parametrize("integrator", ["rk4", "semi_implicit_euler"])
@pytest.mark.parametrize("name", SCENES)
def test_every_motion_of_a_batch_is_the_motion_alone(name, integrator):
    system = gauss.compile_scene(SCENES[name]())
    rng = np.random.default_rng(0)
    starts = [random_state(system, rng, spread=0.5) for _ in range(11)]
    starts = [system.initial_state(s.q, s.v) for s in starts]
    q0, v0 = np.array([s.q for s in starts]), np.array([s.v for s in starts])
    many = gauss.rollout(system, q0, v0, steps=50, step=1e-3, integrator=integrator, every=25)
    assert many.t == pytest.approx([0.0, 0.025, 0.05])
    assert np.array_equal(many.q[:, 0], q0) and np.array_equal(many.v[:, 0], v0)
    for k in (0, 7, 10):
        alone = gauss.simulate(
            system, 0.05, integrator=integrator, step=1e-3, times=many.t, state=starts[k], backend="recursion"
        )
        assert np.abs(many.q[k] - alone.q).max() <= ROUNDING
        assert np.abs(many.v[k] - alone.v).max() <= ROUNDING * max(1.0, np.abs(alone.v).max())


def test_loops_stay_closed_and_laws_are_compiled():
    scene = mechanisms.four_bar()
    scene.drive("A", torque=lambda t: 3.0 * np.sin(5.0 * t))
    system = gauss.compile_scene(scene)
    start = system.initial_state()
    # where a loop is cut is felt as much as the method errs: the step is short enough for that to be rounding
    many = gauss.rollout(system, [start.q] * 3, [start.v] * 3, steps=400, step=2.5e-4, every=100)
    alone = gauss.simulate(system, 0.1, integrator="rk4", step=2.5e-4, times=many.t, backend="recursion")
    assert np.abs(many.q[1] - alone.q).max() <= ROUNDING
    gaps = [gauss.assemble(system, system.state(q)).gap for q in many.q[0]]
    assert np.abs(gaps).max() <= 1e-13


def test_what_cannot_be_rolled_out_says_why():
    scene = mechanisms.rods(1)
    scene.drive("J1", torque=lambda t: 1.0 if t < 0.1 else 0.0)
    with pytest.raises(SimulationError, match="'drive of J1' cannot be traced"):
        gauss.rollout(gauss.compile_scene(scene), [[0.0]], [[0.0]], steps=1, step=1e-3)


@pytest.mark.parametrize(
    "q0, v0, options, words",
    [
        ([0.0], [[0.0]], {}, r"q0: expected finite numbers of shape \(batch, 1\)"),
        ([[0.0]], [[0.0], [1.0]], {}, "as many starts"),
        ([[np.nan]], [[0.0]], {}, "q0: expected finite"),
        ([[0.0]], [[0.0]], {"steps": 0}, "steps: expected a positive"),
        ([[0.0]], [[0.0]], {"integrator": "dop853"}, "for many motions"),
    ],
)
def test_wrong_starts_are_refused(q0, v0, options, words):
    system = gauss.compile_scene(mechanisms.rods(1))
    with pytest.raises((StateError, SimulationError), match=words):
        gauss.rollout(system, q0, v0, **({"steps": 1, "step": 1e-3} | options))


def _braked() -> gauss.Scene:
    scene = mechanisms.rods(2)
    scene.couple("brake", "J2", "J1", 0.0, 0.4)
    return scene


@pytest.mark.parametrize(
    "build, q, v, words",
    [
        (lambda: gauss.load("gear_pair"), [3.0, -1.0], [3.0, -1.5], "coupling 'mesh' is not met, off by 0.5"),
        (_braked, [0.1, 0.3], [1.0, 0.0], r"joint 'J2' is held at \[0.4\] and does not move, off by 0.1"),
        (_braked, [0.1, 0.4], [1.0, 0.2], r"joint 'J2' is held at \[0.4\] and does not move, off by 0.2"),
    ],
)
def test_starts_that_contradict_what_is_not_stepped_are_refused(build, q, v, words):
    system = gauss.compile_scene(build())
    good = system.initial_state(q, v)
    gauss.rollout(system, [good.q], [good.v], steps=2, step=1e-3)
    with pytest.raises(StateError, match=f"in start number 1 {words}"):
        gauss.rollout(system, [good.q, q], [good.v, v], steps=2, step=1e-3)


def test_a_motion_that_leaves_all_bounds_is_counted():
    system = gauss.compile_scene(mechanisms.rods(2))
    with pytest.raises(SimulationError, match="motions diverged, the first is number 1"):
        gauss.rollout(system, np.zeros((3, 2)), [[0.0, 0.0], [1e200, 1e200], [0.0, 0.0]], steps=5, step=1e-3)
