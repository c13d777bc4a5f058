"""Compiled objects on disk by the content that they are made from: a new process loads them without tracing anything.

The key is the digest of that content (:mod:`gauss.codegen.content_digest`), of our sources
(:mod:`gauss.codegen.source_digest`) and of the environment (the compiler, numpy, Python, the CPU). An entry is a pickle of
the Python object around the machine code: names and sizes of its functions, tables, facts found while it was traced. In it
stand names instead of the machine code, which is kept as object code (:mod:`gauss.codegen.machine`), and instead of the
objects that the content consists of, which the new process has. An entry is read under the seal of
:mod:`gauss.codegen.object_cache`, like the machine code itself.
"""

import hashlib
import io
import pickle
import sys
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from typing import Any, TypeVar

import llvmlite
import llvmlite.binding as llvm
import numpy as np

from gauss.codegen import machine, object_cache
from gauss.codegen.content_digest import content_digest
from gauss.codegen.processor import features
from gauss.codegen.source_digest import reaches_outer, source_digest
from gauss.codegen.terminal_line import compile_notice

T = TypeVar("T")


def from_disk(content: tuple, make: Callable[[], T], first: bytes | None = None) -> T:
    """Object made from a content, from the cache on disk if it is there.

    Parameters
    ----------
    content : tuple
        All that the object depends on, first its maker. What has no digest is made anew by every process.
    make : callable
        () → the object. Machine code in it is of type :class:`gauss.codegen.machine.MachineCode`.
    first : bytes, optional
        Digest that the first object of the content had before. What is made is kept only if it has it still.
    """
    outer = reaches_outer(make)
    name = _name(content, first, outer)
    found = None if name is None else _read(name, content)
    if found is None:
        with compile_notice():
            found = make()
        same = name is None or _name(content, None, outer) == name  # no function has changed what it closes over meanwhile
        if name is not None and same:
            _write(name, found, content)
    return found


def is_noted(content: tuple, first: bytes | None = None) -> bool:
    """Whether a content was noted, by this process or another one; content and ``first`` as of :func:`from_disk`."""
    name = _name(content, first)
    return name is not None and object_cache.read(name) is not None


def note(content: tuple, first: bytes | None = None):
    """Note a content: a fact, as that a function of a system has passed a test; it holds for this version of the sources."""
    name = _name(content, first)
    if name is not None:
        object_cache.write(name, b"")


def _name(content: tuple, first: bytes | None = None, outer: bool = False) -> str | None:
    """Name of an entry, whose maker may be of an outer package; None if the content has no digest, or nothing is cached."""
    if object_cache.folder() is None:
        return None
    parts = [first or content_digest(content[0]), content_digest(*content[1:]), package_digest()]
    parts += [source_digest(outer=True)] if outer else []
    known = [part for part in parts if part is not None]
    return "made-" + hashlib.sha256(b"".join(known)).hexdigest() if len(known) == len(parts) else None


def _read(name: str, content: tuple):
    data = object_cache.read(name)
    if data is None:
        return None
    try:
        return _Unpickler(io.BytesIO(data), content).load()
    except _NotCachedError:  # the object code was evicted
        return None


def _write(name: str, made, content: tuple):
    buffer = io.BytesIO()
    with suppress(pickle.PicklingError, TypeError, AttributeError, RecursionError):  # it holds something of this process
        _Pickler(buffer, content).dump(made)
        object_cache.write(name, buffer.getvalue())


class _NotCachedError(Exception):
    """Machine code that is not in the cache."""


class _Pickler(pickle.Pickler):
    def __init__(self, file, content: tuple):
        super().__init__(file, pickle.HIGHEST_PROTOCOL)
        self.places = {id(thing): k for k, thing in enumerate(content)}

    def persistent_id(self, obj) -> Any:
        if isinstance(obj, machine.MachineCode):
            return "code", obj.key
        place = self.places.get(id(obj))
        return None if place is None or obj is None else ("content", place)


class _Unpickler(pickle.Unpickler):
    def __init__(self, file, content: tuple):
        super().__init__(file)
        self.content = content

    def persistent_load(self, pid):
        kind, which = pid
        if kind == "content":
            return self.content[which]
        code = machine.load_cached(which)
        if code is None:
            raise _NotCachedError
        return code


@cache
def package_digest() -> bytes | None:
    """SHA-256 of inner sources and environment; None if sources have changed since this process began."""
    sources = source_digest()
    if sources is None:
        return None
    cpu = llvm.get_process_triple(), llvm.get_host_cpu_name(), features()
    about = *cpu, llvmlite.__version__, llvm.llvm_version_info, np.__version__, sys.version
    return hashlib.sha256(sources + repr(about).encode()).digest()
