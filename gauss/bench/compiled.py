"""Time of gauss itself for the same accelerations: the machine code traced for the scene, assembly included."""

import time
from statistics import median

import numpy as np

from gauss.backends.solution import Answer
from gauss.bench.measure import unanswered
from gauss.bench.problems import MechanismProblem
from gauss.bench.reference import ReferenceSolution
from gauss.dynamics.engines.tiering import COMPILE_THRESHOLD
from gauss.errors import GaussError

NAME = "gauss compiled"
CALLS, ROUNDS = 200, 15


def compiled(problem: MechanismProblem, expected: ReferenceSolution) -> dict | None:
    """Time and error of the compiled forward dynamics; None where the problem is not that of a system."""
    if problem.system is None or problem.state is None:
        return None
    row = unanswered()
    try:
        function = problem.system.forward_dynamics
    except GaussError as error:
        return row | {"outcome": "refused", "reason": str(error)}
    q, v, load, out = problem.state.q, problem.state.v, problem.load, np.zeros(problem.system.n_v)
    for _ in range(COMPILE_THRESHOLD):  # later calls use compiled iterative refinement where it cannot confirm its answer
        function(q, v, load, out)
    seconds = []
    for _ in range(ROUNDS):
        begin = time.perf_counter()
        for _ in range(CALLS):
            function(q, v, load, out)
        seconds.append((time.perf_counter() - begin) / CALLS)
    answer = Answer(expected.a, out, np.zeros(problem.compulsion.D.size), np.zeros(0))  # it returns no a of bodies
    off = expected.error(problem.compulsion, answer)
    return row | {"outcome": "answered", "seconds": median(seconds), "error": off, "claimed": True, "reason": "solved"}
