"""Contests of long scenes with loops beside shorter ones: time may grow in proportion, and compiling must stay short."""

import os

import numpy as np

import gauss
from gauss.bench.contest import OURS, Competitor, Contest, Goal, difference
from gauss.dynamics.engines.call_graph import CallGraphKernels

TENTH = "a tenth of it"
CALLS = 50  # of an evaluation that is timed


def longer_loops(name: str, small: gauss.Scene, large: gauss.Scene, at_most: float) -> Contest:
    """Accelerations of a scene with loops, one call after another from Python, beside one of a tenth of its bodies."""
    tasks, agreement = {}, 0.0
    for who, scene in ((OURS, large), (TENTH, small)):
        system = gauss.compile_scene(scene)
        state, load = system.initial_state(), _load(system)
        kernels, given = CallGraphKernels(system), np.concatenate([[0.0], state.q, state.v, load])
        tasks[who] = Competitor(lambda kernels=kernels, given=given: [kernels.forward(given) for _ in range(CALLS)], CALLS)
        found, exact = kernels.forward(given)[: system.n_v], gauss.solve(gauss.assemble(system, state, load)).qdd
        agreement = max(agreement, difference(found, exact))
    remarks = "agreement is with the certified solution of the full problem"
    return Contest(f"forward dynamics, one state, {name}", tasks, (Goal(TENTH, 1 / at_most),), agreement, remarks)


def first_accelerations(name: str, small: gauss.Scene, large: gauss.Scene, at_most: float) -> Contest:
    """From a scene with loops to its first accelerations, traced and compiled anew, beside one of a tenth of its bodies."""

    def begin(scene: gauss.Scene) -> np.ndarray:
        kept, os.environ["GAUSS_CACHE"] = os.environ.get("GAUSS_CACHE"), ""
        try:
            system = gauss.compile_scene(scene)
            return system.accelerations(system.initial_state(), _load(system))
        finally:
            os.environ.pop("GAUSS_CACHE")
            if kept is not None:
                os.environ["GAUSS_CACHE"] = kept

    tasks = {OURS: Competitor(lambda: begin(large), is_short=False), TENTH: Competitor(lambda: begin(small), is_short=False)}
    system = gauss.compile_scene(small)
    exact = gauss.solve(gauss.assemble(system, system.initial_state(), _load(system))).qdd
    remarks = "no machine code is taken from disk; agreement is that of the smaller scene with the certified solution"
    work, goals = f"from the scene to its first accelerations, {name}", (Goal(TENTH, 1 / at_most),)
    return Contest(work, tasks, goals, difference(begin(small), exact), remarks)


def _load(system: gauss.System) -> np.ndarray:
    """Generalised forces without which a scene at rest might hardly accelerate."""
    return np.random.default_rng(0).normal(size=system.n_v)
