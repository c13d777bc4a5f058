"""Tolerances and limits of QP solvers in the comparison, and what each promises; all else is the default of the solver.

The tolerances are those of qpbenchmark (Caron et al. 2023), a test holds it: absolute ones of the residuals and of the
duality gap, relative ones of zero. Nothing is tuned for any solver. One table, :data:`POLICIES`, says what a solver gets
beside these tolerances, and which residuals its claim of success promises.
"""

import hashlib
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from gauss.backends import BACKENDS
from gauss.backends.accuracy import SMALLEST_TOLERANCE, own_settings, tolerances
from gauss.bench.clocks import WALL_PER_CPU

LEVELS = {"low": 1e-3, "mid": 1e-6, "high": 1e-9, "tightest": 1e-12}  # absolute tolerances of residuals and gap
MAIN_LEVEL = "high"  # of tables, charts and sentences about one level, and of quick comparisons
OWN = "own"  # level of methods that have no tolerance, those of gauss
AUTO = "auto"  # gauss's own choice, with its rescue
OURS = (AUTO, *BACKENDS)
LIMIT = 1.0  # [s] of one solve, by gauss.bench.clocks; later answers do not count, whatever limits a solver takes
# Limit of wall time [s] that libraries get for one solve: so large that on a busy machine the CPU time ends it first.
WALL_LIMIT = WALL_PER_CPU * LIMIT
# Iterations of one solve, so many that the time ends it and not their number: at least the default of every solver of a
# kind.
FIRST_ORDER, ACTIVE_SET, INTERIOR_POINT = 100_000, 10_000, 1_000
LOOSEST = max(LEVELS.values())  # absolute: what rows and stationarity are held to where a solver takes no tolerance of them


class Promise(NamedTuple):
    """Absolute tolerances that a claim of success promises; infinite where it promises none."""

    primal: float  # primal, dual, gap: of the rows, of stationarity, and of the duality gap
    dual: float
    gap: float
    # whether those of rows and stationarity are relative to the norms of data and answer, where these are above one
    relative: bool = False


@dataclass(frozen=True)
class SolverPolicy:
    """Settings of a solver beside the tolerances of qpbenchmark, and the promise of its claim."""

    limits: dict = field(default_factory=dict)  # limits of time and of iterations
    tolerances: tuple[str, ...] = ()  # settings that get the tolerance of the level where qpbenchmark knows none of them
    clock: dict = field(default_factory=dict)  # settings without which a library reports no times
    beyond: tuple[str, ...] = ()  # settings that qpbenchmark leaves at their defaults, but for the limit of iterations
    has_gap: bool = False  # whether it looks at the duality gap
    is_relative: bool = False  # whether its tolerances of rows and stationarity are relative to the norms of data and answer
    has_tolerance: bool = True  # whether it takes a tolerance of residuals at all


