"""Tiered compilation: numpy first, machine code once evaluations have taken about as long as compiling will.

So a motion takes at most twice as long as with the better of both. The time to compile grows with the number of operations,
which is known once the equations are traced; tracing costs little. Thresholds are numbers of evaluations. Those of a motion
are counted from its start, whatever was compiled before: numpy and machine code differ by rounding, and a motion is to be
the same to the last digit in every run.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.rules import Plan
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

    ``evaluations``: number of evaluations before machine code is made.
    """

    def __init__(self, evaluations: int):
        self.left = evaluations

    def passed(self) -> bool:
        """Count one evaluation; whether it is beyond the threshold."""
        self.left -= 1
        return self.left < 0 or _at_once.get()


class TieredFunction:
    """A function that is replaced by a faster one above the compile threshold.

    ``function``: the first tier. ``make``: () → the second tier. ``evaluations``: number of evaluations of the first tier
    that take as long as making the second; that of refined dynamics when not given.
    """

    def __init__(self, function: Callable, make: Callable[[], Callable], evaluations: int | None = None):
        evaluations = COMPILE_THRESHOLD if evaluations is None else evaluations
        self.function, self.threshold = function, CompileThreshold(evaluations - 1)  # the last counted one compiles
        self.make: Callable[[], Callable] | None = make

    def __call__(self, *args, **kwargs):
        """Value of the function of the current tier."""
        make = self.make  # another thread may have called it in between
        if make is not None and self.threshold.passed():
            self.function, self.make = make(), None
        return self.function(*args, **kwargs)


def tiered_kernels(system: System, plan: Plan, laws: Laws, spent: int) -> Kernels | None:
    """Machine code of a phase; None where the plan is not to compile, below the threshold, and with opaque laws.

    ``system``: one without obstacles (see :func:`gauss.dynamics.conditions.obstacles`). ``plan``: of the phase, see
    :data:`gauss.dynamics.plan.MODES`: "compiled" has no threshold, "tiered" has one. ``spent``: evaluations of the phase by
    numpy in this motion.
    """
    if laws.called or plan.dynamics not in ("compiled", "tiered"):
        return None
    program = cached(system, (Program, laws.key), lambda: Program(system, laws, Drift()))
    if plan.dynamics == "compiled" or _at_once.get():
        return program.cached_kernels
    if spent < LEAST_THRESHOLD:
        return None
    operations = cached_on_disk(system, (tiered_kernels, laws.key), lambda: sum(program.rates.operations().values()))
    return program.cached_kernels if spent >= LEAST_THRESHOLD + PER_OPERATION * operations else None
