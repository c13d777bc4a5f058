"""Every number and name of a mechanism is in the key of its code on disk, and nothing that differs between processes."""

import subprocess
import sys
from collections.abc import Iterator
from copy import copy
from dataclasses import fields, is_dataclass, replace
from enum import Enum
from functools import partial
from importlib import import_module
from pathlib import Path
from types import BuiltinFunctionType, CodeType, FunctionType, MethodType, NoneType

import numpy as np
import pytest

import gauss
from gauss.codegen import Function, content_digest
from gauss.dynamics.plan import method_key
from gauss.integrators import Library
from gauss.simulation.integrators import INTEGRATORS
from gauss.system import System

SHIPPED = sorted(import_module("gauss.io.catalog").shipped())
FAMILIES = {
    "stewart_platform": {},
    "delta_robot": {},
    "n_four_bar": {"n": 3},
    "random_tree": {"n": 6},
    "hung_chain": {"n": 4},
}
NO_CONTENT = {(System, "dynamics")}


def parts(thing) -> list[tuple]:
    """Parts of an object, each with its place; none of a leaf."""
    if is_dataclass(thing) and not isinstance(thing, Function | type):
        return [(f.name, getattr(thing, f.name)) for f in fields(thing) if (type(thing), f.name) not in NO_CONTENT]
    if isinstance(thing, tuple | list):
        return list(enumerate(thing))
    return list(thing.items()) if isinstance(thing, dict) else []


def with_part(thing, place, part):
    """Copy of an object with another part."""
    made = copy(thing)
    if isinstance(thing, tuple):
        changed = [*thing[:place], part, *thing[place + 1 :]]
        return type(thing)(*changed) if hasattr(thing, "_fields") else tuple(changed)
    if isinstance(thing, list | dict):
        made[place] = part
        return made
    made = object.__new__(type(thing))
    for field in fields(thing):
        object.__setattr__(made, field.name, part if field.name == place else getattr(thing, field.name))
    return made


def other(leaf):
    """A value that differs as little as possible."""
    match leaf:
        case bool():
            return not leaf
        case float() | np.floating():
            return type(leaf)(np.nextafter(leaf, np.inf))
        case int():
            return leaf + 1
        case str():
            return leaf + "x"
        case None:
            return 0.0
        case np.ndarray() if leaf.size:
            changed = leaf.copy()
            changed.flat[-1] = other(changed.flat[-1])
            return changed
        case slice():
            return slice(leaf.start, leaf.stop + 1)
        case Function():
            return replace(leaf, outputs=[*leaf.outputs[:-1], 0.1])
        case FunctionType():
            return partial(leaf, 0.1)
        case Enum():
            return next(one for one in type(leaf) if one is not leaf)
        case type():
            return int if leaf is float else float
    return (*leaf, 1.0) if isinstance(leaf, tuple) else {"x": 1.0} if leaf == {} else object()


def changes(thing, kind: tuple = (), seen: set | None = None) -> Iterator[tuple]:
    """The object with one leaf changed, for each kind of place in it: record, field, and kinds of what leads there."""
    seen = set() if seen is None else seen
    for place, part in parts(thing):
        here = (*kind, type(thing), place if is_dataclass(thing) or len(thing) <= 4 else type(place), type(part))
        if parts(part):
            for path, changed in changes(part, here, seen):
                yield path, with_part(thing, place, changed)
        elif here not in seen:
            seen.add(here)
            yield here, with_part(thing, place, other(part))


@pytest.mark.slow
@pytest.mark.parametrize("name, options", [*((name, {}) for name in SHIPPED), *FAMILIES.items()])
def test_a_change_of_any_number_or_name_changes_the_key(name, options):
    system = gauss.compile_scene(gauss.load(name, **options))
    key, seen = content_digest(system), {}
    assert key is not None
    for path, changed in changes(system):
        found = content_digest(changed)
        assert found != key, path
        assert found is None or seen.setdefault(found, path) == path
    assert len(seen) > 40


@pytest.mark.parametrize("name", SHIPPED)
def test_every_leaf_of_every_element_is_in_the_key_to_the_last_place(name):
    scene = gauss.load(name)
    key, elements = content_digest(scene), [part for _, part in parts(scene) if isinstance(part, dict)]
    for named in elements:
        for name, element in list(named.items()):
            changed = [one for _, one in changes(element)]
            found = {content_digest(one) for one in changed}
            assert len(found | {content_digest(element)}) == len(changed) + 1
            named[name] = changed[0]
            assert content_digest(scene) != key
            named[name] = element
    assert content_digest(scene) == key


def test_every_method_of_ours_has_a_key_of_its_own():
    ours = {name: INTEGRATORS[name] for name in INTEGRATORS if not isinstance(INTEGRATORS[name], Library)}
    keys = [content_digest(method_key(method)) for method in ours.values()]
    assert None not in keys and len(set(keys)) == len(keys) > 10
    kinds = [content_digest(kind) for kind in (FunctionType, MethodType, BuiltinFunctionType, CodeType, NoneType, int)]
    assert None not in kinds and len(set(kinds)) == len(kinds)


