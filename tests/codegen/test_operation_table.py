"""Functions run from a table compute what straight-line code computes, and large ladders move by them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import gauss
from gauss import math
from gauss.codegen import Kernel, emit, trace, write
from gauss.codegen.operation_table import CALL, KINDS, tabulate
from gauss.dynamics import conditions
from gauss.dynamics.conditions import obstacles
from gauss.dynamics.engines.certified import CertifiedEngine
from gauss.dynamics.plan import motion_plan
from gauss.system import random_state
from tests.support import mechanisms

ROUNDING = 1e-14  # of a dozen operations on numbers near 1, fused or not


@pytest.fixture
def tables(monkeypatch):
    """Nothing is compiled in a straight line."""
    run_table, written = emit.run_table, []
    monkeypatch.setattr(emit, "run_table", lambda *given: written.append(given) or run_table(*given))
    monkeypatch.setattr(emit.Writer, "_is_long", lambda writer, nodes: True)
    yield
    assert written


def everything(x):
    a, b = x[0], x[1]
    return [
        a + b * 2.0 - 1.0,
        a * b - b * a * a,
        b - a * a * b,
        -a / b,
        np.sqrt(b) * np.sin(a) + np.cos(a * b),
        np.exp(a) * np.log(b),
        np.arctan2(a, b),
        a**3 - b**-2,
        math.minimum(a, b) - 2.0 * math.maximum(a, b * b),
        math.where(a < b, a * a, b),
        math.where(a <= 0.5, 1.0, a),
        a * b,
        b,
        3.5,
    ]


@pytest.mark.parametrize("columns", [1, 7, 8, 33])
def test_tables_compute_what_numpy_computes(columns, tables):
    kernel = trace(lambda x: everything(x), 2)
    x = np.random.default_rng(0).uniform(0.2, 1.2, (2, columns))
    expected = np.array([np.broadcast_to(row, columns) for row in everything(x)])
    assert np.abs(kernel(x) - expected).max() <= ROUNDING * np.abs(expected).max()
    assert np.abs(kernel(x[:, 0]) - expected[:, 0]).max() <= ROUNDING * np.abs(expected).max()


def test_what_is_no_number_stays_so(tables):
    kernel = trace(lambda x: [x[0] / x[1], np.sqrt(x[0]), math.maximum(x[0], x[1]), x[0] * 0.5 + x[1]], 2)
    x = np.array([[1.0, -1.0, np.nan, np.inf], [0.0, 2.0, 1.0, -np.inf]])
    with np.errstate(all="ignore"):
        expected = [x[0] / x[1], np.sqrt(x[0]), np.fmax(*x), x[0] * 0.5 + x[1]]
    assert np.array_equal(kernel(x), expected, equal_nan=True)


def test_functions_that_call_functions(tables):
    turned = write(lambda x: [x[0] * np.cos(x[1]), x[0] * np.sin(x[1])], 2, name="turned")
    twice = write(lambda x: [*turned(*turned(x[0], x[1])), turned(x[1], 2.0)[0]], 2, name="twice")
    x = np.random.default_rng(0).uniform(0.2, 1.2, (2, 21))
    a, b = x[0] * np.cos(x[1]), x[0] * np.sin(x[1])
    expected = np.array([a * np.cos(b), a * np.sin(b), x[1] * np.cos(2.0)])
    kernel = Kernel(write(lambda x: twice(x[0] + 1.0, x[1])[:2], 2))
    assert np.abs(Kernel(twice)(x) - expected).max() <= ROUNDING
    assert np.abs(kernel(x) - Kernel(twice)(x + [[1.0], [0.0]])[:2]).max() <= ROUNDING


@pytest.mark.slow
@given(st.lists(st.tuples(st.sampled_from("+-*/"), st.floats(0.5, 2.0), st.integers(0, 2)), min_size=1, max_size=40))
@settings(deadline=None)
def test_a_table_holds_every_operation_once_and_after_its_operands(steps):
    def formula(x):
        made = [x[0], x[1]]
        for op, number, use in steps:
            one, other = made[-1], made[-2] if use == 1 else made[0] if use else number
            made.append({"+": one + other, "-": one - other, "*": one * other, "/": one / (other * other + 1.0)}[op])
        return made[2:]

    table = tabulate(write(formula, 2))
    known, place, operands = len(table.constants) + 2, 0, table.operands
    values = [*table.constants, 0.7, -1.3]
    apply = {
        "add": lambda x, y: x + y,
        "sub": lambda x, y: x - y,
        "mul": lambda x, y: x * y,
        "div": lambda x, y: x / y,
        "neg": lambda x: -x,
        "fma": lambda x, y, z: x * y + z,
        "fms": lambda x, y, z: x * y - z,
        "fnma": lambda x, y, z: z - x * y,
    }
    for kind, count in zip(table.runs[::2], table.runs[1::2], strict=True):
        function = apply[KINDS[kind]]
        arity = function.__code__.co_argcount
        for _ in range(count):
            given_ = operands[place : place + arity]
            assert max(given_) < known
            values.append(function(*(values[k] for k in given_)))
            place, known = place + arity, known + 1
    assert place == len(operands) and known == table.size and CALL not in table.runs[::2]
    expected = formula(np.array([0.7, -1.3]))
    assert [values[k] for k in table.outputs] == pytest.approx(list(expected), rel=1e-9, abs=1e-9)


@pytest.mark.slow
def test_a_large_ladder_has_the_certified_accelerations():
    system = mechanisms.ladder(60)
    state, load = system.initial_state(), np.random.default_rng(0).standard_normal(system.n_v)
    expected = CertifiedEngine().rates(system, state, load).acceleration
    assert not obstacles(system)
    assert np.abs(system.accelerations(state, load) - expected).max() <= 1e-11 * np.abs(expected).max()


@pytest.mark.slow
def test_work_grows_with_the_number_of_windows():
    estimated = [sum(part.loop_elimination_work for part in mechanisms.ladder(n).subsystems) for n in (20, 40, 80)]
    written = [system.dynamics.operations(system, system.subsystems) for system in map(mechanisms.ladder, (3, 6, 12))]
    for small, middle, large in (estimated, written):
        assert large - middle == pytest.approx(2 * (middle - small), rel=0.05)


@pytest.mark.slow
def test_loops_that_share_one_long_branch_are_not_written_down():
    scene, previous = gauss.Scene("mast"), "ground"
    for i in range(120):
        body = scene.body(f"b{i}", mass=1.0, inertia=(0.1, 0.1, 0.1), com=(0.1, 0.2, 0.3), on=previous, position=(0, 0, 1))
        scene.ball(f"J{i}", previous, body, at=(0, 0, i))
        previous = body.name
        if i:
            scene.distance(f"stay{i}", f"b{i - 1}", body)
    assert motion_plan(gauss.compile_scene(scene)).dynamics == "certified"


@pytest.mark.slow
@pytest.mark.parametrize("widest", [1000, 1])
def test_motions_by_tables_are_those_of_the_certified_recursion(widest, tables, monkeypatch):
    monkeypatch.setattr(conditions, "WIDEST", widest)
    system = mechanisms.ladder(2)
    run = {"duration": 0.05, "rtol": 1e-10, "progress": False, "times": [0.02, 0.05]}
    fast, slow = gauss.simulate(system, **run), gauss.simulate(system, backend="recursion", **run)
    assert fast.stats.plan.driver == ("compiled loop" if widest > 1 else "Python loop")
    assert fast.stats.handed_over is None
    assert np.abs(fast.q - slow.q).max() <= 1e-9
    assert np.abs([gauss.assemble(system, fast.state(k)).constraint_residual for k in range(2)]).max() <= 1e-10


@pytest.mark.slow
def test_many_motions_by_tables(tables):
    system = gauss.compile_scene(gauss.load("random_tree", n=3, seed=0))
    rng = np.random.default_rng(0)
    states = [random_state(system, rng, spread=0.5) for _ in range(9)]
    many = gauss.rollout(system, [s.q for s in states], [s.v for s in states], steps=20, step=1e-3, every=20)
    alone = gauss.simulate(system, 0.02, integrator="rk4", step=1e-3, times=[0.02], state=states[4], backend="recursion")
    assert np.abs(many.q[4, -1] - alone.q[-1]).max() <= 1e-11
