"""Events of time stepping: the same by the machine code of a scene, by kernels of pairs of shapes, and in Python."""

import numpy as np
import pytest

import gauss
from gauss import Plan
from tests.simulation.test_mechanism_contacts import STEP, arm, driven
from tests.simulation.test_pair_kernel_steps import ball

KERNELS, WRITTEN_OUT, PYTHON = (Plan("time stepping", name) for name in ("pair kernels", "compiled", "certified"))
SAME_LOSS = 1e-6  # relative: forces are found to 1e-10 times 1 + the largest rate, and an impact ends in one step
SCENES = {  # scene, duration [s], step [s], kinds of events
    "bounces": (lambda: ball(0.5, 0.0, 0.2, 0.0), 0.7, STEP, {"impact", "opens", "closes"}),
    "comes to rest": (lambda: ball(0.0, 0.4, 0.0, 1.0), 0.5, STEP, {"holds"}),
    "driven arm": (driven, 0.3, STEP, {"impact", "holds", "slips", "opens"}),
    "tipping box": (lambda: gauss.load("box_on_plane_8"), 0.5, 2e-3, {"impact", "opens", "closes"}),
    "block with a jerk": (lambda: gauss.load("block_on_incline"), 0.8, 5e-3, {"holds", "slips"}),
    "arm that lands": (lambda: arm("arm"), 0.3, STEP, {"impact", "opens", "closes"}),
    "stops": (lambda: gauss.load("double_pendulum_stops"), 1.0, 2e-3, {"impact", "opens"}),
    "stick and slip": (lambda: gauss.load("friction_oscillator"), 2.0, 2e-3, {"holds", "slips"}),
}
WITHOUT_SHAPES = "stops", "stick and slip"  # kernels of pairs of shapes do not move these


def moved(scene: gauss.Scene, end: float, step: float, plan: Plan, times=None) -> gauss.Trajectory:
    return gauss.simulate(scene, end, integrator="time_stepping", step=step, times=times, progress=False, plan=plan)


def listed(motion: gauss.Trajectory) -> list[tuple]:
    return sorted((event.t, event.kind, event.gaps) for event in motion.events)


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_all_routes_find_the_same_events(name):
    make, end, step, kinds = SCENES[name]
    found = moved(make(), end, step, WRITTEN_OUT)
    assert {event.kind for event in found.events} == kinds
    for plan in (PYTHON,) if name in WITHOUT_SHAPES else (PYTHON, KERNELS):
        other = moved(make(), end, step, plan)
        assert listed(found) == listed(other)
        losses = [[event.loss for event in motion.events if event.kind == "impact"] for motion in (found, other)]
        assert losses[0] == pytest.approx(losses[1], rel=SAME_LOSS)


@pytest.mark.slow
@pytest.mark.parametrize("plan", [WRITTEN_OUT, PYTHON])
@pytest.mark.parametrize("times", [[0.7], [0.1, 0.20234, 0.4041]], ids=["end", "beside the steps"])
def test_events_do_not_depend_on_the_samples(plan, times):
    scene = ball(0.5, 0.3, 0.2, 1.0)
    assert listed(moved(scene, 0.7, STEP, plan, times)) == listed(moved(scene, 0.7, STEP, plan))
    assert moved(scene, 0.7, STEP, plan, times).t == pytest.approx(times, abs=0)


def test_impacts_lose_the_energy_of_their_closed_form():
    motion = moved(ball(0.5, 0.0, 0.2, 0.0), 0.45, STEP, WRITTEN_OUT)
    impacts = [event for event in motion.events if event.kind == "impact"]
    fall = np.sqrt(2.0 * 0.2 / 9.81)
    assert [event.t for event in impacts] == pytest.approx([fall, 2.0 * fall], abs=3.0 * STEP)
    assert [event.loss for event in impacts] == pytest.approx(9.81 * 0.2 * 0.75 * 0.25 ** np.arange(2), rel=0.02)


@pytest.mark.slow
def test_opaque_laws_and_held_inputs_have_the_events_of_traced_ones():
    found = {}
    for law in (lambda t: [3.0 * t, 0.0, 0.0], lambda t: [3.0 * float(t), 0.0, 0.0]):
        scene = ball(0.5, 0.3, 0.2, 1.0)
        scene.input("motor", "x", limits=1.0)
        scene.force("wind", "ball", force=law)
        held = {"control": lambda t, q, v: [np.sin(9.0 * t)], "rate": 100.0}
        motion = gauss.simulate(scene, 0.7, integrator="time_stepping", step=STEP, progress=False, **held)
        found[motion.stats.plan.dynamics] = listed(motion)
    assert set(found) == {"compiled", "callbacks"}
    assert found["compiled"] == found["callbacks"] != []
