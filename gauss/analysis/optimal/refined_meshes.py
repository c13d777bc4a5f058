"""Optimal motions on meshes that are divided until each interval agrees with steps of gauss, and is within the limits."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gauss.analysis.optimal.infeasible import refuse
from gauss.analysis.optimal.limit_excess import LimitExcess, limit_excess, warn_of_excess
from gauss.analysis.optimal.meshes import MeshError, refined, warn_of_passed
from gauss.analysis.optimal.problem import MotionProblem, MotionValues, Solved
from gauss.analysis.optimal.programme import CollocationProgramme
from gauss.analysis.optimal.result import OptimalMotion
from gauss.errors import SimulationError
from gauss.system import State

LIMIT_REFINEMENTS = 4  # refinements for the sake of limits alone, each of which divides intervals by up to four
LIMIT_SHARE = 2.0  # times the tolerance: how far limits may be missed, by motions that have errors of this size


def on_refined_meshes(
    problems: Sequence[MotionProblem], guesses: Sequence[MotionValues], tolerance: float, refinements: int
) -> list[OptimalMotion]:
    """Optimum of all phases on the first meshes that are fine enough.

    SimulationError if there is no optimum, or more refinements are needed.

    Parameters
    ----------
    guesses : sequence of MotionValues
        Motions near the optimum, on the first meshes.
    tolerance : float
        Largest error of an interval, in shares of the units.
    refinements : int
        Most refinements.
    """
    checks = [MeshError(problem.equations) for problem in problems]
    accurate, meshes, iterations = _optima(problems, checks, guesses, tolerance, refinements)
    if not accurate:
        worst, count = max((mesh[-1][1], mesh[-1][0]) for mesh in meshes)
        raise SimulationError(
            f"optimal motion: the mesh error is {worst:.1e} with {count} intervals after {refinements} "
            "refinements; allow more refinements= or a larger tolerance=."
        )
    best = accurate[-1]
    _warn_of_passed(problems, best.samples)
    warn_of_excess(best.excess, LIMIT_SHARE * tolerance)
    each = zip(problems, checks, meshes, strict=True)
    return [_motion(*one, best, k, iterations) for k, one in enumerate(each)]


def _optima(problems, checks, guesses, tolerance: float, refinements: int):
    """Optima on meshes that are fine enough, the last one the best; intervals and error of all meshes; iterations."""
    meshes: list[list[tuple[int, float]]] = [[] for _ in problems]
    iterations, accurate, rows = 0, list[MeshedMotion](), _rows(problems, guesses)
    for _ in range(refinements + 1):
        solved = CollocationProgramme(problems, [guess.mesh for guess in guesses], rows).solve(guesses)
        if not solved.is_optimal:
            if accurate:
                break
            refuse(problems, rows, guesses, solved)
        iterations += solved.iterations
        found = _checked(problems, checks, solved)
        meshes = [[*mesh, (len(own), float(own.max()))] for mesh, own in zip(meshes, found.errors, strict=True)]
        if found.mesh_error <= tolerance:
            accurate.append(found)
            if found.limit_error <= LIMIT_SHARE * tolerance or len(accurate) > LIMIT_REFINEMENTS:
                break
        guesses = _divided(problems, found, tolerance)
    return accurate, meshes, iterations


@dataclass(frozen=True)
class MeshedMotion:
    """Optimum on the meshes of all phases, and its check; each of the lists has an entry for each phase."""

    solved: Solved  # answer of IPOPT
    # times (n + 1,), states (n + 1, n_q + n_v), and inputs (n, 2, n_u) at the ends of the intervals
    samples: list[tuple[np.ndarray, ...]]
    errors: list[np.ndarray]  # error (n,) of each interval
    excess: list[LimitExcess]  # excess of each phase over its limits

    @property
    def mesh_error(self) -> float:
        """Largest error of an interval."""
        return float(max(own.max() for own in self.errors))

    @property
    def limit_error(self) -> float:
        """Largest excess over a limit."""
        return max(own.largest for own in self.excess)


def _checked(problems: Sequence[MotionProblem], checks: Sequence[MeshError], solved: Solved) -> MeshedMotion:
    """An optimum, moved along each interval by steps of gauss."""
    samples, errors, excess = _samples(problems, solved.values), list[np.ndarray](), list[LimitExcess]()
    for problem, check, (t, x, u) in zip(problems, checks, samples, strict=True):
        moved = check.moved(t, x, u)
        errors.append(check.of_intervals(moved, x))
        excess.append(limit_excess(problem, t, moved, u))
    return MeshedMotion(solved, samples, errors, excess)


def _warn_of_passed(problems: Sequence[MotionProblem], samples):
    """Warn of features of laws of time that pass between the points of the meshes."""
    for problem, (t, x, _) in zip(problems, samples, strict=True):
        system = problem.equations.system
        warn_of_passed(system, State(float(t[0]), *np.split(x[0], [system.n_q])), t)


def _rows(problems: Sequence[MotionProblem], guesses: Sequence[MotionValues]) -> list[list[int]]:
    """Independent rows of the constraints of each phase."""
    pairs = zip(problems, guesses, strict=True)
    return [problem.equations.independent_rows(problem.start_time, guess.x[:, 0]) for problem, guess in pairs]


def _divided(problems: Sequence[MotionProblem], found: MeshedMotion, tolerance: float) -> list[MotionValues]:
    """Motions on meshes whose intervals of too large an error are divided; those beyond limits once errors are small."""
    is_accurate, guesses = found.mesh_error <= tolerance, list[MotionValues]()
    for problem, values, errors, excess in zip(problems, found.solved.values, found.errors, found.excess, strict=True):
        beyond = is_accurate * excess.of_intervals / LIMIT_SHARE
        mesh = refined(values.mesh, errors, beyond, tolerance, 2 * problem.stages)
        guesses.append(values.on(mesh, problem.stages))
    return guesses


def _motion(
    problem: MotionProblem, check: MeshError, meshes, best: MeshedMotion, phase: int, iterations: int
) -> OptimalMotion:
    """Motion of a phase."""
    (t, x, u), equations, solved = best.samples[phase], problem.equations, best.solved
    simulated = float(np.abs((check.simulated(t, x[0], u) - x) / equations.units).max())
    q, v = np.split(x, [equations.system.n_q], axis=1)
    errors = float(best.errors[phase].max()), simulated, best.excess[phase].largest
    accuracy = (solved.kkt, solved.residual, *errors, iterations, tuple(meshes))
    return OptimalMotion(problem.system, t, q, v, equations.names, _law(t, u), solved.costs[phase], *accuracy)


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
