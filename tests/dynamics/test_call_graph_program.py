"""Compiled loops of large scenes with loops against the same motions stepped by Python, and functions against bodies."""

import numpy as np
import pytest

import gauss
from gauss import math
from gauss.codegen import Kernel
from gauss.dynamics.call_graph_program import CallGraphProgram
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.rules import Plan
from gauss.dynamics.traced_system import Program
from tests.dynamics.test_call_graph import consistent_state
from tests.dynamics.test_tree_program import SAME_ENERGY, SAME_MOTION

pytestmark = pytest.mark.slow

SAME_STATE = 1e-11  # relative: both are regularised alike, and rounded otherwise
BY_PYTHON = Plan("Python loop", "call graph")
METHODS = {
    "dop853": {"rtol": 1e-10, "times": np.linspace(0.0, 0.02, 5)},
    "rk4": {"step": 1e-3, "times": [0.0015, 0.02]},
    "dopri5": {"rtol": 1e-10, "times": [0.02], "stabilisation": "baumgarte"},
}
SMALL = {
    "four-bar": lambda: gauss.load("four_bar"),
    "bricard": lambda: gauss.load("bricard"),
    "stewart": lambda: gauss.load("stewart_platform"),
    "hung chain": lambda: gauss.load("hung_chain", n=12),
}


def _ladder() -> gauss.Scene:
    scene = gauss.load("n_four_bar", n=43)
    scene.drive("A0", torque=lambda t: 3.0 * math.sin(t))
    scene.force("wind", list(scene.bodies)[3], force=lambda t: (math.sin(t), 0.2, 0.0))
    scene.joint_spring("rub", "A1", stiffness=0.5, damping=0.3)
    return scene


@pytest.mark.parametrize("method", METHODS)
def test_compiled_loops_of_scenes_with_many_loops_move_like_loops_of_python(method):
    system = gauss.compile_scene(_ladder())
    compiled, stepped = (
        gauss.simulate(system, 0.02, integrator=method, progress=False, plan=plan, **METHODS[method])
        for plan in (None, BY_PYTHON)
    )
    assert (compiled.stats.plan.driver, compiled.stats.plan.dynamics) == ("compiled loop", "call graph")
    assert compiled.stats.handed_over is None and stepped.stats.handed_over is None
    for name in ("t", "q", "v", "work"):
        found, expected = getattr(compiled, name), getattr(stepped, name)
        assert np.abs(found - expected).max() <= SAME_MOTION * max(1.0, np.abs(expected).max()), name


@pytest.mark.parametrize("name", SMALL)
def test_functions_of_loops_are_those_of_the_code_that_is_written_out(name):
    """Rates, projection and energies; potential energies but for a constant."""
    system = gauss.compile_scene(SMALL[name]())
    graph, whole = (kind(system, Laws(system)) for kind in (CallGraphProgram, Program))
    projected, expected, check = (
        Kernel(function, batch=False) for function in (graph.projected_rates, whole.projected_rates, graph.point_check)
    )
    rng, n = np.random.default_rng(0), system.n_q + 2 * system.n_v + 3  # the call graph states no singularity
    offsets = []
    for start in (consistent_state(system, seed) for seed in (1, 2)):
        state = np.concatenate([[0.0], start.q, start.v])
        found, known = projected(state)[:n], expected(state)[:n]
        assert np.abs(found - known).max() <= SAME_STATE * np.abs(known).max()
        point = np.concatenate([state, rng.standard_normal(3), known[system.n_q + system.n_v :]])
        error, _, *energies = check(point)
        kinetic, potential, total, _ = np.array(energies) - whole.energies(point)
        scale = whole.energies(point)[0] + whole.energies(point)[3]
        assert error <= SAME_STATE and abs(kinetic) <= SAME_ENERGY * scale
        offsets += [potential, total]
    assert np.ptp(offsets) <= 2 * SAME_ENERGY * scale
