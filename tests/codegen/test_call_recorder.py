"""Computations that repeat: calls from a table give what plain Python gives, and each form is traced once."""

import numpy as np
import pytest

from gauss.codegen.kernels import CallRecorder, Vector
from gauss.rotations import about_z, cross

ROUNDING = 1e-15


def _run(build, numbers):
    """What a recorder of calls finds for some inputs; how many functions it traced."""
    cells = CallRecorder()
    given = cells.keep(np.zeros(len(numbers)))
    cells.section("all")
    found = Vector(cells.array(build(cells, given)))
    memory = cells.compiled()
    Vector(given).write(memory, numbers)
    memory.run("all")
    return found.read(memory), cells


def _turned(angle, vector):
    return about_z(angle[0]) @ vector, about_z(angle[0])


def test_a_function_is_called_in_many_places_and_traced_once():
    numbers = np.random.default_rng(0).normal(size=13)

    def build(cells, given):
        vector = cells.operand(given[:3])
        for k in range(3, 13):
            vector, _ = cells.call("turn", _turned, given[k : k + 1], vector)
        return vector

    found, cells = _run(build, numbers)
    expected = about_z(numbers[3:].sum()) @ numbers[:3]
    assert np.abs(found - expected).max() <= 10 * ROUNDING * np.abs(expected).max()
    assert len(cells.functions) == 1


def test_constants_negatives_and_what_is_passed_on_cost_nothing():
    """The matrix of a turn has two numbers to compute; its transpose, and its product with constants, see that."""

    def build(cells, given):
        _, R = cells.call("turn", _turned, given[:1], np.zeros(3))
        (back,) = cells.call("transpose", lambda R: (R.T,), R)
        (same,) = cells.call("same", lambda x: (np.array([x[0], -x[0], 3.0], dtype=object),), given[:1])
        (found,) = cells.call("product", lambda R, x: (R @ cross(np.array([0.0, 0.0, 1.0]), x),), back, same)
        return found

    found, cells = _run(build, [0.7])
    expected = about_z(0.7).T @ [0.7, 0.7, 0.0]
    assert np.abs(found - expected).max() <= ROUNDING
    turn, product = cells.functions
    assert turn.operations() == {"sin": 1, "cos": 1}
    assert product.operations().get("mul", 0) <= 4  # no product with zero


@pytest.mark.parametrize("shape", [(0,), (3,), (2, 3)])
def test_blocks_keep_their_entries(shape):
    cells = CallRecorder()
    array = np.resize(np.append(cells.keep([1.0, 2.0]), 5.0), shape)
    again = cells.array(cells.operand(array))
    assert again.shape == shape
    cells.section("none")
    memory = cells.compiled()
    np.testing.assert_array_equal(Vector(again).read(memory), np.resize([1.0, 2.0, 5.0], shape).ravel())
    np.testing.assert_array_equal(Vector(array).read(memory), np.resize([1.0, 2.0, 5.0], shape).ravel())


def test_forms_with_other_constants_are_other_functions():
    def build(cells, given):
        first = cells.call("scale", lambda x, k: (x * k,), given, np.array([2.0]))[0]
        second = cells.call("scale", lambda x, k: (x * k,), given, np.array([3.0]))[0]
        return cells.call("sum", lambda a, b: (a + b,), first, second)[0]

    found, cells = _run(build, [1.0])
    assert found == pytest.approx([5.0])
    assert len(cells.functions) == 3
