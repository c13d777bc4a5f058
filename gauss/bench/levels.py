"""What is asked of a QP solver: three accuracies as in qpbenchmark, and the finest that it takes."""

from gauss.backends.accuracy import accuracy

LEVELS = {"low": 1e-3, "mid": 1e-6, "high": 1e-9, "tightest": 1e-12}  # absolute tolerances of residuals and gap
OWN = "own"  # level of methods that have no tolerance
LIMIT = 1.0  # [s] of one solve, where a solver can be told so
STOPS = {
    "highs": {"time_limit": LIMIT},
    "osqp": {"time_limit": LIMIT},
    "qpalm": {"time_limit": LIMIT},
    "scs": {"time_limit_secs": LIMIT},
}
# PIQP and ProxQP look at the duality gap only when told to; polishing is what makes OSQP exact.
CHECKS = {"piqp": {"check_duality_gap": True}, "proxqp": {"check_duality_gap": True}}


def settings(solver: str, level: str) -> dict:
    """Settings of a QP solver at a level."""
    chosen = accuracy(solver, LEVELS[level], 0.0) | STOPS.get(solver, {}) | CHECKS.get(solver, {})
    if solver == "ecos":
        chosen["reltol"] = LEVELS[level]  # it refuses none
    if solver == "osqp":
        chosen["polishing"] = level == "tightest"
    return chosen
