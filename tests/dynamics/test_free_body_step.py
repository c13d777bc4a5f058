"""Step of free bodies with contacts: machine code takes the steps of Python, and the arrays grow with the contacts."""

import numpy as np
import pytest

import gauss
from benchmarks.free_bodies import bin_of_balls, dominoes, floor, free_body, stack
from gauss.dynamics.contact.compiled_step_memory import LoopOfSteps
from gauss.dynamics.contact.contact_stepper import new_contact_stepper
from gauss.dynamics.contact.free_body_step import FreeBodyStepper
from gauss.dynamics.contact.near_detection import FIRST_ROOM

pytestmark = pytest.mark.slow

STEP = 1e-3  # [s]
SAME_STEP = 1e-9  # coordinates and rates after a step of two solvers, each with laws to 1e-10
SAME_MOTION = 1e-6  # the same after 150 steps


def bouncing() -> gauss.Scene:
    """Balls and capsules that rebound, one on a body that stands still."""
    scene = floor("bouncing")
    for k in range(6):
        free_body(
            scene, f"body {k}", 1e-3, (0.11 * (k % 3), 0.02 * k, 0.08 + 0.16 * (k // 3)), rate=(0.1 * k, 0, -1, 1, 2, 3)
        )
        if k % 2:
            scene.capsule(f"shape {k}", f"body {k}", 0.05, length=0.05)
        else:
            scene.sphere(f"shape {k}", f"body {k}", 0.05)
    scene.body("post", mass=1.0, inertia=(1, 1, 1))
    scene.fixed("stands", "ground", "post", at=(0.35, 0, 0.05))
    scene.box("top", "post", (0.1, 0.1, 0.1), at=(0.35, 0, 0.05))
    scene.contacts_all(friction=0.4, restitution=0.5)
    return scene


SCENES = {
    "stack": lambda: stack(10),
    "dominoes": lambda: dominoes(6),
    "balls": lambda: bin_of_balls(20),
    "bouncing": bouncing,
}


@pytest.fixture(scope="module", params=SCENES)
def system(request):
    return gauss.compile_scene(SCENES[request.param]())


def test_machine_code_and_python_take_the_same_steps(system):
    stepper = new_contact_stepper(system)
    assert isinstance(stepper, FreeBodyStepper)
    state, rows, finished = system.initial_state(), np.empty((1, 4 + system.n_q + system.n_v)), 0
    for _ in range(150):
        known = stepper.known
        by_python = stepper.python_step(state, STEP)
        forces = stepper.known
        stepper.known = known
        begin = np.concatenate([[state.t], state.q, state.v, np.zeros(3)])
        loop = stepper.steps_from(begin, np.array([state.t + STEP]), rows)
        if loop.steps:
            finished += 1
            q, v, work = np.split(rows[0, 1:], [system.n_q, system.n_q + system.n_v])
            np.testing.assert_allclose(q, by_python.q, atol=SAME_STEP)
            np.testing.assert_allclose(v, by_python.v, atol=SAME_STEP)
            np.testing.assert_allclose(work, STEP * by_python.power, atol=SAME_STEP)
            assert np.array_equal(stepper.known.key, forces.key)
            np.testing.assert_allclose(stepper.known.expected, forces.expected, atol=SAME_STEP / STEP)
        else:
            stepper.known = forces
        state = gauss.State(state.t + STEP, by_python.q, by_python.v)
    assert finished > 120


def test_motions_and_events_are_those_of_python(system, monkeypatch):
    def moved():
        return gauss.simulate(system, 0.15, integrator="time_stepping", step=STEP, progress=False)

    found = moved()
    monkeypatch.setattr(FreeBodyStepper, "steps_from", lambda self, *given: LoopOfSteps(0, 0.0, [], False))
    expected = moved()
    np.testing.assert_allclose(found.q, expected.q, atol=SAME_MOTION)
    np.testing.assert_allclose(found.work, expected.work, atol=SAME_MOTION)
    by_python, by_code = (sorted(motion.events, key=lambda event: (event.t, event.gaps)) for motion in (expected, found))
    assert [(one.t, one.kind, one.gaps) for one in by_code] == [(one.t, one.kind, one.gaps) for one in by_python]
    np.testing.assert_allclose([one.loss for one in by_code], [one.loss for one in by_python], atol=SAME_MOTION)


def piles(count: int, apart: float) -> gauss.Scene:
    """Piles of three boxes beside each other, the highest of which slides."""
    scene, edge = floor("piles"), 0.1
    for pile in range(count):
        for k in range(3):
            name, rate = f"box {pile} {k}", (0.3 * (k == 2), 0, 0, 0, 0, 0)
            free_body(scene, name, edge**2 / 6, (apart * pile, 0, edge * (k + 0.5)), rate=rate)
            scene.box(f"cube {pile} {k}", name, (edge,) * 3)
    scene.contacts_all(friction=0.3)
    return scene


@pytest.mark.slow
@pytest.mark.parametrize(("count", "apart", "islands"), [(1, 1.0, 1), (4, 1.0, 4), (4, 0.1, 1)])
def test_islands_are_problems_of_their_own(count, apart, islands):
    """The floor connects nothing; piles that are apart move as each would by itself."""
    system = gauss.compile_scene(piles(count, apart))
    stepper, ends = new_contact_stepper(system), STEP * np.arange(1, 61)
    rows = np.empty((ends.size, 4 + system.n_q + system.n_v))
    first = stepper.python_step(system.initial_state(), STEP)  # machine code leaves the first contact of a kind to Python
    state = gauss.State(STEP, first.q, first.v)
    begin = np.concatenate([[state.t], state.q, state.v, np.zeros(3)])
    done = stepper.steps_from(begin, ends[1:], rows).steps
    assert done == ends.size - 1
    assert stepper.memory.islands == islands
    if apart < 1.0:
        return
    each = rows[done - 1, 1 : 1 + system.n_q].reshape(count, -1)
    each[:, ::7] -= apart * np.arange(count)[:, None]
    np.testing.assert_allclose(each, np.repeat(each[:1], count, axis=0), atol=SAME_STEP)


def test_a_new_stepper_continues_with_all_forces_of_the_last_step():
    """More contacts than it has room for at first: none of their forces is lost."""
    system = gauss.compile_scene(piles(8, 1.0))
    stepper, state = new_contact_stepper(system), system.initial_state()
    for _ in range(3):
        found = stepper.python_step(state, STEP)
        state = gauss.State(state.t + STEP, found.q, found.v)
    known, other = stepper.known, new_contact_stepper(system)
    assert known.key.size > FIRST_ROOM
    other.known = known
    for one, same in zip(other.known, known, strict=True):
        np.testing.assert_array_equal(one, same)
    np.testing.assert_allclose(other.python_step(state, STEP).v, stepper.python_step(state, STEP).v, atol=SAME_STEP)
