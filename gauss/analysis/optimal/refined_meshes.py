"""Optimal motions on meshes that are divided until each interval agrees with steps of gauss."""

from collections.abc import Sequence

import numpy as np

from gauss.analysis.optimal.infeasible import refuse
from gauss.analysis.optimal.law_mesh import warn_of_passed
from gauss.analysis.optimal.mesh_error import MeshError, refined
from gauss.analysis.optimal.problem import MotionProblem, MotionValues
from gauss.analysis.optimal.programme import CollocationProgramme
from gauss.analysis.optimal.result import OptimalMotion
from gauss.errors import SimulationError
from gauss.system import State


def on_refined_meshes(
    problems: Sequence[MotionProblem], guesses: Sequence[MotionValues], tolerance: float, refinements: int
) -> list[OptimalMotion]:
    """Optimum of all phases on the first meshes that are fine enough.

    Parameters
    ----------
    problems : sequence of MotionProblem
        The phases.
    guesses : sequence of MotionValues
        Motions near the optimum, on the first meshes.
    tolerance : float
        Largest error of an interval, in shares of the units.
    refinements : int
        Most refinements.

    Raises
    ------
    SimulationError
        If there is no optimum, or more refinements are needed.
    """
    meshes: list[list[tuple[int, float]]] = [[] for _ in problems]
    iterations, checks = 0, [MeshError(problem.equations) for problem in problems]
    rows = _rows(problems, guesses)
    for _ in range(refinements + 1):
        solved = CollocationProgramme(problems, [guess.mesh for guess in guesses], rows).solve(guesses)
        if not solved.is_optimal:
            refuse(problems, rows, guesses, solved)
        iterations += solved.iterations
        samples = _samples(problems, solved.values)
        errors = [check.of_intervals(*one) for check, one in zip(checks, samples, strict=True)]
        largest = [float(own.max()) for own in errors]
        meshes = [[*mesh, (len(own), worst)] for mesh, own, worst in zip(meshes, errors, largest, strict=True)]
        if max(largest) <= tolerance:
            _warn_of_passed(problems, samples)
            return [
                _motion(problem, check, one, cost, (solved.kkt, solved.residual, mesh[-1][1]), iterations, tuple(mesh))
                for problem, check, one, cost, mesh in zip(problems, checks, samples, solved.costs, meshes, strict=True)
            ]
        guesses = _divided(problems, solved.values, errors, tolerance)
    worst, count = max((mesh[-1][1], mesh[-1][0]) for mesh in meshes)
    raise SimulationError(
        f"optimal motion: the mesh error is {worst:.1e} with {count} intervals after {refinements} "
        "refinements; allow more refinements= or a larger tolerance=."
    )


def _warn_of_passed(problems: Sequence[MotionProblem], samples):
    """Warn of features of laws of time that pass between the points of the meshes."""
    for problem, (t, x, _) in zip(problems, samples, strict=True):
        system = problem.equations.system
        warn_of_passed(system, State(float(t[0]), *np.split(x[0], [system.n_q])), t)


def _rows(problems: Sequence[MotionProblem], guesses: Sequence[MotionValues]) -> list[list[int]]:
    """Independent rows of the constraints of each phase."""
    pairs = zip(problems, guesses, strict=True)
    return [problem.equations.independent_rows(problem.start_time, guess.x[:, 0]) for problem, guess in pairs]


def _divided(
    problems: Sequence[MotionProblem], found: Sequence[MotionValues], errors: Sequence[np.ndarray], tolerance: float
) -> list[MotionValues]:
    """Motions on meshes whose intervals of too large an error are divided."""
    return [
        values.on(refined(values.mesh, own, tolerance, 2 * problem.stages), problem.stages)
        for problem, values, own in zip(problems, found, errors, strict=True)
    ]


def _motion(
    problem: MotionProblem, check: MeshError, samples, cost: float, accuracy, iterations: int, meshes
) -> OptimalMotion:
    """Motion of a phase."""
    (t, x, u), equations = samples, problem.equations
    simulated = np.abs((check.simulated(t, x[0], u) - x) / equations.units).max()
    q, v = np.split(x, [equations.system.n_q], axis=1)
    reached = (*accuracy, float(simulated), iterations, meshes)
    return OptimalMotion(problem.system, t, q, v, equations.names, _law(t, u), cost, *reached)


def _samples(problems: Sequence[MotionProblem], found: Sequence[MotionValues]) -> list[tuple[np.ndarray, ...]]:
    """Of each phase times (n + 1,), states (n + 1, n_q + n_v), and inputs (n, 2, n_u) at the ends of the intervals."""
    start, samples = problems[0].start_time, list[tuple[np.ndarray, ...]]()
    for problem, values in zip(problems, found, strict=True):
        equations, (low, high) = problem.equations, problem.bounds[2:]
        u = np.clip(values.u * equations.input_units[:, None], low[:, None], high[:, None])  # IPOPT relaxes bounds by 1e-8
        t = start + values.duration * values.mesh
        samples.append((t, values.x.T * equations.units, np.moveaxis(u, 2, 0)))
        start = t[-1]
    return samples


def _law(t: np.ndarray, u: np.ndarray):
    """Inputs as a piecewise polynomial of time."""
    from scipy.interpolate import PPoly

    return PPoly(np.array([(u[:, 1] - u[:, 0]) / np.diff(t)[:, None], u[:, 0]]), t)
