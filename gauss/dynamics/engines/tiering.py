"""Tiered compilation: numpy first, machine code once evaluations have taken about as long as compiling will.

So a motion takes at most twice as long as with the better of both. The time to compile grows with the number of operations,
which is known once the equations are traced; tracing costs little. Thresholds are numbers of evaluations.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from threading import Lock

from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.stabilisation import Drift
from gauss.dynamics.store import cached, cached_on_disk
from gauss.dynamics.traced_system import Kernels, Program
from gauss.system import System

COMPILE_THRESHOLD = 500  # certified evaluations that take as long as compiling the assembly, or the refined dynamics
CONTACT_THRESHOLD = 100  # quadratic programmes that take as long as compiling the active set of a few contacts
LEAST_THRESHOLD = 40  # evaluations by numpy that take as long as the machine code of a few operations, 40 ms
PER_OPERATION = 0.015  # further ones for each operation of an evaluation: 0.1 to 0.3 ms of compiling, of 2 to 20 ms by numpy

_at_once: ContextVar[bool] = ContextVar("compiled at once", default=False)


@contextmanager
def compiled_at_once() -> Iterator[None]:
    """Within this context phases and active sets are compiled before their first evaluation, however short the motion is.

    So short motions test machine code; the thresholds only save time.
    """
    token = _at_once.set(True)
    try:
        yield
    finally:
        _at_once.reset(token)


class CompileThreshold:
    """Count of evaluations without machine code.

    Parameters
    ----------
    evaluations : int
        Number of evaluations before machine code is made.
    """

    def __init__(self, evaluations: int):
        self.left = evaluations

    def passed(self) -> bool:
        """Count one evaluation; whether it is beyond the threshold."""
        self.left -= 1
        return self.left < 0 or _at_once.get()


class TieredFunction:
    """A function that is replaced by a faster one above the compile threshold.

    Parameters
    ----------
    function : callable
        The first tier.
    make : callable
        () → the second tier.
    evaluations : int, optional
        Number of evaluations of the first tier that take as long as making the second; that of refined dynamics when not
        given.
    """

    def __init__(self, function: Callable, make: Callable[[], Callable], evaluations: int | None = None):
        evaluations = COMPILE_THRESHOLD if evaluations is None else evaluations
        self.function, self.threshold = function, CompileThreshold(evaluations - 1)  # the last counted one compiles
        self.make: Callable[[], Callable] | None = make

    def __call__(self, *args, **kwargs):
        """Value of the function of the current tier."""
        if self.make is not None and self.threshold.passed():
            self.function, self.make = self.make(), None
        return self.function(*args, **kwargs)


class Tiered:
    """Machine code of one system, for steps formed by Python, shared by motions and phases.

    Parameters
    ----------
    system : System
        One without obstacles (see :func:`gauss.dynamics.conditions.obstacles`).
    """

    def __init__(self, system: System):
        self.system, self.spent = system, 0
        self.programs: dict[str, Program] = {}
        self.made: dict[str, Kernels] = {}
        self._lock = Lock()

    def kernels(self, laws: Laws, spent: int) -> Kernels | None:
        """Machine code for these laws; None below the threshold, and with opaque laws.

        Parameters
        ----------
        laws : Laws
            Loads of the system.
        spent : int
            Evaluations by numpy since the last call.
        """
        with self._lock:
            return self._kernels(laws, spent)

    def _kernels(self, laws: Laws, spent: int) -> Kernels | None:
        self.spent += spent
        if laws.key in self.made:
            return self.made[laws.key]
        at_once = _at_once.get()
        if laws.called or (self.spent < LEAST_THRESHOLD and not at_once):
            return None
        program = self.programs.setdefault(laws.key, Program(self.system, laws, Drift()))
        operations = cached_on_disk(self.system, (Tiered, laws.key), lambda: sum(program.rates.operations().values()))
        if self.spent < LEAST_THRESHOLD + PER_OPERATION * operations and not at_once:
            return None
        return self.made.setdefault(laws.key, program.cached_kernels)


def tiered(system: System) -> Tiered:
    """Machine code of a system, cached from motion to motion."""
    return cached(system, (Tiered,), lambda: Tiered(system))
