"""Checks of shapes in every test: wrong arrays are refused, right ones pass, names of sizes hold for one call."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pytest
from beartype.roar import BeartypeCallHintViolation

from gauss import rotations
from gauss.backends.compulsion import Compulsion
from gauss.shapes import Shaped
from tests.support.shape_checks import checked

if TYPE_CHECKING:
    from decimal import Decimal

TWO, THREE = np.zeros(2), np.zeros(3)
Sized = Shaped[np.ndarray, " n"]


@checked
def _doubled(a: Sized, factor: float = 2.0) -> Sized:
    return factor * a


@checked
def _cut(a: Sized) -> Sized:
    return a[:-1]


@checked
def _nested(a: Sized, b: Shaped[np.ndarray, " m"]) -> Sized:
    _doubled(b)
    return a


@checked
def _of_a_union(a: Sized, b: Sized | None = None):
    return a if b is None else b


@checked
def _quoted(a: "Sized", unknown: "Decimal | None" = None) -> "Sized":
    return a


@checked
def _yielded(a: Sized) -> Iterator[int]:
    yield from range(len(a))


@checked
def _in_space(a: Shaped[np.ndarray, " 3"] | None = None, R: Shaped[np.ndarray, "3 3"] | None = None):
    return a


@checked
def _plain(count: int):
    return count


@checked
@dataclass
class _Pair:
    a: Sized
    b: Sized

    @checked
    @staticmethod
    def of(a: Sized, b: Sized) -> "_Pair":
        return _Pair(a, b)

    @checked
    @property
    def first(self) -> Shaped[np.ndarray, " 3"]:
        return self.a


RIGHT = {
    "positional": lambda: _doubled(TWO),
    "by name": lambda: _doubled(a=TWO, factor=1.0),
    "sizes of two calls": lambda: (_doubled(TWO), _doubled(THREE)),
    "sizes of a call within a call": lambda: _nested(TWO, THREE),
    "none of a union": lambda: _of_a_union(TWO),
    "in numbers": lambda: _in_space(THREE, np.eye(3)),
    "in numbers, of symbols": lambda: _in_space(THREE.astype(object)),
    "none of a union in numbers": lambda: _in_space(None, np.eye(3)),
    "quoted": lambda: _quoted(TWO, 1),
    "generator": lambda: list(_yielded(TWO)) == [0, 1],
    "dataclass": lambda: _Pair(TWO, TWO),
    "property": lambda: _Pair(THREE, THREE).first,
    "of the package": lambda: rotations.cross(THREE, THREE),
}
WRONG = {
    "no array": lambda: _doubled([1.0]),
    "too many axes": lambda: _doubled(np.zeros((2, 2))),
    "no number": lambda: _doubled(TWO, "2"),
    "what is returned": lambda: _cut(THREE),
    "in numbers": lambda: _in_space(TWO),
    "in numbers, too few axes": lambda: _in_space(THREE, THREE),
    "in numbers, no array": lambda: _in_space([0.0, 0.0, 0.0]),
    "two arguments": lambda: _of_a_union(TWO, THREE),
    "quoted": lambda: _quoted(np.zeros((2, 2))),
    "generator": lambda: next(_yielded(np.zeros((2, 2)))),
    "no shape": lambda: _plain("1"),
    "dataclass": lambda: _Pair(TWO, THREE),
    "static method": lambda: _Pair.of(TWO, THREE),
    "property": lambda: _Pair(TWO, TWO).first,
    "function of the package": lambda: rotations.cross(THREE, TWO),
    "dataclass of the package": lambda: Compulsion(*10 * [np.zeros((2, 2, 2))]),
}


@pytest.mark.parametrize("call", RIGHT.values(), ids=RIGHT)
def test_right_shapes_pass(call):
    assert call() is not False


@pytest.mark.parametrize("call", WRONG.values(), ids=WRONG)
def test_wrong_shapes_are_refused(call):
    with pytest.raises(BeartypeCallHintViolation):
        call()
    _nested(TWO, THREE)  # the sizes of the call that failed are forgotten
