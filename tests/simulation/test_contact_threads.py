"""Motions with contacts of one compiled system at once: in threads, and within a control law of another one."""

from threading import Thread

import numpy as np
import pytest

import gauss
from benchmarks.free_bodies import EDGE, floor, free_body, stack

STEP, DURATION, THREADS = 1e-3, 0.2, 4  # [s], [s]
ROUNDING = 1e-12  # a step in which two kinds of shapes meet for the first time is made by Python


def hinged():
    """Box with a hinged flap and a motor, on the floor."""
    scene = floor("box with a flap")
    free_body(scene, "box", EDGE**2 / 6.0, (0.0, 0.0, 0.6 * EDGE))
    scene.box("cube", "box", (EDGE,) * 3)
    scene.body("flap", mass=0.2, inertia=(1e-3,) * 3, position=(EDGE, 0.0, 0.0))
    scene.revolute("hinge", "box", "flap", axis=(0, 1, 0), at=(0.5 * EDGE, 0.0, 0.0))
    scene.joint_spring("damper", "hinge", damping=0.02)
    scene.sphere("tip", "flap", 0.2 * EDGE)
    scene.input("motor", "hinge")
    scene.contacts_all(friction=0.5)
    return scene


def moved(system, **options):
    """Motion by kernels of pairs of shapes."""
    options = {"integrator": "time_stepping", "step": STEP, "progress": False} | options
    return gauss.simulate(system, DURATION, **options)


@pytest.mark.slow
@pytest.mark.parametrize("make", [lambda: stack(3), hinged])
def test_motions_of_one_system_in_threads_are_those_one_after_the_other(make):
    system, plan = gauss.compile_scene(make()), gauss.Plan("time stepping", "pair kernels")
    expected, found = moved(system, plan=plan), list[gauss.Trajectory]()
    threads = [Thread(target=lambda: found.append(moved(system, plan=plan))) for _ in range(THREADS)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(found) == THREADS
    for one in found:
        np.testing.assert_allclose(one.q, expected.q, atol=ROUNDING)
        np.testing.assert_allclose(one.work, expected.work, atol=ROUNDING)


@pytest.mark.slow
def test_a_control_law_may_look_ahead_by_motions_of_the_same_system():
    system = gauss.compile_scene(hinged())

    def torque(t, q, v, ahead: bool):
        if ahead:
            moved(system, control=lambda *at: np.array([0.3]), rate=100.0)
        return np.array([0.1])

    alone, looking = (
        moved(system, control=lambda t, q, v, ahead=ahead: torque(t, q, v, ahead), rate=20.0) for ahead in (False, True)
    )
    np.testing.assert_allclose(alone.q, looking.q, atol=ROUNDING)
