"""End of a process while a thread is in LLVM: without the destructors of its libraries, which would abort it.

The exit functions of C run in reverse order of registration, so that the one that is registered last ends the process before
the destructors of libraries, registered when these were loaded. ``on_exit``, of glibc, hands it the exit code. The exit
functions of Python have run by then, and what was written to files of C is flushed.
"""

import ctypes
import os


def can_skip_destructors() -> bool:
    """Whether the library of C lets a process end without its other exit functions, with its exit code."""
    return os.name == "posix" and hasattr(ctypes.CDLL(None), "on_exit")


def skip_destructors():
    """Let this process end without the exit functions of C that are registered until now, where that can be."""
    if not can_skip_destructors():
        return
    libc = ctypes.CDLL(None)
    libc.on_exit(ctypes.cast(libc._exit, ctypes.c_void_p), None)
    libc.__cxa_atexit(ctypes.cast(libc.fflush, ctypes.c_void_p), None, None)  # called first: of all files
