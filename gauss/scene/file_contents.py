"""Contents of files that others wrote: of files alone, not of what has no end, and of a size that the memory takes."""

from pathlib import Path
from stat import S_ISREG

from gauss.errors import FileError

LARGEST_FILE = 20_000_000  # bytes


def contents(path: Path, largest: int = LARGEST_FILE) -> bytes:
    """Bytes of a file, at most ``largest``; pipes and devices, from which reading may not end, are no files.

    FileError if there is none, it is no file, it is larger, or it cannot be read.
    """
    try:
        found = path.stat()
        if not S_ISREG(found.st_mode):
            raise FileError(f"{path}: {'a folder' if path.is_dir() else 'a pipe or device'}, not a file; name a file.")
        if found.st_size > largest:
            raise FileError(f"{path}: larger than {largest / 1e6:g} MB; a mechanism needs less.")
        return path.read_bytes()
    except FileNotFoundError:
        raise FileError(f"{path}: no such file.") from None
    except OSError as error:
        raise FileError(f"{path}: cannot be read: {error.strerror}.") from error
