"""Cache keys by content: objects of equal content may share machine code, others never do.

A name is no such key, because two objects may share it. Numbers, arrays and records are compared by value. A function is
compared by its code, its attributes, its defaults, the values of its closure, and the values of the globals that it names,
since all of these enter the traced code; of classes and modules of the user, by those of their attributes that it names. A
top-level function of this package does not change and is compared by identity.
"""

import sys
from array import array as TypedArray
from collections import deque
from collections.abc import Callable, Hashable, Iterable, Iterator
from dataclasses import fields, is_dataclass
from functools import cached_property, partial
from types import BuiltinFunctionType, CodeType, FunctionType, MethodType, ModuleType

import numpy as np

from gauss.codegen.source_digest import PACKAGE, closed_over


class IdentityKey:
    """Key by identity. It holds a reference to the object, so that no other object takes its address."""

    __slots__ = ("thing",)

    def __init__(self, thing):
        self.thing = thing

    def __hash__(self) -> int:
        return id(self.thing)

    def __eq__(self, other) -> bool:
        return isinstance(other, IdentityKey) and self.thing is other.thing


def content_key(thing, enclosing: tuple[int, ...] = ()) -> Hashable:
    """Key of an object (record, function, number, array, or a collection of these) by its content.

    ``enclosing`` are the addresses of the objects that contain it: a function may refer to itself.
    """
    kind = type(thing)
    if thing is None or kind in (str, bytes, bool, int, complex, np.bool_):
        return kind, thing
    if kind is float or isinstance(thing, np.number):
        return kind, repr(thing)  # unlike ==, distinguishes −0.0 from 0.0, and NaN equals itself
    if id(thing) in enclosing:
        return "itself", enclosing.index(id(thing))
    inside = (*enclosing, id(thing))
    for kinds, parts in _PARTS:
        if isinstance(thing, kinds):
            return kind, *parts(thing, inside)
    if isinstance(thing, type | ModuleType | BuiltinFunctionType):
        return IdentityKey(thing)
    return kind, *_record(thing, inside)


def _keys(things: Iterable, inside) -> tuple:
    return tuple(content_key(entry, inside) for entry in things)


def _array(array: np.ndarray, inside) -> tuple:
    if array.dtype == object:
        return array.shape, _keys(array.flat, inside)
    return array.dtype.str, array.shape, array.tobytes()


def _record(thing, inside) -> tuple:
    """Fields of a dataclass, or attributes of an object of another package; any other object by identity."""
    is_ours = _is_ours(type(thing))
    if is_dataclass(thing):
        named = [field.name for field in fields(thing)]
        others = {} if is_ours else {name: value for name, value in _attributes(thing).items() if name not in named}
        others = {
            name: value for name, value in others.items() if not isinstance(getattr(type(thing), name, 0), cached_property)
        }
        return *(content_key(getattr(thing, name), inside) for name in named), content_key(others, inside)
    return (IdentityKey(thing),) if is_ours else (IdentityKey(thing), content_key(_attributes(thing), inside))


def _attributes(thing) -> dict:
    """Attributes of an object, in its dictionary or in slots."""
    slots = [name for kind in type(thing).__mro__ for name in np.atleast_1d(vars(kind).get("__slots__", ())).tolist()]
    return {name: getattr(thing, name) for name in slots if hasattr(thing, name)} | getattr(thing, "__dict__", {})


def _function(function: FunctionType, inside) -> tuple:
    if _is_ours(function) and "<locals>" not in function.__qualname__:
        return (IdentityKey(function),)
    closed = [value[0] if value else None for value in closed_over(function)]
    found: dict = {}
    seen: list = []
    if not _is_ours(function):
        found, names = named_globals(function), set(_names(function.__code__))
        seen = [vars(function), *_looked_up([*closed, *found.values()], names, [])]
    parts = (content_key(part, inside) for part in (function.__defaults__, function.__kwdefaults__, closed, found, seen))
    return function.__code__, IdentityKey(function.__globals__), *parts


def _looked_up(things: Iterable, names: set[str], owners: list) -> Iterator[dict]:
    """Attributes that are named, of classes and modules of the user among some objects, and of those among them."""
    for thing in things:
        if isinstance(thing, type | ModuleType) and not (_is_library(thing) or any(thing is owner for owner in owners)):
            found = {name: getattr(thing, name) for name in sorted(names & set(dir(thing)))}
            yield found
            yield from _looked_up(found.values(), names, [*owners, thing])


def _is_library(thing: type | ModuleType) -> bool:
    """Whether a class or a module is of an installed package, or of Python: it does not change."""
    name = thing.__name__ if isinstance(thing, ModuleType) else thing.__module__
    top, file = name.partition(".")[0], getattr(sys.modules.get(name), "__file__", None) or ""
    return top == PACKAGE or top in sys.stdlib_module_names or "site-packages" in file


def named_globals(function: FunctionType) -> dict:
    """Values of the globals named by a function or by one nested in it."""
    names = sorted(set(_names(function.__code__)) & function.__globals__.keys())
    return {name: function.__globals__[name] for name in names}


def _names(code: CodeType):
    yield from code.co_names
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _names(constant)


def _is_ours(thing) -> bool:
    return str(getattr(thing, "__module__", "")).partition(".")[0] == PACKAGE


# content of the kinds of objects that are compared by value
_PARTS: tuple[tuple[type | tuple[type, ...], Callable[..., tuple]], ...] = (
    (np.ndarray, _array),
    ((tuple, list, deque), lambda thing, inside: (_keys(thing, inside),)),
    (bytearray, lambda thing, inside: (bytes(thing),)),
    (TypedArray, lambda thing, inside: (thing.typecode, thing.tobytes())),
    (slice, lambda thing, inside: (content_key((thing.start, thing.stop, thing.step), inside),)),
    ((set, frozenset), lambda thing, inside: (frozenset(_keys(thing, inside)),)),
    (dict, lambda thing, inside: (tuple(_keys(item, inside) for item in thing.items()),)),
    (partial, lambda thing, inside: (_keys((thing.func, thing.args, thing.keywords), inside),)),
    (MethodType, lambda thing, inside: _keys((thing.__func__, thing.__self__), inside)),
    (FunctionType, lambda thing, inside: _function(thing, inside)),
)
