"""Trust in cached files by owner and mode, and a secret key per folder.

A file is opened once, without following a symbolic link, and the open file is checked: owner, kind, mode. A check of the
path before opening would be a race (time of check to time of use). Where files have no owners and modes, as on Windows, the
user's own folder is trusted.
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
OTHERS_ANY = stat.S_IRWXG | stat.S_IRWXO
KEY_FILE = "key"
PARTIAL = "partial-"  # start of the names of incomplete files
KEY_BYTES = 32  # length of a key, that of the digest
HAS_OWNERS = hasattr(os, "getuid")
OPEN_FLAGS = os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)

_warned: set[str] = set()


def is_own(found: os.stat_result, denied: int = OTHERS_WRITE) -> bool:
    """Whether a file belongs to this user and grants others none of the denied rights."""
    return not HAS_OWNERS or (found.st_uid == os.getuid() and not found.st_mode & denied)


def is_own_folder(folder: Path) -> bool:
    """Whether a folder exists and only this user may write to it; it warns once of one that others may write to."""
    try:
        found = os.stat(folder)
    except OSError:
        return False
    if is_own(found):
        return stat.S_ISDIR(found.st_mode)
    what, remedy = reason_and_remedy(folder, found)
    _warn(folder, f"{what}; {remedy}")
    return False


def reason_and_remedy(folder: Path, found: os.stat_result) -> tuple[str, str]:
    """Why a folder is not this user's own, and what helps: rights can be changed by the owner only."""
    elsewhere = "name another folder in GAUSS_CACHE"
    if found.st_uid != os.getuid():
        return f"it belongs to the user with number {found.st_uid}", elsewhere
    return "others may write to it", f"chmod go-w '{folder}', or {elsewhere}"


def read_own(path: Path, denied: int = OTHERS_WRITE) -> bytes | None:
    """Content of a file of this user; None if there is none, or if others may have written it."""
    try:
        handle = os.open(path, OPEN_FLAGS)
    except OSError:
        return None
    try:
        found = os.fstat(handle)
        if not stat.S_ISREG(found.st_mode):
            return None
        if not is_own(found, denied):
            _warn(path.parent, f"a file in it ({path.name[:12]}) belongs to somebody else, or others have rights to it")
            return None
        with os.fdopen(handle, "rb", closefd=False) as file:
            return file.read()
    finally:
        os.close(handle)


def read_key(folder: Path) -> bytes | None:
    """Secret key of a folder; None unless it exists and only this user can read it."""
    found = read_own(folder / KEY_FILE, OTHERS_ANY)
    return found if found is not None and len(found) == KEY_BYTES else None


def obtain_key(folder: Path) -> bytes | None:
    """Secret key of a folder, generated if there is none; of concurrent processes the first one's counts.

    OSError if the folder cannot be written to.
    """
    found = read_key(folder)
    if found is not None:
        return found
    temporary = write_temporary(folder, secrets.token_bytes(KEY_BYTES))
    try:
        if not os.path.lexists(folder / KEY_FILE):
            os.link(temporary, folder / KEY_FILE)
        elif read_key(folder) is None:  # not a valid key, or readable by others; not one that was made meanwhile
            os.replace(temporary, folder / KEY_FILE)
    except FileExistsError:
        pass
    except OSError:  # the file system has no hard links
        os.replace(temporary, folder / KEY_FILE)
    finally:
        with suppress(FileNotFoundError):
            os.unlink(temporary)
    return read_key(folder)


def write_temporary(folder: Path, data: bytes) -> str:
    """Path of a new private file, to be renamed once it is complete.

    OSError if it cannot be written, as on a full disk; nothing is left of it.
    """
    handle, temporary = tempfile.mkstemp(dir=folder, prefix=PARTIAL)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(data)
    except OSError:
        with suppress(FileNotFoundError):
            os.unlink(temporary)
        raise
    return temporary


def _warn(folder: Path, what: str):
    """Warn of a folder, once in a process."""
    if str(folder) not in _warned:
        _warned.add(str(folder))
        warnings.warn(f"cache of machine code {folder}: {what}. It is not used; compiling anew.", CacheWarning, stacklevel=2)
