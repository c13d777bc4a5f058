"""Accuracy as each QP solver names it."""

# Settings that take an absolute tolerance, and those that take a relative one; solvers that are missing have none.
ABSOLUTE = {
    "clarabel": ("tol_feas", "tol_gap_abs"),
    "cvxopt": ("feastol", "abstol"),
    "daqp": ("primal_tol", "dual_tol"),
    "ecos": ("feastol", "abstol"),
    "highs": ("primal_feasibility_tolerance", "dual_feasibility_tolerance"),
    "osqp": ("eps_abs",),
    "piqp": ("eps_abs", "eps_duality_gap_abs"),
    "proxqp": ("eps_abs", "eps_duality_gap_abs"),
    "qpalm": ("eps_abs",),
    "qpax": ("solver_tol",),
    "scs": ("eps_abs",),
}
RELATIVE = {
    "clarabel": ("tol_gap_rel",),
    "cvxopt": ("reltol",),
    "ecos": ("reltol",),
    "osqp": ("eps_rel",),
    "piqp": ("eps_rel", "eps_duality_gap_rel"),
    "proxqp": ("eps_rel", "eps_duality_gap_rel"),
    "qpalm": ("eps_rel",),
    "scs": ("eps_rel",),
}
# HiGHS regularises every QP unless told not to, which costs 4 digits; it refuses tolerances below 1e-10.
# Without its duality gap, ProxQP ends while small unknowns are still off by many times the tolerance.
ALWAYS = {"highs": {"qp_regularization_value": 0.0}, "proxqp": {"check_duality_gap": True}}
FINEST = {"highs": 1e-10}
DEFAULT = 1e-9


def accuracy(solver: str, absolute: float = DEFAULT, relative: float | None = None) -> dict:
    """Settings of a QP solver for a tolerance.

    Parameters
    ----------
    solver : str
        Its name.
    absolute, relative : float
        Tolerances of its residuals; the relative one is the absolute one when not given, and none at 0.
    """
    absolute = max(absolute, FINEST.get(solver, 0.0))
    relative = absolute if relative is None else relative
    settings = dict.fromkeys(ABSOLUTE.get(solver, ()), absolute) | dict.fromkeys(RELATIVE.get(solver, ()), relative)
    return settings | ALWAYS.get(solver, {})
