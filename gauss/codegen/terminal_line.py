"""Line on the terminal while machine code is made for more than a second.

A timer writes it, for the thread that traces and compiles is busy; without a terminal there is no timer. Functions are
traced and written one after the other as others call for them: how many there are is known once their module is complete.
Until then the line counts those that are written; after that it says how many of them are compiled.
"""

import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from threading import Lock, Timer

from gauss.codegen.tiers import Run

LINE_DELAY = 1.0  # a line appears where code is made for longer than this [s]
TEXT = "gauss: making machine code …"
WRITTEN = TEXT + " functions written: {}"
COMPILING = "gauss: compiling {} functions"
PARTLY_COMPILED = "gauss: compiling functions, {} of {} done"
CLEARED = "\r\x1b[K"  # start of the line, all erased
DEFINITION = re.compile(r"^define ", re.MULTILINE)

_lock = Lock()


class TerminalLine:
    """Line of one context: it counts the functions that are made inside.

    Attributes
    ----------
    state : str
        "waits" until the timer writes the line, then "shown"; "gone" at its end.
    written : int
        Functions written so far.
    text : str
        What it says, or will say once it is shown.
    """

    def __init__(self):
        self.state, self.written, self.text = "waits", 0, TEXT

    def show(self):
        """Write the line, unless the code is there already."""
        with _lock:
            if self.state == "waits":
                self.state = "shown"
                self._write(self.text)

    def say(self, text: str):
        """Replace the text."""
        with _lock:
            self.text = text
            if self.state == "shown":
                self._write(CLEARED + text)

    def count(self):
        """Count a function that has been written."""
        self.written += 1
        self.say(WRITTEN.format(self.written))

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


def function_written() -> None:
    """Count a function whose code has been written, on the line of this context if there is one."""
    line = _line.get()
    if line is not None:
        line.count()


def units_in_progress(units: list[str]) -> Iterator[str]:
    """Units of a module, each as it is to be compiled; the line of this context says how many functions are done.

    Parameters
    ----------
    units : list of str
        Texts of LLVM IR.
    """
    line, done = _line.get(), 0
    if line is None:
        yield from units
        return
    sizes = [len(DEFINITION.findall(unit)) for unit in units]
    for unit, size in zip(units, sizes, strict=True):
        line.say(PARTLY_COMPILED.format(done, sum(sizes)) if done else COMPILING.format(sum(sizes)))
        yield unit
        done += size


@contextmanager
def compile_notice() -> Iterator[None]:
    """Context of making machine code: a line on the terminal if it takes long, gone at its end.

    Nothing appears in a run whose progress is not shown; inside another such context there is no second line.
    """
    run, outer = Run.current(), _line.get()
    shown = sys.stderr is not None and sys.stderr.isatty() and (run is None or run.shown)
    if outer is not None or not shown:
        yield
        return
    line = TerminalLine()
    timer, token = Timer(LINE_DELAY, line.show), _line.set(line)
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
        _line.reset(token)
        line.clear()
