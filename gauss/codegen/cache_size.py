"""Bound on the size of the cache: the files least recently used are removed.

The time of last use is the time of change of a file, which every read renews. Only files with names of the cache are
removed, for the user may have named a folder with other files. A process that reads a file while another removes it keeps
what it has opened. Environment variable: ``GAUSS_CACHE_SIZE``, the largest size in MB, 512 unless given.
"""

import os
import re
import time
import warnings
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from gauss.codegen.file_trust import PARTIAL
from gauss.errors import CacheWarning

DEFAULT_SIZE = 512.0  # of the cache [MB]: a thousand large mechanisms
KEPT_SHARE = 0.8  # of the largest size after a removal, so that not every write removes files
LOOKED_AT_SHARE = 0.05  # of the largest size: bytes written between two looks at the folder
ABANDONED = 86_400.0  # age of an incomplete file that no process will complete [s]
NAME = re.compile(r"([a-z]+-)?[0-9a-f]{64}([.-][a-z]+)?")

_unseen: dict[str, float] = {}  # bytes written to each folder since the last look at it; a process looks at its first write


def largest_size() -> float:
    """Largest size of the cache [bytes]."""
    given = os.environ.get("GAUSS_CACHE_SIZE")
    with suppress(ValueError):
        size = DEFAULT_SIZE if not given else float(given)
        if size >= 0.0:
            return size * 1e6
    warnings.warn(f"GAUSS_CACHE_SIZE: expected a size in MB, got {given!r}; {DEFAULT_SIZE:g} is used.", CacheWarning, 2)
    return DEFAULT_SIZE * 1e6


def files(folder: Path) -> Iterator[tuple[str, os.stat_result]]:
    """Name and state of each complete file of the cache in a folder."""
    with suppress(FileNotFoundError, NotADirectoryError), os.scandir(folder) as entries:
        for entry in entries:
            with suppress(FileNotFoundError):
                if NAME.fullmatch(entry.name) and entry.is_file(follow_symlinks=False):
                    yield entry.name, entry.stat(follow_symlinks=False)


def note_written(folder: Path, size: int):
    """Note a write to a folder, and remove files from time to time."""
    most = largest_size()
    unseen = _unseen.get(str(folder), most) + size
    _unseen[str(folder)] = unseen
    if unseen >= LOOKED_AT_SHARE * most:
        _unseen[str(folder)] = 0.0
        trim(folder, most)


def trim(folder: Path, most: float):
    """Remove the files least recently used where all together exceed a size [bytes], and abandoned ones."""
    found = sorted(files(folder), key=lambda file: file[1].st_mtime_ns, reverse=True)
    total = sum(state.st_size for _, state in found)
    left = KEPT_SHARE * most if total > most else total
    for name, state in found:
        left -= state.st_size
        if left < 0.0:
            _remove(folder / name)
    for path in folder.glob(f"{PARTIAL}*"):
        with suppress(FileNotFoundError):
            if time.time() - path.stat().st_mtime > ABANDONED:
                _remove(path)


def empty(folder: Path) -> int:
    """Remove all files of the cache; returns their number."""
    names = [name for name, _ in files(folder)]
    for name in names:
        _remove(folder / name)
    return len(names)


def _remove(path: Path):
    with suppress(OSError):
        path.unlink()
