"""Object code on disk, keyed by a hash of its source IR and of the compiler; damaged or foreign files are ignored.

A cached file is code that will run as this user. So it is read only if nobody else may write to it or to its folder
(:mod:`gauss.codegen.file_trust`), and only with a valid seal: HMAC-SHA-256 (RFC 2104) of name and content under a key in the
same folder that only this user can read. A file of another origin, such as an archive, or a process that may write to the
folder but not read the key, has no valid seal. Root and processes of this user are trusted. Environment variables:
``GAUSS_CACHE`` names another folder; empty, nothing is cached. ``GAUSS_CACHE_SIZE`` is its largest size in MB
(:mod:`gauss.codegen.cache_size`).
"""

import hashlib
import hmac
import os
import struct
from contextlib import suppress
from pathlib import Path

from gauss.codegen import cache_size, file_trust

MAGIC = b"gauss kernel 2\n"
SEAL_BYTES = 32  # bytes of a SHA-256
QUICK_SUFFIX = ".quick"  # of the name under which quick code is cached, with its module, until it is optimised


def folder() -> Path | None:
    """Folder of the cache; None if nothing is cached."""
    named = os.environ.get("GAUSS_CACHE")
    if named is not None:
        return Path(named) if named else None
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(base) / "gauss"


def key(*parts: str) -> str:
    """File name for code made from these texts: their SHA-256."""
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()


def read(name: str) -> bytes | None:
    """Content cached under a name; None if there is none that can be trusted."""
    place = folder()
    if place is None or not file_trust.is_own_folder(place):
        return None
    secret, data = file_trust.read_key(place), file_trust.read_own(place / name)
    if secret is None or data is None:
        return None
    head = len(MAGIC) + SEAL_BYTES
    content = data[head:]
    if not hmac.compare_digest(data[:head], MAGIC + _seal(secret, name, content)):
        return None
    with suppress(OSError):
        os.utime(place / name)  # the time of last use
    return content


def write(name: str, content: bytes):
    """Cache a content; a folder without write access is no error, the next process compiles again."""
    place = folder()
    if place is None:
        return
    try:
        place.mkdir(mode=0o700, parents=True, exist_ok=True)
        secret = file_trust.obtain_key(place) if file_trust.is_own_folder(place) else None
        if secret is None:
            return
        temporary = file_trust.write_temporary(place, MAGIC + _seal(secret, name, content) + content)
        os.replace(temporary, place / name)  # atomic under concurrent writes
        cache_size.note_written(place, len(content))
    except OSError:
        return


def remove(name: str):
    """Forget a content."""
    place = folder()
    if place is not None:
        with suppress(OSError):
            os.unlink(place / name)


def packed(objects: list[bytes]) -> bytes:
    """Several byte strings as one."""
    return struct.pack(f"<{1 + len(objects)}Q", len(objects), *map(len, objects)) + b"".join(objects)


def unpacked(content: bytes) -> list[bytes]:
    """Byte strings of :func:`packed`."""
    (count,) = struct.unpack_from("<Q", content)
    lengths, at, found = struct.unpack_from(f"<{count}Q", content, 8), 8 * (1 + count), []
    for length in lengths:
        found.append(content[at : at + length])
        at += length
    return found


def file_sizes() -> dict[str, int]:
    """Sizes of the cached files by name [bytes]."""
    place = folder()
    return {} if place is None else {name: state.st_size for name, state in cache_size.files(place)}


def _seal(secret: bytes, name: str, content: bytes) -> bytes:
    return hmac.digest(secret, name.encode() + content, "sha256")
