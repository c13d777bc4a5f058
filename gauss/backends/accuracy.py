"""Settings of QP solvers, by the names that the solvers give them: tolerances, and the settings that gauss adds."""

# Names of the settings of absolute and of relative tolerances; solvers that are missing have none.
ABSOLUTE = {
    "clarabel": ("tol_feas", "tol_gap_abs"),
    "cvxopt": ("feastol", "abstol"),
    "daqp": ("primal_tol", "dual_tol"),
    "ecos": ("feastol", "abstol"),
    "gurobi": ("FeasibilityTol", "OptimalityTol"),
    "highs": ("primal_feasibility_tolerance", "dual_feasibility_tolerance"),
    "jaxopt_osqp": ("tol",),
    "kvxopt": ("feastol", "abstol"),
    "osqp": ("eps_abs",),
    "piqp": ("eps_abs", "eps_duality_gap_abs"),
    "proxqp": ("eps_abs", "eps_duality_gap_abs"),
    "qpalm": ("eps_abs",),
    "pyqpmad": ("tolerance",),
    "qpax": ("solver_tol",),
    "qtqp": ("tol_feas", "tol_gap_abs"),
    "scs": ("eps_abs",),
    "sip": ("eps_abs",),
}
RELATIVE = {
    "clarabel": ("tol_gap_rel",),
    "cvxopt": ("reltol",),
    "ecos": ("reltol",),
    "kvxopt": ("reltol",),
    "osqp": ("eps_rel",),
    "piqp": ("eps_rel", "eps_duality_gap_rel"),
    "proxqp": ("eps_rel", "eps_duality_gap_rel"),
    "qpalm": ("eps_rel",),
    "qtqp": ("tol_gap_rel",),
    "scs": ("eps_rel",),
    "sip": ("eps_rel",),
}
SMALLEST_TOLERANCE = {"gurobi": 1e-9, "highs": 1e-10}  # absolute; smaller ones are refused
# Without its duality gap, ProxQP ends while small unknowns are still off by many times the tolerance.
CHECKS = {"piqp": {"check_duality_gap": True}, "proxqp": {"check_duality_gap": True}}
DEFAULT_TOLERANCE = 1e-9  # absolute and relative

# Added when gauss solves a user's problem; the comparison of solvers adds none of it (gauss.bench.levels).
# HiGHS regularises every QP unless told not to, which costs 4 digits. A few iterations of OSQP do for equality rows,
# without over-relaxation; they are looked at as often. Little regularisation of the rows to begin with: PIQP meets
# equality rows in one or two iterations.
OWN: dict[str, dict] = {
    "highs": {"qp_regularization_value": 0.0},
    "osqp": {"max_iter": 20_000, "polishing": True, "alpha": 1.0, "check_termination": 5},
    "piqp": {"delta_init": 1e-8},
}
# The same for workspaces that are kept from call to call. Problems that Clarabel has presolved take no updates. Scaling a
# scaled form again costs OSQP more than a solve. The scaling of one instant serves PIQP for the next, whose numbers are
# nearly the same.
KEPT: dict[str, dict] = {
    "clarabel": {"presolve_enable": False},
    "osqp": {"scaled_forms": ("F2s",)},
    "piqp": {"preconditioner_reuse_on_update": True},
}


def tolerances(solver: str, absolute: float, relative: float | None = None) -> dict:
    """Settings of a QP solver that ask for a tolerance of its residuals and of its duality gap, and nothing else.

    Parameters
    ----------
    solver : str
        Its name.
    absolute, relative : float
        Tolerances; the relative one is the absolute one when not given, and none at 0.
    """
    absolute = max(absolute, SMALLEST_TOLERANCE.get(solver, 0.0))
    relative = absolute if relative is None else relative
    settings = dict.fromkeys(ABSOLUTE.get(solver, ()), absolute) | dict.fromkeys(RELATIVE.get(solver, ()), relative)
    return settings | CHECKS.get(solver, {})


def own_settings(solver: str) -> dict:
    """Settings with which gauss itself calls a QP solver: tolerances of 1e-9, and others that serve its problems."""
    return tolerances(solver, DEFAULT_TOLERANCE) | OWN.get(solver, {})
