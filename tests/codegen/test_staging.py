"""Functions in two stages: the results are those of functions in one piece, however the code is laid out."""

import numpy as np
import pytest

from gauss.codegen import Kernel, entered, outlined_pieces, staged, write

SAME = 1e-13  # relative: in two stages some sums round in another order
STATES = np.random.default_rng(3).uniform(0.2, 1.5, (6, 9))  # columns of (q, v)


def place(q):
    """Early values: a rotation-like table and its products."""
    sines, cosines = np.sin(q), np.cos(q)
    return [sines * cosines, -sines, np.outer(sines, cosines).sum(axis=0) / (1.0 + q @ q)]


def first(known, v):
    """Later function with operations on early values alone, signs and mixed sums."""
    a, b, c = known
    return a * v - b * (a * c), np.array([a @ v + b @ c])


def second(known, v):
    """Later function that needs early operations that the first does not."""
    a, b, c = known
    return (a * b) * c * v, entered(a / b, v) + v


FUNCTIONS = {"first": (first, (3,)), "second": (second, (3,))}


@pytest.fixture
def in_stages():
    """Early function and later ones."""
    return staged(place, FUNCTIONS, 3, name="place")


@pytest.mark.slow
@pytest.mark.parametrize("name", list(FUNCTIONS))
@pytest.mark.parametrize("length", [2000, 4])
@pytest.mark.parametrize("inlined", [False, True])
def test_stages_compute_what_one_piece_computes(name, length, inlined, in_stages, monkeypatch):
    """By calls in straight-line code and in pieces, and inlined; for one state and for a batch."""
    monkeypatch.setattr(outlined_pieces, "LONGEST_UNCUT", length)
    monkeypatch.setattr(outlined_pieces, "PIECE_LENGTH", length)
    early, later = in_stages
    apply = (lambda f: f.inlined) if inlined else (lambda f: f)
    two = Kernel(write(lambda q, v: apply(later[name])(apply(early)(q), v), 3, 3))
    one = Kernel(write(lambda q, v: FUNCTIONS[name][0](place(q), v), 3, 3))
    expected = one(STATES)
    assert two(STATES) == pytest.approx(expected, rel=SAME)
    assert two(STATES[:, 0]) == pytest.approx(expected[:, 0], rel=SAME)


def test_two_states_keep_their_results_apart(in_stages):
    """Results of one call are read after another call of the same function."""
    early, later = in_stages

    def both(q, v):
        here, there = early(q), early(2.0 * q)
        return later["first"](here, v), later["second"](there, v), later["second"](here, v)

    expected = [[*map(np.ravel, FUNCTIONS[name][0](place(scale * x[:3]), x[3:]))] for x in STATES.T for name, scale in ORDER]
    found = Kernel(write(both, 3, 3))(STATES)
    assert np.concatenate([part for parts in expected for part in parts]) == pytest.approx(found.T.ravel(), rel=SAME)


ORDER = (("first", 1.0), ("second", 2.0), ("second", 1.0))


def test_early_operations_are_evaluated_once(in_stages):
    """The first function has no operation on early values alone but changes of sign, and shares none with the early one."""
    early, later = in_stages
    total = write(lambda q, v: first(place(q), v), 3, 3).operations()
    apart = [early.operations(), later["first"].operations()]
    assert {op: sum(part.get(op, 0) for part in apart) for op in total if op != "neg"} == {
        op: number for op, number in total.items() if op != "neg"
    }
