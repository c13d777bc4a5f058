"""Functions cut into pieces: each operation in one piece, nothing needed before it is made, the same numbers as uncut."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import gauss
from gauss.codegen import Kernel, as_number, schedule, trace, write
from gauss.codegen import outlined_pieces as pieces
from gauss.codegen.outlined_pieces import cut, places
from gauss.dynamics.engines.certified import CertifiedEngine

WIDTHS = [1, 7, 33]  # states: one, less than a vector register, vectors and single ones


@pytest.fixture
def short(monkeypatch):
    """Every function is cut, into pieces of a few operations."""
    monkeypatch.setattr(pieces, "LONGEST_UNCUT", 0)
    monkeypatch.setattr(pieces, "PIECE_LENGTH", 4)


def formula(seed: int, size: int = 80):
    """Outputs of random operations on two inputs and on each other; the first is an input, the last a constant."""

    def function(x):
        rng, known = np.random.default_rng(seed), [*x]
        for _ in range(size):
            a, b = (known[k] for k in rng.integers(len(known), size=2))
            known.append(
                [a + b * 0.5, a - b, a * b, np.sin(a) - np.cos(a), a / (b * b + 1.0), np.sin(x[0]) * a][rng.integers(6)]
            )
            known[-1] = known[-1] / (known[-1] * known[-1] + 1.0)  # numbers stay near 1
        return np.array([x[0], *known[-6:], known[rng.integers(len(known))], 2.5], dtype=object)

    return function


@pytest.mark.slow
@given(st.integers(0, 10_000), st.integers(1, 60))
@settings(deadline=None)
def test_every_operation_is_in_one_piece_and_finds_its_operands(seed, length):
    whole = schedule(write(formula(seed), 2))
    parts = cut(whole, length)
    place, size = places(parts)
    inputs, frame, made = {x.index for x in whole.inputs}, [None] * size, []
    for part in parts:
        known = {x.index for x in part.inputs}
        assert all(index in inputs or frame[place[index]] == index for index in known)
        for node in part.nodes:
            assert all(x.index in known for x in node.operands)
            known.add(node.index)
            made += [] if node.is_constant else [node.index]
        for node in part.outputs:
            assert node.index in known
            if node.index in place:
                frame[place[node.index]] = node.index
    operations = [node.index for node in whole.nodes if node.op not in ("constant", "symbol")]
    assert sorted(made) == sorted(operations)
    assert all(len(part.nodes) <= 3 * length + 10 for part in parts)  # constants, and what stays together, on top


@pytest.mark.slow
@given(st.integers(0, 10_000))
@settings(deadline=None)
def test_values_that_live_at_once_have_places_of_their_own(seed):
    parts = cut(schedule(write(formula(seed), 2)), 10)
    place, size = places(parts)
    made = [{x.index for part in parts[:k] for x in part.outputs} for k in range(len(parts))]
    crossing = [found & {x.index for part in parts[k:] for x in part.inputs} for k, found in enumerate(made)]
    assert all(len({place[index] for index in alive}) == len(alive) for alive in crossing)
    assert size >= max(map(len, crossing))


@pytest.mark.parametrize("columns", WIDTHS)
def test_pieces_compute_what_the_whole_computes(columns, short):
    x = np.random.default_rng(0).uniform(-1.0, 1.0, (2, columns))
    found = trace(formula(3), 2)(x)
    expected = np.array([np.broadcast_to(as_number(row) if np.isscalar(row) else row, columns) for row in formula(3)(x)])
    assert np.abs(found - expected.astype(float)).max() <= 1e-14


@pytest.mark.parametrize("columns", WIDTHS)
def test_pieces_call_functions_and_decide(columns, short):
    turned = write(lambda x: [x[0] * np.cos(x[1]), x[0] * np.sin(x[1]), x[0] < x[1]], 2, name="turned")

    def twice(x):
        a, b, less = turned(x[0], x[1])
        c, d, other = turned(a + b, b - 0.25)
        return [c, d, gauss.math.where(less, c + a, d - b), gauss.math.where(other, a, 1.0), less]

    def expected(x):
        one = lambda a, b: (a * np.cos(b), a * np.sin(b), a < b)  # noqa: E731
        a, b, less = one(x[0], x[1])
        c, d, other = one(a + b, b - 0.25)
        return np.array([c, d, np.where(less, c + a, d - b), np.where(other, a, 1.0), less], dtype=float)

    x = np.random.default_rng(1).uniform(-1.0, 1.0, (2, columns))
    assert np.abs(Kernel(write(twice, 2))(x) - expected(x)).max() <= 1e-15


@pytest.mark.slow
def test_a_ladder_moves_by_pieces_as_by_the_certified_recursion(short):
    system = gauss.compile_scene(gauss.load("n_four_bar", n=2))
    run = {"duration": 0.05, "rtol": 1e-10, "progress": False, "times": [0.02, 0.05]}
    fast, slow = gauss.simulate(system, **run), gauss.simulate(system, backend="recursion", **run)
    assert fast.stats.plan.dynamics == "embedded loops" and fast.stats.handed_over is None
    assert np.abs(fast.q - slow.q).max() <= 1e-9
    state = slow.state(1)
    exact = CertifiedEngine().rates(system, state).acceleration
    assert np.abs(system.accelerations(state) - exact).max() <= 1e-12 * np.abs(exact).max()
