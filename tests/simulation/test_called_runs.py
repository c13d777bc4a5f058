"""Opaque laws called by machine code: the motions, errors and statistics of the loop in Python."""

import os
import subprocess
import sys
import warnings
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import gauss
from gauss.dynamics.rules import Plan
from gauss.errors import SimulationError, SwitchingWarning

pytestmark = pytest.mark.slow

BY_PYTHON = Plan("Python loop", "compiled")
DURATION = 0.4  # s
RTOL = 1e-9
SAME_MOTION = 1e-5  # of coordinates, rates and work: the local error at a discontinuity is not smaller
SAME_STEPS = 1e-12  # of fixed steps, whose round-off alone differs
ADAPTIVE, FIXED = {"rtol": RTOL}, {"integrator": "rk4", "step": 2e-3}


def _damping(t, at, hinge):
    return -0.3 * float(at.rate(hinge))


def _relay(t, at, hinge):
    return 2.0 if float(at.coordinate(hinge)) > 0.3 else -2.0


def _of_time(t, at, hinge):
    return 1.0 if float(t) < 0.2 else -1.0


def _of_poses(t, at, hinge):
    return float(at.position(next(iter(at.system.frames)))[0])


LAWS = (_damping, _relay, _of_time, _of_poses)
SCENES = ("double_pendulum", "four_bar", "spatial_tree")
LARGE = (  # more bodies and loops than straight-line code takes
    ("n_four_bar", {"n": 50}, "call graph"),
    ("random_tree", {"n": 45, "seed": 1, "kinds": ("revolute", "prismatic")}, "tree recursion"),
)


def _system(name: str, law) -> gauss.System:
    scene = gauss.load(name)
    hinge = next(joint for joint, given in scene.joints.items() if given.pair.n_v == 1)
    scene.drive(hinge, torque=lambda t, at: law(t, at, hinge))
    return gauss.compile_scene(scene)


@pytest.mark.filterwarnings("ignore::gauss.errors.SwitchingWarning")
@pytest.mark.parametrize(
    "name, law", [(SCENES[0], law) for law in LAWS] + [(name, law) for name in SCENES[1:] for law in (_relay, _of_poses)]
)
def test_motions_are_those_of_the_loop_in_python(name, law):
    system = _system(name, law)
    for how, same in ((ADAPTIVE, SAME_MOTION), (FIXED, SAME_STEPS)):
        run = how | {"progress": False, "times": np.linspace(0.0, DURATION, 9)}
        found, expected = (gauss.simulate(system, DURATION, plan=plan, **run) for plan in (None, BY_PYTHON))
        assert (found.stats.plan.driver, found.stats.plan.dynamics) == ("compiled loop", "callbacks")
        for part in ("t", "q", "v", "work"):
            mine, other = getattr(found, part), getattr(expected, part)
            assert np.abs(mine - other).max() <= same * max(1.0, np.abs(other).max())
        assert found.stats.opaque == expected.stats.opaque
        assert found.stats.handed_over is None


@pytest.mark.filterwarnings("ignore::gauss.errors.SwitchingWarning")
@pytest.mark.parametrize("name, options, dynamics", LARGE)
def test_large_scenes_call_their_laws_in_the_compiled_loop(name, options, dynamics):
    scene = gauss.load(name, **options)
    hinge, last = next(joint for joint, given in scene.joints.items() if given.pair.n_v == 1), list(scene.bodies)[-1]
    scene.drive(hinge, torque=lambda t, at: -0.1 * float(at.rate(hinge)))
    scene.force("jet", last, force=lambda t: (float(np.cos(float(t))), 0.0, 0.3))
    system, run = gauss.compile_scene(scene), {"integrator": "rk4", "step": 2e-3, "progress": False}
    found, expected = (gauss.simulate(system, 0.01, plan=plan, **run) for plan in (None, Plan("Python loop", dynamics)))
    assert (found.stats.plan.driver, found.stats.plan.dynamics) == ("compiled loop", dynamics)
    for part in ("q", "v", "work"):
        mine, other = getattr(found, part), getattr(expected, part)
        assert np.abs(mine - other).max() <= SAME_STEPS * max(1.0, np.abs(other).max())


@pytest.mark.parametrize("how", [ADAPTIVE, FIXED])
@pytest.mark.parametrize("last", [-1.0, 0.1])
def test_an_error_of_a_law_ends_the_motion_there(how, last):
    def law(t, at, hinge):
        if t > last:
            raise ValueError("no more")
        return 0.1 * float(at.rate(hinge))

    system = _system("double_pendulum", law)
    for plan in (None, BY_PYTHON):
        with pytest.raises(SimulationError, match="no more") as caught:
            gauss.simulate(system, DURATION, progress=False, plan=plan, **how)
        found = caught.value.trajectory
        assert len(found) and np.isfinite(found.q).all() and max(last - 0.1, 0.0) <= found.t[-1] <= max(last, 0.0) + 1e-9


def test_a_law_may_simulate_and_threads_keep_their_laws_apart():
    def ends(k: int) -> np.ndarray:
        def law(t, at, hinge):
            inner = gauss.simulate(other, 1e-3, progress=False) if t > DURATION / 2 and not seen else None
            seen.extend([] if inner is None else [inner.t[-1]])
            return -0.1 * k * float(at.rate(hinge))

        seen: list[float] = []
        other = _system("pendulum", _damping)
        return gauss.simulate(_system("double_pendulum", law), DURATION, progress=False, **ADAPTIVE).q[-1]

    with ThreadPoolExecutor(3) as pool:
        together = list(pool.map(ends, range(3)))
    assert all((one == ends(k)).all() for k, one in enumerate(together))
    assert len({one.tobytes() for one in together}) == len(together)


PROGRAM = """
import gauss
def law(t, at):
    return -0.3 * float(at.rate(hinge))
scene = gauss.load("four_bar")
hinge = next(iter(scene.joints))
scene.drive(hinge, torque=law)
found = gauss.simulate(scene, 0.1, rtol=1e-9, progress=False)
print(found.stats.plan.dynamics, found.q[-1].tobytes().hex())
"""


def test_a_new_process_with_a_warm_cache_moves_the_same(tmp_path):
    environment = os.environ | {"GAUSS_CACHE": str(tmp_path), "PYTHONPATH": os.pathsep.join(sys.path)}
    run = [sys.executable, "-W", "ignore", "-c", PROGRAM]
    said = [subprocess.run(run, env=environment, capture_output=True, text=True, check=True).stdout for _ in range(2)]
    assert said[0] == said[1] and said[0].startswith("callbacks")


@pytest.mark.parametrize(
    "given", [{"force": lambda t: (np.sin(float(t)), 0.0, 0.0)}, {"moment": lambda t: [0.0, float(t), 1.0]}]
)
def test_the_constant_part_of_an_opaque_force_is_not_taken_for_a_law_of_time(given):
    scene = gauss.load("pendulum")
    scene.force("push", next(iter(scene.bodies)), **given)
    with warnings.catch_warnings():
        warnings.simplefilter("error", SwitchingWarning)
        motion = gauss.simulate(scene, 0.1, step=5e-4, progress=False)
    assert motion.stats.steps >= 200
