"""Cache keys by content: objects of equal content may share machine code, others never do.

A name is no such key, because two objects may share it. Numbers, arrays and records are compared by value. A function is
compared by its code, its defaults, the values of its closure, and the values of the globals that it names, since all of
these enter the traced code; a top-level function of this package does not change and is compared by identity.
"""

from collections.abc import Callable, Hashable, Iterable
from dataclasses import fields, is_dataclass
from functools import partial
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
    if is_dataclass(thing):
        return tuple(content_key(getattr(thing, field.name), inside) for field in fields(thing))
    if _is_ours(type(thing)) or not hasattr(thing, "__dict__"):
        return (IdentityKey(thing),)
    return IdentityKey(thing), content_key(vars(thing), inside)


def _function(function: FunctionType, inside) -> tuple:
    if _is_ours(function) and "<locals>" not in function.__qualname__:
        return (IdentityKey(function),)
    closed = [value[0] if value else None for value in closed_over(function)]
    found = {} if _is_ours(function) else named_globals(function)
    parts = (content_key(part, inside) for part in (function.__defaults__, function.__kwdefaults__, closed, found))
    return function.__code__, IdentityKey(function.__globals__), *parts


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
    ((tuple, list), lambda thing, inside: (_keys(thing, inside),)),
    (slice, lambda thing, inside: (content_key((thing.start, thing.stop, thing.step), inside),)),
    ((set, frozenset), lambda thing, inside: (frozenset(_keys(thing, inside)),)),
    (dict, lambda thing, inside: (tuple(_keys(item, inside) for item in thing.items()),)),
    (partial, lambda thing, inside: (_keys((thing.func, thing.args, thing.keywords), inside),)),
    (MethodType, lambda thing, inside: _keys((thing.__func__, thing.__self__), inside)),
    (FunctionType, lambda thing, inside: _function(thing, inside)),
)
