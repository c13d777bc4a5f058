"""Times of a solver: those that its library reports, and those of calls from Python, cold and warm.

The time of a call is its wall time, or the CPU time of its process and of the children of that where this is less by more
than the resolution of its clock: what other processes take of a busy machine is no part of it. It is a tenth of the wall
time at least, so that neither sleep nor work in processes that go on is free.
"""

import multiprocessing
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

import numpy as np

try:
    import resource
except ImportError:  # not a POSIX system
    resource = None  # type: ignore[assignment]  # the module, or none

ROUNDS = 15  # timed calls, fewer when they take long ...
FEWEST = 3  # ... but not fewer than these, as quartiles need them
BUDGET = 0.1  # [s] for them
WALL_PER_CPU = 10.0  # times: wall time of a call that counts as one of CPU time, where less was used
INTERRUPTION = 2e-5  # [s] of wall time beyond CPU time that show other processes; clocks differ by a few microseconds
GRACE = 2.0  # times the limit: a call that takes longer is ended with its process


class Times(NamedTuple):
    """Times [s] that a library reports: of its set-up, of its solve, and of both."""

    setup: float
    solve: float
    total: float


UNKNOWN = Times(np.nan, np.nan, np.nan)


def timed(call: Callable[[], Any], limit: float, compiles: bool = False) -> tuple[list, list[float]]:
    """Results of the calls, and their times [s]: the cold one first, then warm ones.

    A cold call that takes longer than the limit is the only one, unless it ``compiles``, which later ones do not.
    In a worker, a call that takes twice the limit ends with its process.
    """
    found: list = []
    seconds: list[float] = []
    while not seconds or (compiles and len(seconds) == 1) or (len(seconds) <= ROUNDS and seconds[-1] < limit):
        with ended(0.0 if compiles and not seconds else GRACE * limit):
            cpu, begin = cpu_time(), time.perf_counter()
            found.append(call())
            wall = time.perf_counter() - begin
            cpu = cpu_time() - cpu
            seconds.append(max(cpu, wall / WALL_PER_CPU) if wall - cpu > INTERRUPTION else wall)
        if len(seconds) > FEWEST and sum(seconds[1:]) > BUDGET:
            break
    return found, seconds


def cpu_time() -> float:
    """CPU time [s] of the process and of its children that have ended.

    To a microsecond: that of :mod:`time` stands still to 4 ms while a timer of it runs.
    """
    if resource is None:
        return time.process_time()
    used = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(one.ru_utime + one.ru_stime for one in used)


@contextmanager
def ended(limit: float) -> Iterator[None]:
    """End a worker when its block has taken so much CPU time [s], or ten times as much wall time; 0 for no limit.

    SIGPROF and SIGALRM end it, which no library prevents.
    """
    if multiprocessing.parent_process() is None or not hasattr(signal, "setitimer"):
        yield
        return
    timers = {signal.ITIMER_PROF: limit, signal.ITIMER_REAL: WALL_PER_CPU * limit}
    for timer, seconds in timers.items():
        signal.setitimer(timer, seconds)
    try:
        yield
    finally:
        for timer in timers:
            signal.setitimer(timer, 0.0)


def summary(seconds: list[float]) -> dict:
    """Time of the cold call, and quartiles of the warm ones [s]; if there are none, the cold one stands for them."""
    lower, middle, upper = np.quantile(seconds[1:] or seconds, (0.25, 0.5, 0.75))
    return {"cold": seconds[0], "seconds": float(middle), "lower": float(lower), "upper": float(upper)}


def median_times(times: list[Times], seconds: list[float]) -> dict:
    """Medians of the wall times [s] that the library reports of uninterrupted warm calls; nan if there are none.

    A call was interrupted if its library reports more than the time of the call.
    """
    pairs = list(zip(times, seconds, strict=True))
    uninterrupted = [one for one, call in pairs[1:] or pairs if not np.fmax.reduce(one) > call]
    setup, solve, total = np.median(np.array(uninterrupted or [UNKNOWN]), axis=0)
    return {"setup": float(setup), "solve": float(solve), "library": float(total)}


# Solvers whose libraries report no time of their own; that around the call of the library, as qpsolvers takes it, stands
# for it.
TIMED_AROUND = ("cvxopt", "gurobi", "highs", "kvxopt", "qpax", "qtqp", "quadprog", "sip")
COMPILING = ("jaxopt_osqp", "qpax")  # solvers that compile for every size of problem in their first call
UNITS = {"proxqp": 1e-6, "scs": 1e-3}  # of the times that are reported, where these are not seconds


def library(solver: str, problem, settings: dict) -> Callable[[Any], Times]:
    """Times that the library of a solver of qpsolvers reports with a solution."""
    if solver == "daqp":
        return lambda found: _daqp(problem, settings)
    if solver in TIMED_AROUND:
        return lambda found: Times(np.nan, np.nan, found.solve_time if found.x is not None else np.nan)
    if solver == "clarabel":
        return lambda found: Times(np.nan, np.nan, found.extras.get("solve_time", np.nan))
    unit = UNITS.get(solver, 1.0)
    return lambda found: _reported(found, unit)


def _reported(found, unit: float) -> Times:
    info = found.extras.get("info", found.extras)
    if "timing" in info if isinstance(info, dict) else False:  # ECOS
        setup, solve = info["timing"]["tsetup"], info["timing"]["tsolve"]
    elif isinstance(info, dict):
        setup, solve = (unit * info.get(name, np.nan) for name in ("setup_time", "solve_time"))
    else:
        setup, solve = unit * info.setup_time, unit * (info.solve_time + getattr(info, "polish_time", 0.0))
    return Times(setup, solve, setup + solve)


def _daqp(problem, settings: dict) -> Times:
    """DAQP reports its times, but qpsolvers does not hand them on: it is asked once more."""
    info = asked_daqp(problem, settings)[3]
    return Times(info["setup_time"], info["solve_time"], info["setup_time"] + info["solve_time"])


DAQP = {-1: "infeasible", -2: "cycles", -3: "unbounded", -4: "iteration limit", -5: "nonconvex", -6: "working set dependent"}


def asked_daqp(problem, settings: dict) -> tuple:
    """Result of DAQP itself for a problem of qpsolvers: x, objective, exit flag, information."""
    import daqp

    rows = np.vstack([part for part in (problem.G, problem.A) if part is not None])
    upper = np.concatenate([part for part in (problem.h, problem.b) if part is not None])
    sense = np.zeros(upper.size, dtype=np.intc)
    sense[0 if problem.h is None else problem.h.size :] = 5  # an equality
    return daqp.solve(problem.P, problem.q, rows, upper, np.full(upper.size, -1e30), sense, **settings)


def status_and_iterations(found) -> tuple[str, int]:
    """Status text and iterations of a solver, from a solution of qpsolvers; "" and 0 where it reports none."""
    extras = found.extras
    info = extras.get("info", extras) if isinstance(extras, dict) else {}
    look = info.get if isinstance(info, dict) else lambda name, default=None: getattr(info, name, default)
    status = extras.get("status", look("status", look("infostring", ""))) if isinstance(extras, dict) else ""
    iterations = look("iterations", look("iter", 0))
    try:
        return str(status or ""), int(np.max(np.asarray(iterations)))
    except (TypeError, ValueError):
        return str(status or ""), 0