# CVXOPT, KVXOPT and ECOS look at the duality gap by tolerances of their own, which follow like those of others. Their
# tolerances of feasibility, and those of Clarabel, QTQP and Fatrop, are of residuals divided by the norms of the data. The
# clocks of PIQP and ProxQP run only if a setting asks for it. Those of HPIPM are tolerances of stationarity, of the
# dynamics, of bounds and of complementarity row by row; Fatrop's is of all of these, scaled. Solvers of MuJoCo have a
# tolerance of second order, of the cost; quadprog, qpOASES and Newton's method of gauss's time stepping have none to set,
# and qpbenchmark sets none for COPT and MOSEK.
POLICIES = {
    "admm": SolverPolicy({"iterations": FIRST_ORDER, "seconds": LIMIT}, ("tolerance",), has_gap=True),
    "clarabel": SolverPolicy(
        {"time_limit": WALL_LIMIT, "max_iter": INTERIOR_POINT}, beyond=("time_limit",), has_gap=True, is_relative=True
    ),
    "copt": SolverPolicy(has_tolerance=False),
    "cvxopt": SolverPolicy({"maxiters": INTERIOR_POINT}, beyond=("abstol", "reltol"), has_gap=True, is_relative=True),
    "daqp": SolverPolicy({"time_limit": WALL_LIMIT, "iter_limit": ACTIVE_SET}, beyond=("time_limit",)),
    "ecos": SolverPolicy(
        {"max_iters": INTERIOR_POINT}, ("reltol",), beyond=("abstol", "reltol"), has_gap=True, is_relative=True
    ),
    "fatrop": SolverPolicy({"max_iter": INTERIOR_POINT}, ("tolerance",), is_relative=True),
    "gauss_seidel": SolverPolicy({"iterations": FIRST_ORDER, "seconds": LIMIT}, ("tolerance",), has_gap=True),
    "gurobi": SolverPolicy({"TimeLimit": WALL_LIMIT}),
    "highs": SolverPolicy({"time_limit": WALL_LIMIT}),
    "hpipm": SolverPolicy({"iter_max": INTERIOR_POINT}, ("res_g_max", "res_b_max", "res_d_max", "res_m_max")),
    "jaxopt_osqp": SolverPolicy({"maxiter": FIRST_ORDER}),
    "kvxopt": SolverPolicy({"maxiters": INTERIOR_POINT}, beyond=("abstol", "reltol"), has_gap=True, is_relative=True),
    "mosek": SolverPolicy(has_tolerance=False),
    "mujoco_cg": SolverPolicy({"iterations": ACTIVE_SET}, has_tolerance=False),
    "mujoco_newton": SolverPolicy({"iterations": ACTIVE_SET}, has_tolerance=False),
    "mujoco_pgs": SolverPolicy({"iterations": ACTIVE_SET}, has_tolerance=False),
    "newton": SolverPolicy(has_tolerance=False),
    "osqp": SolverPolicy({"time_limit": WALL_LIMIT, "max_iter": FIRST_ORDER}, has_gap=True),
    "piqp": SolverPolicy(
        {"max_iter": INTERIOR_POINT}, clock={"compute_timings": True}, beyond=("compute_timings",), has_gap=True
    ),
    "proxqp": SolverPolicy(
        {"max_iter": ACTIVE_SET}, clock={"compute_timings": True}, beyond=("compute_timings",), has_gap=True
    ),
    "pyqpmad": SolverPolicy(),
    "qpalm": SolverPolicy({"time_limit": WALL_LIMIT, "max_iter": ACTIVE_SET}),
    "qpax": SolverPolicy({"max_iter": INTERIOR_POINT}),
    "qpoases": SolverPolicy({"CPUtime": WALL_LIMIT, "nWSR": ACTIVE_SET}, has_tolerance=False),
    "qrqp": SolverPolicy({"max_iter": ACTIVE_SET}, ("constr_viol_tol", "dual_inf_tol")),
    "qtqp": SolverPolicy({"max_iter": INTERIOR_POINT}, has_gap=True, is_relative=True),
    "quadprog": SolverPolicy(has_tolerance=False),
    "scs": SolverPolicy({"time_limit_secs": WALL_LIMIT, "max_iters": FIRST_ORDER}, has_gap=True),
    "sip": SolverPolicy({"time_limit": WALL_LIMIT, "max_iterations": INTERIOR_POINT}, has_gap=True),
    "staggered": SolverPolicy({"iterations": FIRST_ORDER, "seconds": LIMIT}, ("tolerance",), has_gap=True),
}
MUJOCO = ("mujoco_cg", "mujoco_newton", "mujoco_pgs")
OF_ANYBODY = SolverPolicy(has_gap=True)  # of a solver that is not in the table, as one's own


def settings(solver: str, level: str) -> dict:
    """Every setting of a QP solver at a level that is not its default."""
    tolerance, policy = LEVELS[level], POLICIES.get(solver, OF_ANYBODY)
    if solver in MUJOCO:
        return {"tolerance": tolerance**2, **policy.limits}
    chosen = tolerances(solver, tolerance, 0.0) | dict.fromkeys(policy.tolerances, tolerance)
    return chosen | policy.limits | policy.clock


def promise(solver: str, level: str) -> Promise:
    """Promise of a solver's claim of success at a level."""
    policy = POLICIES.get(solver, OF_ANYBODY)
    if not policy.has_tolerance:
        return Promise(LOOSEST, LOOSEST, np.inf)
    tolerance = max(LEVELS[level], SMALLEST_TOLERANCE.get(solver, 0.0))
    return Promise(tolerance, tolerance, tolerance if policy.has_gap else np.inf, policy.is_relative)


def digest_of_settings() -> str:
    """Digest of all settings of all solvers: those of the comparison, and those with which gauss calls them for a user."""
    compared = {(solver, level): sorted(settings(solver, level).items()) for solver in POLICIES for level in LEVELS}
    own = {solver: sorted(own_settings(solver).items()) for solver in POLICIES}
    return hashlib.sha256(repr((compared, own)).encode()).hexdigest()[:12]


def as_qpbenchmark_sets(solver: str, level: str) -> dict:
    """Settings without what the comparison adds to qpbenchmark's, but for limits of iterations."""
    beyond = POLICIES.get(solver, OF_ANYBODY).beyond
    return {name: value for name, value in settings(solver, level).items() if name not in beyond}
