"""Files that nobody but this user can have written, and a key that nobody else knows.

A file is opened once, without following a link at its end, and what was opened is looked at: owner, kind, mode. Looking at a
path and opening it afterwards would be two files if somebody changed it in between. Where there are no owners and modes, as
on Windows, the folder of the user is taken to be that.
"""

import os
import secrets
import stat
import tempfile
import warnings
from contextlib import suppress
from pathlib import Path

from gauss.errors import CacheWarning

OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH
OTHERS = stat.S_IRWXG | stat.S_IRWXO
KEY = "key"
LENGTH = 32  # bytes of a key, as many as of the digest
HAS_OWNERS = hasattr(os, "getuid")
OPEN = os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)

_said: set[str] = set()


def is_own(found: os.stat_result, denied: int = OTHERS_WRITE) -> bool:
    """Whether what was found is this user's, and others have none of the rights that are denied them."""
    return not HAS_OWNERS or (found.st_uid == os.getuid() and not found.st_mode & denied)


def is_own_folder(place: Path) -> bool:
    """Whether a folder is there and is this user's to write to, and nobody else's; a word about it once if it is not."""
    try:
        found = os.stat(place)
    except OSError:
        return False
    if is_own(found):
        return stat.S_ISDIR(found.st_mode)
    remedy = "Take it from others (chmod go-w), or name another folder in GAUSS_CACHE"
    _say(place, f"belongs to somebody else, or others may write to it. {remedy}")
    return False


def content(path: Path, denied: int = OTHERS_WRITE) -> bytes | None:
    """Content of a file of this user's; None if there is none, or others may have written it."""
    try:
        handle = os.open(path, OPEN)
    except OSError:
        return None
    try:
        found = os.fstat(handle)
        if not stat.S_ISREG(found.st_mode):
            return None
        if not is_own(found, denied):
            _say(path.parent, f"a file in it ({path.name[:12]}) belongs to somebody else, or others have rights to it")
            return None
        with os.fdopen(handle, "rb", closefd=False) as file:
            return file.read()
    finally:
        os.close(handle)


def key(place: Path) -> bytes | None:
    """Key of a folder, if there is one that only this user can read."""
    found = content(place / KEY, OTHERS)
    return found if found is not None and len(found) == LENGTH else None


def made_key(place: Path) -> bytes | None:
    """Key of a folder; made if there is none. Of processes that make one at once, the first one's counts.

    Raises
    ------
    OSError
        If the folder cannot be written to.
    """
    found = key(place)
    if found is not None:
        return found
    temporary = write_aside(place, secrets.token_bytes(LENGTH))
    try:
        if os.path.lexists(place / KEY):  # not a key, or not secret
            os.replace(temporary, place / KEY)
        else:
            os.link(temporary, place / KEY)
    except FileExistsError:
        pass
    except OSError:  # no hard links here
        os.replace(temporary, place / KEY)
    finally:
        with suppress(FileNotFoundError):
            os.unlink(temporary)
    return key(place)


def write_aside(place: Path, data: bytes) -> str:
    """Path of a new file that only this user can read and write, to be given its name when it is whole."""
    handle, temporary = tempfile.mkstemp(dir=place)
    with os.fdopen(handle, "wb") as file:
        file.write(data)
    return temporary


def _say(place: Path, what: str):
    """Warn of a folder, once in a process."""
    if str(place) not in _said:
        _said.add(str(place))
        warnings.warn(f"cache of machine code {place}: {what}. It is not used; compiling anew.", CacheWarning, stacklevel=2)
