"""Equal chains of a function in the lanes of vector registers: found where they are, and rounded as without them."""

from collections.abc import Callable

import numpy as np
import pytest

from gauss import math
from gauss.codegen import Kernel, schedule, write
from gauss.codegen import packed_function as packed_function_module
from gauss.codegen.packed_function import PackedFunction
from gauss.codegen.superword import Packs

pytestmark = pytest.mark.slow

OWN, SHARED, DEPTH = 4, 3, 12  # inputs of a chain, inputs of all chains, operations of a chain
OPERATIONS: tuple[Callable, ...] = (
    lambda x, y, c: x * y + c,
    lambda x, y, c: c * x - y,
    lambda x, y, c: x / (1.0 + y * y) - c,
    lambda x, y, c: math.where(x < c * y, x - c, np.abs(y)),
    lambda x, y, c: np.sqrt(np.abs(x)) + math.maximum(y, c),
    lambda x, y, c: np.sin(x) * np.cos(x) + c * y,
    lambda x, y, c: np.arctan2(x, 1.0 + y * y) + np.exp(-np.abs(c * x)),
    lambda x, y, c: (x < y) * c + x,
    lambda x, y, c: c - x * c * c,
)


def chains(count: int, seed: int, odd: int = 0):
    """Function of chains that meet in a sum, and go on from it; ``odd`` chains have another operation."""
    rng = np.random.default_rng(seed)
    steps = [(rng.integers(len(OPERATIONS)), *rng.integers(SHARED + OWN + k, size=2)) for k in range(DEPTH)]
    back = [(rng.integers(len(OPERATIONS)), *rng.integers(1 + OWN + k, size=2)) for k in range(DEPTH)]
    constants = rng.normal(size=(count, DEPTH))

    def followed(values: list, steps, constants) -> list:
        for (operation, x, y), c in zip(steps, constants, strict=True):
            values.append(OPERATIONS[operation](values[x], values[y], c))
        return values

    def function(x):
        shared, own = x[:SHARED], x[SHARED:].reshape(count, OWN)
        inward = [followed([*own[k], *shared], steps, constants[k]) for k in range(count)]
        for k in range(odd):
            inward[-1 - k].append(inward[-1 - k][-1] * inward[-1 - k][0] - np.sin(shared[0]))
        total = sum((chain[-1] * own[k, 0] for k, chain in enumerate(inward)), shared[0] * shared[1])
        common = math.where(total < 0.0, total * total, np.sqrt(np.abs(total)))
        outward = [followed([common, *own[k]], back, constants[k]) for k in range(count)]
        return np.array([total, common, shared[2], 2.5, *(chain[-1] for chain in outward), *(chain[-1] for chain in inward)])

    seeds = [tuple(SHARED + OWN * k + i for k in range(count)) for i in range(OWN)]
    return write(function, SHARED + OWN * count), seeds


@pytest.mark.parametrize("length", [400, 15], ids=["in one piece", "in pieces"])
@pytest.mark.parametrize("count", [2, 3, 5, 8])
def test_packs_round_like_single_operations(count, length, monkeypatch):
    monkeypatch.setattr(packed_function_module, "PIECE_LENGTH", length)
    for seed in range(6):
        function, seeds = chains(count, seed)
        packed = PackedFunction(function, [seeds], {})
        assert all(len(unit) in (1, count) for unit in packed.packed.units)
        assert any(len(unit) == count for unit in packed.packed.units)
        one, other = Kernel(function, batch=False), Kernel(packed, batch=False)
        x = np.random.default_rng(seed).normal(size=(one.n_in, 20))
        expected = one(x)
        assert np.isfinite(expected).all()
        np.testing.assert_array_equal(other(x), expected)  # columns: inputs and outputs apart
        np.testing.assert_array_equal(other(x[:, 0].copy()), expected[:, 0])


@pytest.mark.slow
@pytest.mark.parametrize("count", [2, 5])
def test_inputs_that_are_numbers_are_constants_of_the_code(count):
    for seed in range(4):
        function, seeds = chains(count, seed)
        fixed = [2, *seeds[1]]  # a shared input, and one of each chain
        order = [k for k in range(len(function.inputs)) if k not in fixed] + fixed
        place = {old: new for new, old in enumerate(order)}
        moved = write(lambda x, f=function, o=order: f.inlined(x[np.argsort(o)]), len(order))
        x = np.random.default_rng(seed).normal(size=len(order))
        numbers = {place[k]: x[place[k]] for k in fixed}
        packed = PackedFunction(moved, [[tuple(place[k] for k in one) for one in seeds]], numbers)
        assert packed.arity == (len(order) - len(fixed), len(moved.outputs))
        found = Kernel(packed, batch=False)(x[: -len(fixed)])
        np.testing.assert_array_equal(found, Kernel(moved, batch=False)(x))


@pytest.mark.parametrize("odd", [0, 1, 2])
def test_operations_that_some_chains_lack_are_left_alone(odd):
    count = 4
    for seed in range(4):
        function, seeds = chains(count, seed, odd)
        scheduled = schedule(function)
        packs = Packs(scheduled, [seeds])
        members = {member.index for pack in packs.packs for member in pack}
        assert len(members) == count * len(packs.packs)  # each in one pack
        assert all(len({(node.op, len(node.operands)) for node in pack}) == 1 for pack in packs.packs)
        x = np.random.default_rng(seed).normal(size=len(function.inputs))
        found = Kernel(PackedFunction(function, [seeds], {}), batch=False)(x)
        np.testing.assert_array_equal(found, Kernel(function, batch=False)(x))


@pytest.mark.parametrize("length", [400, 15], ids=["in one piece", "in pieces"])
@pytest.mark.parametrize(("count", "other"), [(2, 2), (2, 3), (5, 2)])
def test_kinds_of_chains_are_packed_apart(count, other, length, monkeypatch):
    monkeypatch.setattr(packed_function_module, "PIECE_LENGTH", length)
    for seed in range(4):
        (one, own), (two, others) = chains(count, seed), chains(other, seed + 10)
        n = len(one.inputs)

        def both(x, one=one, two=two, n=n):
            found = one.inlined(x[:n])
            return np.concatenate([found, two.inlined(np.concatenate([found[:1], x[n + 1 :]]))])

        function = write(both, n + len(two.inputs))
        kinds = [own, [tuple(n + k for k in places) for places in others]]
        packed = PackedFunction(function, kinds, {})
        assert {len(unit) for unit in packed.packed.units} == {1, count, other}
        x = np.random.default_rng(seed).normal(size=len(function.inputs))
        np.testing.assert_array_equal(Kernel(packed, batch=False)(x), Kernel(function, batch=False)(x))
