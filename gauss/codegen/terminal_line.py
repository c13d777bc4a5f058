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
COUNTED = " functions made: {}"
CLEARED = "\r\x1b[K"  # start of the line, all erased

_lock = Lock()


class TerminalLine:
    """Line of one context: it counts the functions that are made inside.

    Attributes
    ----------
    state : str
        "waits" until the timer writes the line, then "shown"; "gone" at its end.
    made : int
        Functions made so far.
    """

    def __init__(self):
        self.state, self.made = "waits", 0

    def show(self):
        """Write the line, unless the code is there already."""
        with _lock:
            if self.state == "waits":
                self.state = "shown"
                self._write(TEXT)

    def count(self):
        """Count a function that has been made."""
        with _lock:
            self.made += 1
            if self.state == "shown":
                self._write(CLEARED + TEXT + COUNTED.format(self.made))

    def clear(self):
        """Erase the line."""
        with _lock:
            if self.state == "shown":
                self._write(CLEARED)
            self.state = "gone"

    @staticmethod
    def _write(text: str):
        print(text, end="", file=sys.stderr, flush=True)


_line: ContextVar[TerminalLine | None] = ContextVar("line of the code that is made", default=None)


@contextmanager
def compile_notice() -> Iterator[None]:
    """Context of making machine code: a line on the terminal if it takes long, gone at its end.

    Nothing appears in a run whose progress is not shown; another such context inside counts as a function of the first.
    """
    run, outer = Run.current(), _line.get()
    if outer is not None:
        yield
        outer.count()
        return
    if not (sys.stderr is not None and sys.stderr.isatty()) or not (run is None or run.shown):
        yield
        return
    line = TerminalLine()
    timer, token = Timer(SLOW, line.show), _line.set(line)
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
        _line.reset(token)
        line.clear()
