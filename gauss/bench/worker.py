"""A process of its own for code that may hang or kill the interpreter: it is asked, watched, and started again."""

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import Any

START = 120.0  # [s] that a new process may take to import what it needs
# So that backends are compared, not threads; the last is for solvers in Rust.
ONE_THREAD = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "RAYON_NUM_THREADS"), "1")
ONE_THREAD |= {"XLA_FLAGS": "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"}  # JAX
# Exit codes of a process that a timer has ended, and the time that the timer measures.
TIMERS = {-signal.SIGPROF: "CPU", -signal.SIGALRM: "wall"} if hasattr(signal, "SIGPROF") else {}
STARTING = threading.Lock()  # the environment that a new process inherits is that of all threads


@dataclass(frozen=True)
class Reply:
    """Outcome of a call."""

    outcome: str  # "answered", "raised", "crashed" or "timed out"
    value: Any = None  # what the function returned; None if it did not
    reason: str = ""  # what went wrong, in words


class Worker:
    """A process that calls functions one after another; whatever happens to it, the caller goes on.

    Use it in a ``with`` block, which ends the process.

    Parameters
    ----------
    environment : dict, optional
        Environment variables of the process, beside those of one thread.
    """

    def __init__(self, environment: dict[str, str] | None = None):
        self.environment = ONE_THREAD | (environment or {})
        self.context = multiprocessing.get_context("spawn")
        self.process: BaseProcess | None = None
        self.pipe: Connection | None = None

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.stop()

    def call(self, function: Callable, *arguments, timeout: float) -> Reply:
        """Call an importable function with arguments that can be pickled; wait no longer than the timeout [s]."""
        process, pipe = self._running()
        try:
            pipe.send((function, arguments))
            if not pipe.poll(timeout):
                self.stop()
                return Reply("timed out", reason=f"no answer within {timeout:g} s")
            return Reply(*pipe.recv())
        except (EOFError, BrokenPipeError, ConnectionResetError):
            process.join()
            code = process.exitcode
            self.stop()
            if code in TIMERS:
                return Reply("timed out", reason=f"the {TIMERS[code]} time of a call was over")
            return Reply("crashed", reason=f"the process of the solver died: {_death(code)}")

    def stop(self):
        """End the process, whatever it does."""
        process, pipe = self.process, self.pipe
        self.process = self.pipe = None
        if process is not None and pipe is not None:
            process.kill()
            process.join()
            pipe.close()

    def _running(self) -> tuple[BaseProcess, Connection]:
        """The process and the pipe to it; it is started where there is none."""
        if self.process is not None and self.pipe is not None:
            return self.process, self.pipe
        pipe, far = self.context.Pipe()
        self.pipe = pipe
        self.process = process = self.context.Process(target=_serve, args=(far,), daemon=True)
        with STARTING, _environment(self.environment), _uninterrupted():
            process.start()
        far.close()
        if not pipe.poll(START) or pipe.recv() != "ready":
            self.stop()
            raise RuntimeError(f"a worker process did not start within {START:g} s.")
        return process, pipe


class Workers:
    """Workers by name, made when they are first asked for; a ``with`` block ends them all."""

    def __init__(self):
        self.named: dict[str, Worker] = {}

    def __enter__(self):
        return self

    def __exit__(self, *_):
        for worker in self.named.values():
            worker.stop()

    def __getitem__(self, name: str) -> Worker:
        return self.named.setdefault(name, Worker())


def _serve(pipe):
    """Answer calls until the caller is gone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # an interruption is for the caller, who then ends this process
    pipe.send("ready")
    while True:
        try:
            function, arguments = pipe.recv()
        except EOFError:
            return
        try:
            pipe.send(("answered", function(*arguments), ""))
        except Exception as error:  # reported, not hidden
            pipe.send(("raised", None, f"{type(error).__name__}: {error}"))


@contextmanager
def _environment(given: dict[str, str]):
    before = {name: os.environ.get(name) for name in given}
    os.environ.update(given)
    try:
        yield
    finally:
        for name, value in before.items():
            os.environ.pop(name) if value is None else os.environ.update({name: value})


@contextmanager
def _uninterrupted():
    """Hold back interruptions, so that a process that starts here never sees one: not even while it imports."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _death(code: int | None) -> str:
    if code is not None and code < 0:
        return signal.Signals(-code).name
    return f"exit code {code}"
