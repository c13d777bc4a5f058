"""What a thing computes with, as a key: things of equal content may share machine code, others never do.

A name is no such key: it is given by whoever makes the thing. Numbers, arrays and records count by value. A function counts
by its code, its defaults, the values that it closes over, and the values of the globals that it names, for all of these go
into what is traced; functions at the top of a module of this package do not change and count as themselves.
"""

from collections.abc import Hashable
from dataclasses import fields, is_dataclass
from functools import partial
from types import BuiltinFunctionType, CodeType, FunctionType, MethodType, ModuleType

import numpy as np

PACKAGE = __name__.partition(".")[0]


class Same:
    """A thing as a key: equal to itself only. It is kept, so that no other takes its place in memory."""

    __slots__ = ("thing",)

    def __init__(self, thing):
        self.thing = thing

    def __hash__(self) -> int:
        return id(self.thing)

    def __eq__(self, other) -> bool:
        return isinstance(other, Same) and self.thing is other.thing


def content(thing, within: tuple[int, ...] = ()) -> Hashable:
    """Key of a thing.

    Parameters
    ----------
    thing : object
        Record, function, number, array, or a collection of these.
    within : tuple of int
        Addresses of what it is part of: a function may name itself.
    """
    kind = type(thing)
    if thing is None or kind in (str, bytes, bool, int, complex, np.bool_):
        return kind, thing
    if kind is float or isinstance(thing, np.number):
        return kind, repr(thing)  # unlike ==, tells −0.0 from 0.0, and finds one that is not a number again
    if id(thing) in within:
        return "itself", within.index(id(thing))
    inside = (*within, id(thing))
    if isinstance(thing, np.ndarray):
        if thing.dtype == object:
            return kind, thing.shape, tuple(content(entry, inside) for entry in thing.flat)
        return kind, thing.dtype.str, thing.shape, thing.tobytes()
    if isinstance(thing, tuple | list):
        return kind, tuple(content(entry, inside) for entry in thing)
    if isinstance(thing, slice):
        return kind, content((thing.start, thing.stop, thing.step), inside)
    if isinstance(thing, set | frozenset):
        return kind, frozenset(content(entry, inside) for entry in thing)
    if isinstance(thing, dict):
        return kind, tuple((content(key, inside), content(value, inside)) for key, value in thing.items())
    if isinstance(thing, partial):
        return kind, tuple(content(part, inside) for part in (thing.func, thing.args, thing.keywords))
    if isinstance(thing, MethodType):
        return kind, content(thing.__func__, inside), content(thing.__self__, inside)
    if isinstance(thing, FunctionType):
        return kind, *_function(thing, inside)
    if isinstance(thing, type | ModuleType | BuiltinFunctionType):
        return Same(thing)
    return kind, *_record(thing, inside)


def _record(thing, inside) -> tuple:
    """Fields of a dataclass, or what an object of somebody else keeps; any other object is itself."""
    if is_dataclass(thing):
        return tuple(content(getattr(thing, field.name), inside) for field in fields(thing))
    if _is_ours(type(thing)) or not hasattr(thing, "__dict__"):
        return (Same(thing),)
    return Same(thing), content(vars(thing), inside)


def _function(function: FunctionType, inside) -> tuple:
    if _is_ours(function) and "<locals>" not in function.__qualname__:
        return (Same(function),)
    closed = [cell.cell_contents if _is_filled(cell) else None for cell in function.__closure__ or ()]
    found = {} if _is_ours(function) else _globals(function)
    parts = (content(part, inside) for part in (function.__defaults__, function.__kwdefaults__, closed, found))
    return function.__code__, Same(function.__globals__), *parts


def _globals(function: FunctionType) -> dict:
    """Values of the globals that a function, or one within it, names; modules and classes are not looked into."""
    names = sorted(set(_names(function.__code__)) & function.__globals__.keys())
    return {name: function.__globals__[name] for name in names}


def _names(code: CodeType):
    yield from code.co_names
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _names(constant)


def _is_ours(thing) -> bool:
    return str(getattr(thing, "__module__", "")).partition(".")[0] == PACKAGE


def _is_filled(cell) -> bool:
    try:
        cell.cell_contents  # noqa: B018
    except ValueError:  # of a name that gets its value later
        return False
    return True
