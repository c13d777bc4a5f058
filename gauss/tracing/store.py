"""Machine code on disk, keyed by what it was made from; a damaged or foreign file is as good as none.

A file is machine code that will run, so it is read only if it belongs to this user, names its own key, and matches its
checksum. Environment: ``GAUSS_CACHE`` names another folder; empty, nothing is kept.
"""

import hashlib
import os
import tempfile
from pathlib import Path

MAGIC = b"gauss kernel 1\n"
CHECK = 32  # bytes of a SHA-256


def folder() -> Path | None:
    """Folder of the files, or None when nothing is to be kept."""
    named = os.environ.get("GAUSS_CACHE")
    if named is not None:
        return Path(named) if named else None
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(base) / "gauss"


def key(*parts: str) -> str:
    """Name of what is made from these texts."""
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()


def read(name: str) -> bytes | None:
    """Return what is kept under a name, or None if there is nothing that can be trusted."""
    place = folder()
    if place is None:
        return None
    path = place / name
    try:
        if hasattr(os, "getuid") and path.stat().st_uid != os.getuid():
            return None
        data = path.read_bytes()
    except OSError:
        return None
    head = len(MAGIC) + CHECK
    content = data[head:]
    return content if data[:head] == MAGIC + _checksum(name, content) else None


def write(name: str, content: bytes):
    """Keep a content; a folder that cannot be written to is no error, the next process compiles again."""
    place = folder()
    if place is None:
        return
    try:
        place.mkdir(mode=0o700, parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(dir=place)
        with os.fdopen(handle, "wb") as file:
            file.write(MAGIC + _checksum(name, content) + content)
        os.replace(temporary, place / name)  # whole or not at all, whoever else writes at the same time
    except OSError:
        return


def _checksum(name: str, content: bytes) -> bytes:
    return hashlib.sha256(name.encode() + content).digest()
