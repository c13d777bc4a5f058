"""Digest of all that machine code depends on beside the mechanism: our sources, the compiler, numpy, Python, the CPU.

Reading the sources takes 9 ms; so their digest is kept in the cache under the list of their paths, sizes and times of
change, which takes 4 ms. Sources that changed after this process began are not those that it has loaded: then there is no
digest, and nothing is kept.
"""

import hashlib
import os
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import llvmlite
import llvmlite.binding as llvm
import numpy as np

from gauss.codegen import object_cache
from gauss.codegen.processor import features
from gauss.lazy import BEGUN

FOLDER = Path(__file__).parent.parent
LONGEST_READ = 1 << 20  # bytes


@cache
def package_digest() -> bytes | None:
    """SHA-256 of sources and environment; None if sources have changed since this process began."""
    files = sorted(_sources(str(FOLDER)))
    if max(changed for *_, changed in files) >= BEGUN:
        return None
    listed = "sources-" + hashlib.sha256(repr((str(FOLDER), files)).encode()).hexdigest()
    content = object_cache.read(listed)
    if content is None:
        content = _content_of([path for path, *_ in files])
        object_cache.write(listed, content)
    cpu = llvm.get_process_triple(), llvm.get_host_cpu_name(), features()
    about = *cpu, llvmlite.__version__, llvm.llvm_version_info, np.__version__, sys.version
    return hashlib.sha256(content + repr(about).encode()).digest()


def _sources(folder: str, inside: str = "") -> Iterator[tuple[str, int, int]]:
    """Path inside the package, size and last change [ns] of each source."""
    for entry in os.scandir(folder):
        if entry.is_dir(follow_symlinks=False):
            if entry.name != "__pycache__":
                yield from _sources(entry.path, f"{inside}{entry.name}/")
        elif entry.name.endswith((".py", ".pyi")):
            found = entry.stat()
            yield inside + entry.name, found.st_size, max(found.st_mtime_ns, found.st_ctime_ns)


def _content_of(paths: list[str]) -> bytes:
    total = hashlib.sha256()
    for path in paths:
        content = _read(f"{FOLDER}/{path}")
        total.update(b"%s\0%d\0%s" % (path.encode(), len(content), content))
    return total.digest()


def _read(path: str) -> bytes:
    """Content of a file; a file object, or a path object, would take longer than the file."""
    file, parts = os.open(path, os.O_RDONLY | getattr(os, "O_BINARY", 0)), list[bytes]()
    try:
        while part := os.read(file, LONGEST_READ):
            parts.append(part)
    finally:
        os.close(file)
    return b"".join(parts)