def test_a_change_of_any_operation_changes_the_key_of_a_function():
    function = gauss.compile_scene(gauss.load("planetary_gears")).relations.function
    key, operations = content_digest(function), [node for node in function.nodes if node.operands]
    for node in operations[:: len(operations) // 20]:
        for field, value in (("op", node.op + "x"), ("operands", node.operands[::-1] + node.operands), ("value", 0.5)):
            kept = getattr(node, field)
            setattr(node, field, value)
            assert content_digest(function) != key, (node, field)
            setattr(node, field, kept)
    assert content_digest(function) == key


def test_code_that_two_functions_share_is_told_from_other_code():
    def twice(first, second):
        return content_digest(first, second)

    one, other = [_closing_over(factor) for factor in (2.0, 3.0)]
    different = lambda t, motion: one(t, motion)  # noqa: E731
    found = [twice(one, other), twice(one, one), twice(other, one), twice(one, different), twice(different, one)]
    assert len(set(found)) == len(found) and twice(_closing_over(2.0), other) == found[0]


@pytest.mark.slow
def test_a_scene_has_one_key_in_all_processes():
    """Neither the seed of hashes nor the order in which settings are given enters."""
    code = """
import sys
import gauss
from gauss.codegen import content_digest
scene = gauss.Scene("s", gravity=(0, 0, -9.81))
settings = {"mass": 1.5, "inertia": (0.1, 0.2, 0.3), "com": (0.1, 0, 0)}
order = reversed(settings) if "reversed" in sys.argv else settings
scene.body("a", **{name: settings[name] for name in order})
scene.revolute("J", "ground", "a")
scene.drive("J", torque=lambda t, motion: 0.2 * t)
for made in (scene, gauss.load("rolling_disk"), gauss.load("newtons_cradle")):
    print(content_digest(gauss.compile_scene(made)).hex())
"""
    where = {"cwd": Path(__file__).parents[2], "capture_output": True, "text": True, "check": True}
    runs = [
        subprocess.run([sys.executable, "-c", code, *arguments], env={"PYTHONHASHSEED": seed, "GAUSS_CACHE": ""}, **where)
        for seed, arguments in (("1", []), ("2", ["reversed"]))
    ]
    assert runs[0].stdout == runs[1].stdout and len(runs[0].stdout.split()) == 3


FACTOR, TABLE = 2.0, {"k": [1.0, 2.0]}


def _of_global(t, motion):
    return FACTOR * t


def _of_table(t, motion):
    return (lambda: TABLE["k"][1] * t)()


def _with_default(t, motion, factor=2.0):
    return factor * t


def _closing_over(factor):
    return lambda t, motion: factor * t


class Unknown:
    def __call__(self, t, motion):
        return t


def _importing(t, motion):
    import math

    return math.pi * t


def _opening(t, motion):
    return open("numbers")


def test_a_law_is_known_by_its_code_and_all_that_it_sees(monkeypatch):
    laws = [_of_global, _of_table, _with_default, _closing_over(2.0), _closing_over(3.0), partial(_with_default, factor=3.0)]
    laws += [lambda t, motion: 2.0 * t, lambda t, motion: 3.0 * t, lambda t, motion: np.sin(t), np.sin]
    keys = [content_digest(law) for law in laws]
    assert None not in keys and len(set(keys)) == len(laws)
    assert content_digest(_closing_over(2.0)) == keys[3]
    monkeypatch.setitem(globals(), "FACTOR", np.nextafter(2.0, 3.0))
    monkeypatch.setitem(TABLE, "k", [1.0, 2.5])
    monkeypatch.setattr(_with_default, "__defaults__", (2.5,))
    assert not {content_digest(law) for law in laws[:3]} & set(keys)


@pytest.mark.parametrize(
    "thing", [Unknown(), _importing, _opening, object(), sys, subprocess.run, iter([1.0]), print.__self__.open]
)
def test_what_is_not_known_has_no_key(thing):
    for holder in (thing, [thing], {"x": thing}, partial(_closing_over, thing), lambda: thing):
        assert content_digest(holder) is None


@pytest.mark.parametrize(
    "one, another",
    [
        ((1.0, 2.0), [1.0, 2.0]),
        (((1.0,), 2.0), (1.0, (2.0,))),
        (("ab", "c"), ("a", "bc")),
        (0.0, -0.0),
        (1, 1.0),
        (1, True),
        (1.0, np.float64(1.0)),
        (np.zeros((2, 3)), np.zeros((3, 2))),
        (np.zeros(2), np.zeros(2, dtype=np.float32)),
        ({"a": 1.0, "b": 2.0}, {"b": 2.0, "a": 1.0}),
        (b"a", "a"),
        (None, "None"),
        (range(3), slice(0, 3, 1)),
    ],
)
def test_things_that_differ_have_different_keys(one, another):
    assert content_digest(one) != content_digest(another)
    assert content_digest(one) == content_digest(copy(one))


def test_a_record_with_more_than_its_fields_has_no_key():
    joint = next(iter(gauss.load("pendulum").joints.values()))
    key = content_digest(joint)
    object.__setattr__(joint, "beside", 1.0)
    assert key is not None and content_digest(joint) is None
