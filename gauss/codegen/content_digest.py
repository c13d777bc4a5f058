"""Digest of an object by content, the same in every process: the key of code on disk.

Numbers, texts, arrays, collections and records of this package enter by value, in an encoding from which they could be read
back: things of different content have different encodings. Top-level functions and classes of this package, numpy and the
standard mathematics enter by name, for the key of the cache holds their sources or versions
(:mod:`gauss.codegen.disk_cache`); a thing of an outer package of ours takes the sources of all these with it
(:mod:`gauss.codegen.source_digest`). Another function enters by its code, its defaults, the values that it closes over and
those of its globals. A traced function enters by its operations. Anything else has no digest, and what depends on it is not
kept: a digest that misses a number would be the key of the code of another mechanism.
"""

import builtins
import dis
import hashlib
import struct
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import fields, is_dataclass
from enum import Enum
from functools import cache, cached_property, partial
from types import BuiltinFunctionType, CodeType, FunctionType, MethodType, ModuleType, NoneType
from typing import Any

import numpy as np

from gauss.codegen.content_key import IdentityKey, named_globals
from gauss.codegen.expression import Expression
from gauss.codegen.function import Function
from gauss.codegen.lookup import Column
from gauss.codegen.source_digest import PACKAGE, closed_over, is_outer, source_digest

BY_NAME = (PACKAGE, "numpy", "math", "cmath", "operator", "builtins")  # packages whose functions the key of the cache holds
# built-in functions by which code may depend on more than its constants, globals and arguments
OPAQUE_BUILTINS = {"__import__", "eval", "exec", "globals", "input", "locals", "open", "vars"}
IMPORTS = {dis.opmap["IMPORT_NAME"]}
# kinds of Python's own objects, which have no name by which they are found
PYTHON_KINDS = {FunctionType, MethodType, BuiltinFunctionType, CodeType, ModuleType, NoneType}
IS_CONTENT = "is_content"  # metadata of a field of a record: False if results do not depend on it
KILOBYTE = 1024  # bytes
HEAP_TYPE = 1 << 9  # flag of classes that are written in Python, whose objects hold their attributes alone
# attributes of a class that calls of its objects do not reach: they make no objects
UNCALLED = {"__annotations__", "__dict__", "__doc__", "__firstlineno__", "__init__", "__module__", "__qualname__"}
UNCALLED |= {"__eq__", "__hash__", "__repr__", "__static_attributes__", "__weakref__"}
CODE_FIELDS: tuple[str, ...] = (
    "co_code",
    "co_names",
    "co_varnames",
    "co_freevars",
    "co_cellvars",
    "co_flags",
    "co_argcount",
)
CODE_FIELDS += ("co_posonlyargcount", "co_kwonlyargcount", "co_exceptiontable")


class NoDigestError(TypeError):
    """An object whose content is unknown."""


def content_digest(*things, most: int = sys.maxsize, in_process: bool = False) -> bytes | None:
    """SHA-256 of the content of objects; None if the content of one is unknown, or has more parts than ``most``.

    A kilobyte of an array is a part. Objects of classes of the user have content within a process only: their attributes,
    and the functions of their classes.
    """
    encoder = _Encoder(most, in_process)
    try:
        encoder.encode(things)
    except (NoDigestError, RecursionError):
        return None
    if encoder.outer and not in_process:
        sources = source_digest(outer=True)
        if sources is None:
            return None
        encoder.parts.append(sources)
    return hashlib.sha256(b"".join(encoder.parts)).digest()


class _Encoder:
    """Encoding of objects as tagged and delimited parts."""

    def __init__(self, most: int, in_process: bool):
        self.most, self.in_process = most, in_process
        self.parts: list[bytes] = []
        self.functions: dict[int, int] = {}  # address of each traced function encoded so far → its number
        self.names: dict[int, bytes] = {}  # address of each named object encoded so far → its name
        self.codes: dict[int, int] = {}  # address of each code object encoded so far → its number
        self.outer: set[str] = set()  # modules of our outer packages of which something was encoded

    def note_module(self, name: str):
        """Note the module of something that enters without its source."""
        if is_outer(name):
            self.outer.add(name)

    def encode(self, thing):
        """Append the encoding of an object: its own part, then those of what it contains, in order.

        NoDigestError if its content is unknown.
        """
        enclosing: dict[int, int] = {}  # address of each object that contains the present one → its depth
        left: list[tuple[Iterator, Any]] = []  # what is to follow an object, and that object, from the outermost on
        present = iter((thing,))
        while True:
            for one in present:
                if len(self.parts) > self.most:
                    raise NoDigestError(f"content of more than {self.most} parts")
                kind = type(one)
                simple = _SIMPLE.get(kind)
                if simple is not None:
                    self.parts.append(simple(one))
                elif id(one) in enclosing:
                    self.parts.append(b"itself%d;" % enclosing[id(one)])
                elif inside := _writer(kind)(self, one):  # type: ignore[arg-type]  # a type is hashable
                    enclosing[id(one)] = len(enclosing)
                    left.append((present, one))
                    present = iter(inside)
                    break
            else:
                if not left:
                    return
                present, one = left.pop()
                del enclosing[id(one)]

    def sequence(self, tag: bytes, things: Sequence) -> Sequence:
        """Append the head of a number of objects, which are to follow."""
        self.parts.append(b"%s%d(" % (tag, len(things)))
        return things


