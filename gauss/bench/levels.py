"""Tolerances and limits of QP solvers in the comparison; all other settings are the defaults of the solver.

The tolerances are those of qpbenchmark (Caron et al. 2023), a test holds it: absolute ones of the residuals and of the
duality gap, relative ones of zero. What qpbenchmark does not set is listed in :data:`BEYOND`. Nothing is tuned for any
solver.
"""

from gauss.backends.accuracy import tolerances

LEVELS = {"low": 1e-3, "mid": 1e-6, "high": 1e-9, "tightest": 1e-12}  # absolute tolerances of residuals and gap
MAIN_LEVEL = "high"  # of tables, charts and sentences about one level, and of quick comparisons
OWN = "own"  # level of methods that have no tolerance
LIMIT = 1.0  # [CPU s] of one solve; later answers do not count, whatever limits a solver takes
# Limit of wall time [s] that libraries get for one solve: so large that on a busy machine the CPU time ends it first.
WALL_LIMIT = 10.0 * LIMIT
# Iterations of one solve, so many that the time ends it and not their number: at least the default of every solver of a
# kind.
FIRST_ORDER, ACTIVE_SET, INTERIOR_POINT = 100_000, 10_000, 1_000

TIME_LIMITS = {
    "clarabel": "time_limit",
    "daqp": "time_limit",
    "gurobi": "TimeLimit",
    "highs": "time_limit",
    "osqp": "time_limit",
    "qpalm": "time_limit",
    "qpoases": "CPUtime",
    "scs": "time_limit_secs",
    "sip": "time_limit",
}
ITERATION_LIMITS = {
    "clarabel": ("max_iter", INTERIOR_POINT),
    "cvxopt": ("maxiters", INTERIOR_POINT),
    "daqp": ("iter_limit", ACTIVE_SET),
    "ecos": ("max_iters", INTERIOR_POINT),
    "osqp": ("max_iter", FIRST_ORDER),
    "piqp": ("max_iter", INTERIOR_POINT),
    "proxqp": ("max_iter", ACTIVE_SET),
    "qpalm": ("max_iter", ACTIVE_SET),
    "fatrop": ("max_iter", INTERIOR_POINT),
    "hpipm": ("iter_max", INTERIOR_POINT),
    "jaxopt_osqp": ("maxiter", FIRST_ORDER),
    "kvxopt": ("maxiters", INTERIOR_POINT),
    "qpax": ("max_iter", INTERIOR_POINT),
    "qpoases": ("nWSR", ACTIVE_SET),
    "qrqp": ("max_iter", ACTIVE_SET),
    "qtqp": ("max_iter", INTERIOR_POINT),
    "scs": ("max_iters", FIRST_ORDER),
    "sip": ("max_iterations", INTERIOR_POINT),
}
# Beyond what qpbenchmark sets. CVXOPT, KVXOPT and ECOS look at the duality gap by tolerances of their own, which follow
# like those of others; ECOS refuses a relative one of zero. The clocks of PIQP and ProxQP run only if a setting asks for it.
GAPS = dict.fromkeys(("cvxopt", "ecos", "kvxopt"), ("abstol", "reltol"))
CLOCKS = {"piqp": {"compute_timings": True}, "proxqp": {"compute_timings": True}}
BEYOND = {
    "clarabel": ("time_limit",),
    "daqp": ("time_limit",),
    **GAPS,
    **{solver: tuple(clock) for solver, clock in CLOCKS.items()},
}
# Neither looks at the duality gap; qpOASES has no tolerance of residuals at all. Those of HPIPM are of stationarity, of the
# dynamics, of bounds and of complementarity; Fatrop's is of all of these, scaled.
CASADI = {
    "fatrop": ("tolerance",),
    "hpipm": ("res_g_max", "res_b_max", "res_d_max", "res_m_max"),
    "qrqp": ("constr_viol_tol", "dual_inf_tol"),
}
MUJOCO = ("mujoco_cg", "mujoco_newton", "mujoco_pgs")  # their tolerance is of second order, see gauss.bench.mujoco_
ITERATIVE = ("gauss_seidel", "admm", "staggered")  # solvers of Coulomb's law with a tolerance, see gauss.bench.coulomb


def settings(solver: str, level: str) -> dict:
    """Every setting of a QP solver at a level that is not its default."""
    tolerance = LEVELS[level]
    if solver in MUJOCO:
        return {"tolerance": tolerance**2, "iterations": ACTIVE_SET}
    if solver in ITERATIVE:
        return {"tolerance": tolerance, "iterations": FIRST_ORDER, "seconds": LIMIT}
    chosen = tolerances(solver, tolerance, 0.0) | dict.fromkeys(CASADI.get(solver, ()), tolerance)
    if solver == "ecos":
        chosen["reltol"] = tolerance
    chosen |= {TIME_LIMITS[solver]: WALL_LIMIT} if solver in TIME_LIMITS else {}
    chosen |= dict([ITERATION_LIMITS[solver]]) if solver in ITERATION_LIMITS else {}
    return chosen | CLOCKS.get(solver, {})
