"""Motions by :func:`gauss.prepare`: all but the call is done before, as it is for the engines that are compared with it."""

import time
from collections.abc import Iterator

import numpy as np

import gauss
from benchmarks.work_precision.scenes import TimedScene
from gauss.bench.precision import LOST_DISTANCE, REPEATS, TOLERANCES, Attempt, ReferencePositions
from gauss.dynamics.kinematics import kinematics
from gauss.errors import GaussError
from gauss.system import State, System

METHODS = ("dop853", "dopri5", "taylor")
CALLS = 20  # in a timed run: a call takes some microseconds


def name_of(method: str) -> str:
    """Name of a method in the table."""
    return f"{method}, prepared"


def attempts(case: TimedScene, system: System, against: ReferencePositions, patience: float, methods) -> Iterator[Attempt]:
    """Attempts by prepared motions of some methods, with tolerances from coarse to fine."""
    for method in methods:
        for tolerance in TOLERANCES:
            found = _attempt(case, system, method, tolerance, against)
            yield found
            if found.seconds > patience:
                break


def _attempt(case: TimedScene, system: System, method: str, tolerance: float, against: ReferencePositions) -> Attempt:
    name, best = name_of(method), np.inf
    try:
        began = time.perf_counter()
        motion = gauss.prepare(system, case.duration, integrator=method, rtol=tolerance, atol=tolerance)
        first = time.perf_counter() - began
        for _ in range(1 + REPEATS):
            began = time.perf_counter()
            for _ in range(CALLS):
                q, v = motion()
            best = min(best, (time.perf_counter() - began) / CALLS)
    except (GaussError, ArithmeticError) as error:
        return Attempt("gauss", name, tolerance, reason=str(error).split(". ")[0].split("; ")[0][:120])
    placed = kinematics(system, State(case.duration, q[-1], v[-1])).x[: system.structure.n_bodies]
    off = float(np.abs(np.array(placed) - against.positions).max(initial=0.0))
    return Attempt("gauss", name, tolerance, off, best, first, reason="" if off <= LOST_DISTANCE else "lost")
