"""Machine code on disk, keyed by what it was made from; a damaged or foreign file is as good as none.

A file is machine code that will run as this user. So it is read only from a folder and a file that nobody else may write to
(:mod:`gauss.codegen.file_trust`), and only if it carries a seal, HMAC-SHA-256 (RFC 2104) of its name and content under a
key that
lies in the same folder and that only this user can read: a file that was brought there by other means than this module,
unpacked from an archive or left by a process that may write to the folder but not read the key, is not run. Who can act
as this user, and root, can do anything anyway. Environment: ``GAUSS_CACHE`` names another folder; empty, nothing is kept.
"""

import hashlib
import hmac
import os
from pathlib import Path

from gauss.codegen import file_trust as trust

MAGIC = b"gauss kernel 2\n"
SEAL = 32  # bytes of a SHA-256


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
    if place is None or not trust.is_own_folder(place):
        return None
    secret, data = trust.key(place), trust.content(place / name)
    if secret is None or data is None:
        return None
    head = len(MAGIC) + SEAL
    content = data[head:]
    return content if hmac.compare_digest(data[:head], MAGIC + _seal(secret, name, content)) else None


def write(name: str, content: bytes):
    """Keep a content; a folder that cannot be written to is no error, the next process compiles again."""
    place = folder()
    if place is None:
        return
    try:
        place.mkdir(mode=0o700, parents=True, exist_ok=True)
        secret = trust.made_key(place) if trust.is_own_folder(place) else None
        if secret is None:
            return
        temporary = trust.write_aside(place, MAGIC + _seal(secret, name, content) + content)
        os.replace(temporary, place / name)  # whole or not at all, whoever else writes at the same time
    except OSError:
        return


def kept() -> list[int]:
    """Sizes of the files [bytes]."""
    place = folder()
    if place is None or not place.is_dir():
        return []
    return [entry.stat().st_size for entry in os.scandir(place) if entry.is_file() and entry.name != trust.KEY]


def _seal(secret: bytes, name: str, content: bytes) -> bytes:
    return hmac.digest(secret, name.encode() + content, "sha256")