def _text(text: str) -> bytes:
    data = text.encode("utf-8", "surrogatepass")
    return b"s%d:%s" % (len(data), data)


_SIMPLE: dict[type, Callable[[Any], bytes]] = {
    NoneType: lambda _: b"N",
    bool: lambda thing: b"T" if thing else b"F",
    int: lambda thing: b"i%d;" % thing,
    float: lambda thing: b"f" + struct.pack("<d", thing),
    complex: lambda thing: b"c" + struct.pack("<dd", thing.real, thing.imag),
    str: _text,
    bytes: lambda thing: b"b%d:%s" % (len(thing), thing),
    type(...): lambda _: b"E",
}


Writer = Callable[[_Encoder, Any], Sequence]  # appends the part of an object, and returns the objects to follow it


@cache
def _writer(kind: type) -> Writer:
    """Encoding of objects of a kind."""
    for kinds, write, exactly in _WRITERS:
        if issubclass(kind, kinds):
            return write if not exactly or kind in kinds else _refused
    return _record if is_dataclass(kind) and _has_name(kind) else _object


def _refused(_: _Encoder, thing) -> Sequence:
    raise NoDigestError(f"{type(thing).__name__}: unknown content")


def _object(encoder: _Encoder, thing) -> Sequence:
    """Attributes of an object, and what its classes hold: known within this process only."""
    classes = type(thing).__mro__[:-1]
    own = getattr(thing, "__dict__", None)
    opaque = any(not kind.__flags__ & HEAP_TYPE or "__slots__" in vars(kind) for kind in classes)
    if not encoder.in_process or type(own) is not dict or opaque:
        return _refused(encoder, thing)
    held = [{name: _behind(value) for name, value in vars(kind).items() if name not in UNCALLED} for kind in classes]
    return encoder.sequence(b"o%d" % id(type(thing)), (own, *held))


def _behind(value):
    """Function behind a property or a method of a class; any other value itself."""
    return value.fget if isinstance(value, property) else getattr(value, "__func__", value)


def _tuple(encoder: _Encoder, thing) -> Sequence:
    if type(thing) is not tuple:
        _named(encoder, type(thing))
    if set(map(type, thing)) == {float}:
        encoder.parts.append(b"v%d:" % len(thing) + struct.pack(f"<{len(thing)}d", *thing))
        return ()
    return encoder.sequence(b"t", thing)


def _member(encoder: _Encoder, member: Enum) -> Sequence:
    _named(encoder, type(member))
    return (member.name,)


def _slice(encoder: _Encoder, thing: slice | range) -> Sequence:
    ends = thing.start, thing.stop, thing.step
    if all(type(end) in (int, NoneType) for end in ends):
        encoder.parts.append(repr(thing).encode() + b";")
        return ()
    return encoder.sequence(b"S", ends)


def _record(encoder: _Encoder, thing) -> Sequence:
    """The fields of a record; an attribute beside them must be a property computed from them."""
    kind = type(thing)
    own, named = getattr(thing, "__dict__", {}).keys(), kind.__dataclass_fields__.keys()
    if not (own <= named or all(isinstance(getattr(kind, name, None), cached_property) for name in own - named)):
        _refused(encoder, thing)
    _named(encoder, kind)
    return [getattr(thing, name) for name in _field_names(kind)]  # type: ignore[arg-type]  # a type is hashable


@cache
def _field_names(kind: type) -> tuple[str, ...]:
    return tuple(field.name for field in fields(kind) if field.metadata.get(IS_CONTENT, True))


def _array(encoder: _Encoder, array: np.ndarray) -> Sequence:
    kind = f"a{array.dtype.str}{array.shape}:".encode()
    if array.dtype.fields is not None or array.nbytes > KILOBYTE * encoder.most:
        _refused(encoder, array)
    if array.dtype.hasobject:
        return encoder.sequence(kind, array.ravel().tolist())
    encoder.parts.append(kind + array.tobytes())
    return ()


def _number(encoder: _Encoder, number: np.generic) -> Sequence:
    return encoder.sequence(b"n", (number.dtype.str, number.tobytes()))


def _set(encoder: _Encoder, things) -> Sequence:
    found = []
    for thing in things:
        own = _Encoder(encoder.most, encoder.in_process)
        own.encode(thing)
        encoder.outer |= own.outer
        found.append(b"".join(own.parts))
    return encoder.sequence(b"u", sorted(found))


