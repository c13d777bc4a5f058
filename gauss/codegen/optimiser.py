"""Background thread that optimises quick code, unit by unit.

LLVM runs without Python's global lock, so that motions go on meanwhile. The thread ends when nothing is left to be
optimised; it is stopped, at the end of its unit, before a fork and at the end of the process, which does not wait for a
long one. It rests while code is being made: the first motion has the processor, and LLVM, for itself. Code whose system is
gone is not optimised.
"""

import atexit
import os
import time
import weakref
import zlib
from collections.abc import Iterator
from contextlib import suppress
from threading import Condition, Thread, current_thread

from gauss.codegen import object_cache
from gauss.codegen.linking import linked
from gauss.codegen.object_cache import packed, unpacked
from gauss.codegen.object_code import optimised_objects
from gauss.codegen.process_end import can_skip_destructors, skip_destructors
from gauss.codegen.tiers import AUTO, OPTIMISED, QUICK, VARIABLE, MachineCode, Run, reset_after_fork, wanted

REST = 0.1  # pause after code was made [s]: the next module of the same motion may follow
LONGEST_STOP = 30.0  # wait for the end of a unit [s]: one takes some 0.2 s, many times more on a busy machine
LONGEST_END = 2.0  # the same at the end of a process that may end in the middle of a unit [s]: of 1000 links one takes 20 s
MOST_FAILURES = 5  # number of failures that are kept


class Job:
    """Optimisation of the code of one module.

    Parameters
    ----------
    code : MachineCode
        Quick code, held weakly.
    """

    def __init__(self, code: MachineCode):
        self.code = weakref.ref(code)
        self._objects: list[bytes] = []
        self._units: Iterator[bytes] | None = None

    def advance(self) -> bool:
        """Optimise one unit; whether nothing is left to be done."""
        code = self.code()
        if code is None or code.source is None:
            return True
        if self._units is None:
            content = object_cache.read(code.key)  # another process may have been quicker
            if content is not None:
                code.offer_optimised(linked(unpacked(content)))
                return True
            text, optimise = code.source
            self._units = optimised_objects(zlib.decompress(text).decode(), optimise)
        for unit in self._units:
            self._objects.append(unit)
            return False
        object_cache.write(code.key, packed(self._objects))
        object_cache.remove(code.key + object_cache.QUICK_SUFFIX)
        code.offer_optimised(linked(self._objects))
        return True


class Optimiser:
    """Queue of jobs, and the thread that does them.

    Attributes
    ----------
    failures : list of str
        Errors of jobs that failed; their code stays quick.
    """

    def __init__(self):
        self.failures: list[str] = []
        self._reset([])

    def _reset(self, jobs: list[Job]):
        self._jobs, self._changed = jobs, Condition()
        self._thread: Thread | None = None
        self._resume, self._waiting, self._stops = 0.0, 0, 0

    def add(self, code: MachineCode):
        """Optimise code in the background, later."""
        with self._changed:
            self._jobs.append(Job(code))
        self.rest()
        self.start()

    def rest(self):
        """Leave the processor to code that is being made."""
        self._resume = time.monotonic() + REST

    def left(self) -> int:
        """Number of modules to be optimised."""
        with self._changed:
            self._jobs = [job for job in self._jobs if job.code() is not None]
            return len(self._jobs)

    def status(self) -> str:
        """Tier of code that is made now, what is left to be optimised, and what failed."""
        tier, left = wanted(), self.left()
        words = {
            AUTO: "quick first, optimised in the background",
            QUICK: "quick only",
            OPTIMISED: "optimised before it runs",
        }
        waiting = f"; modules that are being optimised: {left}" if left else ""
        failed = f"; optimisation failed, the code stays quick: {'; '.join(self.failures)}" if self.failures else ""
        return f"{words[tier]} ({VARIABLE}={tier}){waiting}{failed}"

    def wait(self, timeout: float | None = None) -> bool:
        """Wait until all code is optimised; whether it is."""
        self.start()
        with self._changed:
            self._waiting += 1
            self._changed.notify_all()
            try:
                return self._changed.wait_for(lambda: not self._jobs or self._thread is None, timeout) and not self._jobs
            finally:
                self._waiting -= 1

    def start(self):
        """Start the thread, if there is something to be done."""
        with self._changed:
            if self._thread is None and self._jobs and not self._stops:
                thread = Thread(target=self._work, name="gauss optimiser", daemon=True)
                with suppress(RuntimeError):  # no more threads, or the interpreter is about to end: the code stays quick
                    thread.start()
                    self._thread = thread

    def stop(self, longest: float = LONGEST_STOP):
        """Stop the thread at the end of its unit, until :meth:`go_on`; wait for it no longer than this [s]."""
        with self._changed:
            self._stops += 1
            self._changed.notify_all()
            thread = self._thread
        if thread is not None and thread is not current_thread():
            thread.join(longest)

    def end(self):
        """Stop the thread for the end of the process: LLVM must not run while its destructors do."""
        try:
            self.stop(LONGEST_END if can_skip_destructors() else LONGEST_STOP)
        finally:  # also of a wait that Ctrl-C ends
            if self._thread is not None:
                skip_destructors()

    def go_on(self):
        """Take back a :meth:`stop`."""
        with self._changed:
            self._stops -= 1
        self.start()

    def in_child(self):
        """Begin anew in a forked process, with the same jobs."""
        reset_after_fork()
        self._reset(self._jobs)
        self.start()

    def _work(self):
        while (job := self._next()) is not None:
            try:
                done = job.advance()
            except Exception as error:  # whatever it is, the quick code goes on
                done = True
                self.failures[MOST_FAILURES - 1 :] = [f"{type(error).__name__}: {error}"]
            if done:
                with self._changed:
                    self._jobs = [other for other in self._jobs if other is not job]
                    self._changed.notify_all()

    def _next(self) -> Job | None:
        """Job to be advanced; None where the thread is to end."""
        with self._changed:
            while not self._stops and self._jobs:
                rest = 0.0 if self._waiting else self._resume - time.monotonic()
                if rest <= 0.0:
                    return self._jobs[0]
                self._changed.wait(rest)
            self._thread = None
            self._changed.notify_all()
            return None


OPTIMISER = Optimiser()


def one_tier(tier: str = AUTO, shown: bool = True) -> Run:
    """Context in which no machine code changes its tier, also a decorator.

    Parameters
    ----------
    tier : str
        Tier of the code that is made in it; with "optimised", all code is optimised first.
    shown : bool
        Whether its progress may be shown.
    """
    if tier == OPTIMISED:
        OPTIMISER.wait()
    return Run(tier, shown)


atexit.register(OPTIMISER.end)
if hasattr(os, "register_at_fork"):
    os.register_at_fork(before=OPTIMISER.stop, after_in_parent=OPTIMISER.go_on, after_in_child=OPTIMISER.in_child)
