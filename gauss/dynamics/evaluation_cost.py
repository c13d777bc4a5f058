"""Cost of an evaluation of the accelerations along a motion, by a rule: c = c₀ + c₁ n for n bodies.

The constants are measured on one core (``python -m benchmarks.cliffs``) and rounded to a digit; they tell routes apart, and
do not predict the time of a motion.
"""

import warnings

from gauss.dynamics.laws.traced_laws import Laws, needs_poses
from gauss.dynamics.rules import Plan, Rejected, reasons_in_words
from gauss.dynamics.store import cached
from gauss.errors import SlowRouteWarning, user_level
from gauss.system import System

CALL, TIMED_CALL = 1e-5, 4e-6  # s, of an evaluation of opaque laws that do little themselves; the same of laws of time
COSTS = {  # s, and s per body, of an evaluation by a driver and a kind of dynamics
    ("compiled loop", "compiled"): (2e-7, 1e-7),
    ("compiled loop", "embedded loops"): (2e-7, 5e-8),
    ("compiled loop", "tree recursion"): (2e-7, 1e-7),
    ("compiled loop", "call graph"): (1e-6, 1e-7),
    ("compiled loop", "callbacks"): (CALL, 1e-7),
    ("Python loop", "compiled"): (1e-4, 4e-6),
    ("Python loop", "tree recursion"): (1e-4, 5e-6),
    ("Python loop", "call graph"): (1e-4, 5e-7),
    ("certified",): (1e-3, 3.5e-4),
    ("state", "compiled"): (3e-6, 1e-7),
    ("state", "embedded loops"): (2e-6, 5e-8),
}
CLIFF = 100.0  # ratio of the costs of the route that is taken and of one that is not, above which a motion warns
LEAST_WASTE = 1.0  # s of estimated cost of a motion below which it does not


def evaluation_cost(system: System, plan: Plan | Rejected) -> float:
    """Estimated cost [s] of an evaluation by a plan; 0 where no rule states it."""
    key = ("certified",) if plan.dynamics == "certified" else (plan.driver, plan.dynamics)
    fixed, per_body = COSTS.get(key, (0.0, 0.0))
    if key == ("compiled loop", "callbacks") and cached(system, (_are_of_time,), lambda: _are_of_time(system)):
        fixed = TIMED_CALL
    return fixed + per_body * system.structure.n_bodies


def _are_of_time(system: System) -> bool:
    """Whether opaque laws take the time alone."""
    return not any(needs_poses(bound.load) for bound in Laws(system).called)


def slowdown(system: System, plan: Plan) -> float:
    """Estimated cost of an evaluation over that of the fastest route that was rejected; 1 if that is not faster."""
    others = [cost for other in plan.rejected if (cost := evaluation_cost(system, other)) > 0.0]
    return max(1.0, evaluation_cost(system, plan) / min(others)) if others else 1.0


def warn_of_slow_route(system: System, plan: Plan, evaluations: int):
    """Warn once for each system of a route that is :data:`CLIFF` times slower than one that an element bars.

    SlowRouteWarning with the elements, the estimated costs, and a remedy.
    """
    ratio, cost = slowdown(system, plan), evaluation_cost(system, plan)
    if ratio < CLIFF or cost * evaluations < LEAST_WASTE:
        return
    text = f"an evaluation takes about {1e6 * cost:.0f} µs, {ratio:.0f} times as long as in the compiled loop"
    reasons = list(dict.fromkeys(reason for rejected in plan.rejected for reason in rejected.why))
    why, is_of_laws = reasons_in_words(reasons), any("law" in reason for reason in reasons)
    remedy = "write laws with gauss.math, so that they are traced" if is_of_laws else "system.explain() lists the routes"

    def warn():
        warnings.warn(f"{system.scene.name!r}: {text}: {why}; {remedy}.", SlowRouteWarning, stacklevel=user_level())

    cached(system, (warn_of_slow_route,), warn)