def _named(encoder: _Encoder, thing) -> Sequence:
    """Append the name of a top-level object of a package that the key of the cache holds."""
    name = encoder.names.get(id(thing))
    if name is None:
        if not _has_name(thing):
            _refused(encoder, thing)
        encoder.note_module(thing.__module__)
        name = encoder.names[id(thing)] = b"@" + _text(thing.__module__) + _text(thing.__qualname__)
    encoder.parts.append(name)
    return ()


def _has_name(thing) -> bool:
    """Whether an object is found under its own name in such a package, or has a name that no other of them has."""
    if isinstance(thing, type) and thing in PYTHON_KINDS:
        return True
    module = getattr(thing, "__module__", None) or ""
    if module.partition(".")[0] not in BY_NAME:
        return False
    found: Any = sys.modules.get(module)
    for name in getattr(thing, "__qualname__", "<locals>").split("."):
        found = getattr(found, name, None)
    return found is thing


def _builtin(encoder: _Encoder, thing) -> Sequence:
    owner = getattr(thing, "__self__", None)
    if not (isinstance(owner, ModuleType) or owner is None):
        return encoder.sequence(b"m", (thing.__name__, owner))
    if thing.__name__ in OPAQUE_BUILTINS:
        _refused(encoder, thing)
    return _named(encoder, thing)


def _ufunc(encoder: _Encoder, ufunc: np.ufunc) -> Sequence:
    if getattr(np, ufunc.__name__, None) is not ufunc:
        _refused(encoder, ufunc)
    encoder.parts.append(b"@" + _text(ufunc.__name__))
    return ()


def _module(encoder: _Encoder, module: ModuleType) -> Sequence:
    if module.__name__.partition(".")[0] not in BY_NAME or module is builtins:
        _refused(encoder, module)
    encoder.note_module(module.__name__)
    encoder.parts.append(b"M" + _text(module.__name__))
    return ()


def _function(encoder: _Encoder, function: FunctionType) -> Sequence:
    """The name of a top-level function of this package, or the code of another and all that it can see."""
    if id(function) in encoder.names or _has_name(function):
        return _named(encoder, function)
    ours = (function.__module__ or "").partition(".")[0] == PACKAGE
    encoder.note_module(function.__module__ or "")
    closed = tuple(closed_over(function))
    seen = {} if ours else named_globals(function)
    defaults = function.__defaults__, function.__kwdefaults__
    return encoder.sequence(b"p", (*defaults, vars(function), closed, seen, function.__code__))


def _code(encoder: _Encoder, code: CodeType) -> Sequence:
    if id(code) in encoder.codes:
        encoder.parts.append(b"K%d;" % encoder.codes[id(code)])
        return ()
    encoder.codes[id(code)] = len(encoder.codes)
    if not IMPORTS.isdisjoint(code.co_code[::2]) or not OPAQUE_BUILTINS.isdisjoint(code.co_names):
        _refused(encoder, code)
    return encoder.sequence(b"k", [*(getattr(code, name) for name in CODE_FIELDS), code.co_consts])


def _traced(encoder: _Encoder, function: Function) -> Sequence:
    """The operations of a traced function."""
    if id(function) in encoder.functions:
        encoder.parts.append(b"g%d;" % encoder.functions[id(function)])
        return ()
    encoder.functions[id(function)] = len(encoder.functions)
    place = {node: k for k, node in enumerate(function.nodes)}
    ends = [place.get(x, -1) if isinstance(x, Expression) else float(x) for x in function.outputs]
    inputs = [place.get(symbol, -1) for symbol in function.inputs]
    operations = [f"{node.op} {','.join([str(place[x]) for x in node.operands])}" for node in place]
    values = [node.value for node in place]
    return encoder.sequence(b"G", (function.name, function.parameters, inputs, ends, "; ".join(operations), values))


# kinds, their encoding, and whether a subclass is refused, since it may hold more
_WRITERS: tuple[tuple[tuple[type, ...], Writer, bool], ...] = (
    ((IdentityKey,), lambda _, key: (key.thing,), True),
    ((Function,), _traced, True),
    ((Column,), lambda _, column: (column.digest,), True),
    ((Enum,), _member, False),
    ((np.ndarray,), _array, True),
    ((np.generic,), _number, False),
    ((tuple,), _tuple, False),
    ((list,), lambda encoder, thing: encoder.sequence(b"l", thing), True),
    ((dict,), lambda encoder, thing: encoder.sequence(b"d", [part for item in thing.items() for part in item]), True),
    ((set, frozenset), _set, True),
    ((slice, range), _slice, True),
    ((partial,), lambda encoder, thing: encoder.sequence(b"P", (thing.func, thing.args, thing.keywords)), True),
    ((MethodType,), lambda encoder, thing: encoder.sequence(b"m", (thing.__func__, thing.__self__)), True),
    ((CodeType,), _code, True),
    ((FunctionType,), _function, True),
    ((BuiltinFunctionType,), _builtin, True),
    ((np.ufunc,), _ufunc, True),
    ((ModuleType,), _module, False),
    ((type,), _named, False),
)
