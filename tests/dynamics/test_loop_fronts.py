"""Loops eliminated at their roots have the multipliers of all loops eliminated together."""

import numpy as np
import pytest

import gauss
from gauss.codegen.kernels import CallRecorder, Vector
from gauss.dynamics.call_graph import CallGraph
from gauss.dynamics.loop_fronts import GROUND, LoopFronts
from gauss.system.elimination_cost import innermost_links
from tests.support.mechanisms import platforms

ROUNDING = 1e-12  # relative; both factorisations are backward stable, S + μ has a condition below 1e3 with this μ
MU = 0.01


def nested_loops(coupled: bool = False) -> gauss.Scene:
    """Pendulum with a loop of links 1, 2, 3 and 4, 5, 6; links 2 and 3 belong to a second one, of links 7 and 8, as well."""
    scene, inner = gauss.Scene("nested loops"), ("ground", 0, 1, 2, 0, 4, 5, 1, 7)
    place = lambda k: np.array([0.3 * k, 0.2 * np.sin(k), 0.1 * np.cos(2 * k)])  # noqa: E731
    names = ["ground" if body == "ground" else f"link{body}" for body in inner]
    for k, below in enumerate(names):
        scene.body(f"link{k}", 1.0 + 0.1 * k, (0.02, 0.03, 0.04), position=place(k))
        joint = scene.revolute if k in (2, 6) else scene.ball
        joint(f"joint{k}", below, f"link{k}", at=place(k - 0.5), **({"axis": (0, 0, 1)} if k in (2, 6) else {}))
    scene.ball("second loop", "link3", "link8", at=place(3.5))
    scene.ball("first loop", "link3", "link6", at=place(3.6))
    if coupled:
        scene.couple("gear", "joint2", "joint6", 0.5)
    return scene


@pytest.mark.parametrize("make", [lambda: platforms(3), nested_loops, lambda: nested_loops(coupled=True)])
def test_multipliers_do_not_depend_on_the_links_at_which_loops_are_eliminated(make):
    system = gauss.compile_scene(make())
    state, recorder = system.initial_state(), CallRecorder()
    (one,) = system.subsystems
    graph = CallGraph(one, recorder, recorder.keep(state.q[one.q]), recorder.keep(np.zeros(one.n_v)))
    inner = dict(zip(graph.rows, innermost_links(one), strict=True))
    assert set(inner.values()) - {GROUND}, "no loop closes beyond the ground"
    rows = sum(map(len, graph.rows.values()))
    gap = recorder.keep(np.random.default_rng(1).standard_normal(rows))
    recorder.section("solved")
    found = []
    for roots in (inner, dict.fromkeys(inner, GROUND)):
        solved = LoopFronts(graph, MU, roots).solve(graph.rows_of(gap))
        found.append(Vector(graph.joined(solved)))
    calls = recorder.compiled()
    calls.run("factor")
    calls.run("solved")
    one, other = (vector.read(calls) for vector in found)
    assert np.abs(one - other).max() <= ROUNDING * np.abs(other).max()
