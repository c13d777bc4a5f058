"""Operations in order: the same values, sums that wait little, sums without products left alone."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import gauss
from gauss.codegen import Function, Graph, as_number, count, schedule, substitute, trace, write
from gauss.dynamics.mechanism import forward_dynamics

ROUNDING = 1e-14  # of a few dozen operations on numbers near 1


def _random_sums(seed: int):
    """Outputs that share sums, differences, negatives and products of the inputs."""

    def function(x):
        rng, known = np.random.default_rng(seed), list(x)
        for _ in range(60):
            a, b = (known[k] for k in rng.integers(len(known), size=2))
            known.append([a + b, a - b, -a, a * b][rng.integers(4)] * 0.5)
        return np.array([*known[-5:], sum(known[::3])])

    return function


@pytest.mark.slow
@given(st.integers(0, 10_000))
def test_values_stay(seed):
    function = _random_sums(seed)
    x = np.random.default_rng(seed).uniform(-1, 1, 4)
    expected = function(x)
    written = write(function, 4)
    ordered = schedule(written)
    values = substitute(np.array(ordered.outputs, dtype=object), ordered.inputs, x)
    found = np.array([as_number(value) for value in values])
    assert np.abs(found - expected).max() <= ROUNDING * max(1.0, np.abs(expected).max())


@pytest.mark.slow
@given(st.integers(0, 10_000))
def test_operands_come_first_and_nothing_twice(seed):
    nodes = schedule(write(_random_sums(seed), 4)).nodes
    places = {node.index: place for place, node in enumerate(nodes)}
    assert len(places) == len(nodes)
    assert all(places[x.index] < places[node.index] for node in nodes for x in node.operands)


def test_what_a_sum_loses_can_still_be_found():
    """Sums without products keep their order: the error of a sum (Møller 1965) is found to the last digit."""

    def lost(x):
        total = x[0] + x[1]
        part = total - x[0]
        return np.array([(x[0] - (total - part)) + (x[1] - part)])

    x = np.array([1.0, 1e-17])
    assert trace(lost, 2, batch=False)(x) == lost(x) == 1e-17


def test_what_a_sum_loses_can_be_added_to_products():
    """Products are small beside what they are added to in a compensated sum of rotations: differences come first."""
    lost = lambda x: np.array([x[2] * x[3] + x[3] * x[4] - ((x[0] + x[1]) - x[0])])  # noqa: E731
    x = np.array([1.0, 3e-3, 2e-3, 0.7, 2.3e-3])
    assert trace(lost, 5, batch=False)(x) == pytest.approx(lost(x), abs=1e-18)


def test_a_sum_of_products_begins_with_what_is_none_and_waits_for_the_last():
    graph = Graph()
    a, b, c, d = graph.symbols("x", 4)
    late = (a * b).sin()
    first, *products = _terms(schedule(Function("sum", [a, b, c, d], [late * c + a * b - d + c * d])).outputs[0])
    assert first.op == "symbol"
    assert "sin" in {x.op for x in products[-1].operands}
    assert len(products) == 3


def _terms(node):
    """Terms of a chain of sums, the first one first."""
    if node.op not in ("add", "sub"):
        return [node]
    inner, term = node.operands if node.operands[1].op == "mul" else node.operands[::-1]
    return [*_terms(inner), term]


@pytest.mark.parametrize("name", ["spatial_tree", "robot:panda"])
def test_dynamics_need_no_more_operations(name):
    system = gauss.compile_scene(gauss.load(name))
    n = system.n_v
    written = write(lambda q, v, f: forward_dynamics(system, q, v, f), system.n_q, n, n)
    before, after = count(written.outputs), count(schedule(written).outputs)
    assert sum(after.values()) <= sum(before.values())
    assert after["neg"] < before["neg"]
