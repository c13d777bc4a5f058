"""Estimated costs of routes, and the warning of a slow one."""

import warnings

import numpy as np
import pytest

import gauss
from gauss.dynamics import evaluation_cost as costs
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.plan import MOTIONS, motion_plan, plan_of
from gauss.dynamics.rules import Question
from gauss.errors import SlowRouteWarning
from gauss.integrators import METHODS
from tests.support import mechanisms

MANY = 10**6  # evaluations


def _opaque(count: int = 2) -> gauss.System:
    scene = mechanisms.rods(count)
    scene.drive("J1", torque=lambda t: np.sin(float(t)))
    return gauss.compile_scene(scene)


def test_every_route_of_smooth_motions_has_a_cost():
    system = gauss.compile_scene(mechanisms.rods(2))
    rules = [rule for rule in MOTIONS.rules if rule.driver in ("compiled loop", "Python loop")]
    assert all(costs.evaluation_cost(system, gauss.Plan(rule.driver, rule.dynamics)) > 0.0 for rule in rules)


def test_a_barred_route_is_faster_and_the_element_is_named_once():
    system = _opaque()
    plan = plan_of(Question(system, Laws(system), method=METHODS["radau5"]))
    assert costs.slowdown(system, motion_plan(system)) < costs.CLIFF <= costs.slowdown(system, plan)
    with pytest.warns(SlowRouteWarning, match="drive of J1"):
        costs.warn_of_slow_route(system, plan, MANY)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        costs.warn_of_slow_route(system, plan, MANY)


def test_fast_routes_short_motions_and_named_backends_warn_of_nothing():
    fast, slow = gauss.compile_scene(mechanisms.rods(2)), _opaque()
    assert costs.slowdown(fast, motion_plan(fast)) == 1.0
    with warnings.catch_warnings():
        warnings.simplefilter("error", SlowRouteWarning)
        costs.warn_of_slow_route(fast, motion_plan(fast), MANY)
        costs.warn_of_slow_route(slow, motion_plan(slow), 1)
        gauss.simulate(fast, 0.01, backend="kkt", integrator="rk4", step=5e-3, progress=False)
