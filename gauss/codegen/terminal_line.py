"""Line on the terminal while machine code is made for more than a second.

A timer writes it, for the thread that traces and compiles is busy; without a terminal there is no timer.
"""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from threading import Lock, Timer

from gauss.codegen.tiers import Run

SLOW = 1.0  # a line appears where code is made for longer than this [s]
TEXT = "gauss: making machine code …"
CLEARED = "\r\x1b[K"  # start of the line, all erased

_is_making: ContextVar[bool] = ContextVar("is making", default=False)
_lock = Lock()


@contextmanager
def compile_notice() -> Iterator[None]:
    """Context of making machine code: a line on the terminal if it takes long, gone at its end.

    Nothing appears in a run whose progress is not shown, and inside another such context.
    """
    run = Run.current()
    if _is_making.get() or not (sys.stderr is not None and sys.stderr.isatty()) or not (run is None or run.shown):
        yield
        return
    written: list[bool] = []  # what happened first: the line, or the end

    def write():
        with _lock:
            if not written:
                written.append(True)
                print(TEXT, end="", file=sys.stderr, flush=True)

    timer, token = Timer(SLOW, write), _is_making.set(True)
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
        _is_making.reset(token)
        with _lock:
            if written:
                print(CLEARED, end="", file=sys.stderr, flush=True)
            written.append(False)
