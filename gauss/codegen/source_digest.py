"""Digest of our sources: a part of the key of everything on disk that is made by them.

Code is made by the inner packages, those from simulation inwards, which import no outer one (the import contract in
``pyproject.toml``). The outer ones, among them readers of files, figures and benchmarks, hold two fifths of the sources, and
enter a key only where something of theirs does: a law, a class or a maker that they define.

A digest is kept in the cache under the list of paths, sizes and times of change, for that list takes a third of the time of
reading the sources. Sources that changed after this process began are not those that it has loaded: they have no digest.
"""

import hashlib
import os
from collections.abc import Iterator
from functools import cache, partial
from pathlib import Path
from types import FunctionType, MethodType

from gauss.codegen import object_cache
from gauss.lazy import LOADED_AT

PACKAGE = __name__.partition(".")[0]
FOLDER = Path(__file__).parent.parent
READ = 1 << 16  # bytes at a time: more than most sources have
INNER = frozenset(
    "arguments backends codegen dynamics errors integrators interruption lazy linked_groups math rotations scene".split()
    + "shapes simulation system versions".split()
)


def is_outer(module: str | None) -> bool:
    """Whether a module of this package, by its full name, is of no inner package."""
    package, _, inside = (module or "").partition(".")
    return package == PACKAGE and inside.partition(".")[0] not in INNER


def reaches_outer(function) -> bool:
    """Whether a function, or an object that it closes over or is bound to, is of an outer package."""
    left, seen = [function], set[int]()
    while left:
        thing = left.pop()
        if id(thing) in seen:
            continue
        seen.add(id(thing))
        if is_outer(getattr(thing, "__module__", None) or type(thing).__module__):
            return True
        if isinstance(thing, FunctionType):
            left += [value for values in closed_over(thing) for value in values]
        elif isinstance(thing, MethodType):
            left += [thing.__func__, thing.__self__]
        elif isinstance(thing, partial):
            left += [thing.func, *thing.args, *thing.keywords.values()]
    return False


def closed_over(function: FunctionType) -> list[tuple]:
    """Value of each name that a function closes over, empty where the name is not bound yet."""
    return [_content(cell) for cell in function.__closure__ or ()]


def _content(cell) -> tuple:
    try:
        return (cell.cell_contents,)
    except ValueError:
        return ()


@cache
def source_digest(outer: bool = False) -> bytes | None:
    """SHA-256 of the sources of inner packages, or of outer ones; None if they have changed since this process began."""
    files = sorted(_sources(str(FOLDER), outer))
    if max(changed for *_, changed in files) >= LOADED_AT:
        return None
    listed = "sources-" + hashlib.sha256(repr((str(FOLDER), files)).encode()).hexdigest()
    content = object_cache.read(listed)
    if content is None:
        content = _content_of([path for path, *_ in files])
        object_cache.write(listed, content)
    return content


def _sources(folder: str, outer: bool, inside: str = "") -> Iterator[tuple[str, int, int]]:
    """Path inside the package, size and last change [ns] of each source."""
    for entry in os.scandir(folder):
        if not inside and (entry.name.partition(".")[0] in INNER) is outer:
            continue
        if entry.is_dir(follow_symlinks=False):
            if entry.name != "__pycache__":
                yield from _sources(entry.path, outer, f"{inside}{entry.name}/")
        elif entry.name.endswith((".py", ".pyi")):
            found = entry.stat()
            yield inside + entry.name, found.st_size, max(found.st_mtime_ns, found.st_ctime_ns)


def _content_of(paths: list[str]) -> bytes:
    total = hashlib.sha256()
    for path in paths:
        content = _bytes_of(f"{FOLDER}/{path}")
        total.update(b"%s\0%d\0" % (path.encode(), len(content)))
        total.update(content)
    return total.digest()


def _bytes_of(path: str) -> bytes:
    """Content of a file; a file object would take half as long again, a path object twice."""
    file = os.open(path, os.O_RDONLY | getattr(os, "O_BINARY", 0))
    try:
        parts = [os.read(file, READ)]
        while len(parts[-1]) == READ:
            parts.append(os.read(file, READ))
    finally:
        os.close(file)
    return b"".join(parts)
