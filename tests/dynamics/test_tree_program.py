"""Compiled loops of large trees against the same motions stepped by Python, and their energies against those of bodies."""

import numpy as np
import pytest

import gauss
from gauss import math
from gauss.codegen import Kernel
from gauss.dynamics.kernel_program import TreeProgram
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.rules import Plan
from gauss.dynamics.traced_system import Program
from gauss.system import random_state

pytestmark = pytest.mark.slow

SAME_MOTION = 1e-9  # relative: the loops sum in different orders, which changes lengths of steps
SAME_ENERGY = 1e-13  # relative to the magnitude of the potential energy, or the kinetic energy
BY_PYTHON = Plan("Python loop", "tree recursion")
BODIES = 42


def _chain() -> gauss.Scene:
    scene = gauss.load("spatial_chain", n=BODIES)
    scene.drive(list(scene.joints)[1], torque=lambda t: 0.5 * math.sin(t))
    scene.force("wind", list(scene.bodies)[3], force=lambda t: (math.sin(t), 0.2, 0.0))
    return scene


def _tree() -> gauss.Scene:
    scene = gauss.load("random_tree", n=BODIES, seed=2, kinds=("revolute", "ball"))
    scene.spring("spring", list(scene.bodies)[1], "ground", other_at=(3.0, 4.0, 5.0), stiffness=2.0, damping=0.1)
    return scene


SCENES = {"chain": _chain, "tree": _tree}
METHODS = {
    "dop853": {"rtol": 1e-11, "times": np.linspace(0.0, 0.02, 5)},
    "dopri5": {"rtol": 1e-11, "times": [0.02]},
    "rk4": {"step": 1e-3, "times": [0.0015, 0.02]},
}


@pytest.fixture(scope="module", params=SCENES)
def system(request):
    return gauss.compile_scene(SCENES[request.param]())


@pytest.mark.parametrize("method", METHODS)
def test_compiled_loops_of_large_trees_move_like_loops_of_python(system, method):
    compiled, stepped = (
        gauss.simulate(system, 0.02, integrator=method, progress=False, plan=plan, **METHODS[method])
        for plan in (None, BY_PYTHON)
    )
    assert (compiled.stats.plan.driver, compiled.stats.plan.dynamics) == ("compiled loop", "tree recursion")
    assert compiled.stats.handed_over is None
    for name in ("t", "q", "v", "work"):
        found, expected = getattr(compiled, name), getattr(stepped, name)
        assert np.abs(found - expected).max() <= SAME_MOTION * max(1.0, np.abs(expected).max())


def test_energies_of_links_are_those_of_bodies_but_for_a_constant(system):
    laws, rng = Laws(system), np.random.default_rng(0)
    check, bodies = Kernel(TreeProgram(system, laws).point_check, batch=False), Program(system, laws)
    points = [_point(bodies, random_state(system, rng), rng) for _ in range(4)]
    found = np.array([check(point) for point in points])
    expected = np.array([bodies.energies(point) for point in points])
    kinetic, potential, total, magnitude = expected.T
    scale = kinetic + magnitude
    assert (np.abs(found[:, 2] - kinetic) <= SAME_ENERGY * kinetic).all()
    for column, own in ((3, potential), (4, total)):
        offsets = found[:, column] - own
        assert (np.abs(offsets - offsets[0]) <= SAME_ENERGY * (scale + scale[0])).all()


def _point(program: Program, state: gauss.State, rng) -> np.ndarray:
    """Vector of a point of random accelerations and work."""
    return np.concatenate([[state.t], state.q, state.v, rng.standard_normal(program.layout.size - program.layout.row + 3)])
