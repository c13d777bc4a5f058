"""Integrators of other libraries: SciPy and CVODE for ODEs y' = f(t, y), IDA for DAEs F(t, y, y') = 0."""

import signal
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from gauss.errors import SimulationError

MOST_STEPS = 10_000_000  # between two samples
STALL_WINDOW = 100_000  # evaluations of the residual over which the progress of IDA is measured
LEAST_PROGRESS = 1e-5  # of the interval in that window; IDA is stopped below it: the rest would take days
LEAST_PACE = 1e-3  # of the mean progress of the windows before; IDA is stopped below it


class LibrarySolution(NamedTuple):
    """Times (k,), values (k, n), steps, evaluations, factorisations, and the reason of an early stop.

    Steps are 0 where the library does not report them. After Ctrl-C the values end early, too.
    """

    t: np.ndarray
    y: np.ndarray
    steps: int
    evaluations: int
    factorisations: int
    failure: str | None
    interruption: KeyboardInterrupt | None = None


@dataclass(frozen=True)
class Library:
    """Integrator of another library.

    Parameters
    ----------
    name, title, order, reference, evaluations
        See :class:`gauss.integrators.method.Integrator`; the highest order of a variable-order method.
    solve : callable
        (f, times, y0, rtol, atol (n,), largest step) → :class:`LibrarySolution`; at every step where there are only two
        times.
    implicit : bool
        Whether it solves F(t, y, y') = 0: ``solve`` then takes the residual F(t, y, y', out), the pair (y, y') at the start,
        and in the end the indices of algebraic variables.
    """

    name: str
    title: str
    order: int
    reference: str
    evaluations: int
    solve: Callable
    implicit: bool = False

    @property
    def mechanical(self) -> bool:
        """Whether it needs more than accelerations."""
        return self.implicit


def _scipy(method: str) -> Callable:
    def solve(f, times, y0, rtol, atol, largest) -> LibrarySolution:
        from scipy import integrate

        begin, end = float(times[0]), float(times[-1])
        sampled, reached, interruption, failure = len(times) > 2, begin, None, None
        steps: list[tuple] = []  # time, values and interpolant of each, kept at once: an interruption may come in between
        with np.errstate(all="ignore"):  # divergence is reported
            solver = getattr(integrate, method)(f, begin, y0, end, rtol=max(rtol, 3e-14), atol=atol, max_step=largest)
            try:  # the loop of solve_ivp, which loses all steps when it is interrupted
                while solver.status == "running":
                    failure = solver.step()
                    if solver.status == "failed":
                        break
                    if not sampled or solver.t != reached:
                        inside = sampled and np.searchsorted(times, reached) < np.searchsorted(times, solver.t, "right")
                        reached = solver.t
                        steps.append((solver.t, solver.y, solver.dense_output() if inside else None))  # three evaluations
            except KeyboardInterrupt as error:
                interruption = error
        counts = len(steps), solver.nfev, int(solver.nlu)
        return LibrarySolution(*_values(method, times, y0, steps), *counts, failure, interruption)

    return solve


def _values(method: str, times: np.ndarray, y0: np.ndarray, steps: list[tuple]) -> tuple[np.ndarray, np.ndarray]:
    """Times and values at every step, or at the samples that were reached."""
    from scipy.integrate import OdeSolution

    ends, values, pieces = zip(*steps, strict=True) if steps else ((), (), ())
    t = np.array([times[0], *ends])
    if len(times) == 2 or not steps:
        return t, np.array([y0, *values])
    inside = times[times <= t[-1]]
    later_piece = method == "LSODA"  # at the end of a piece; as by solve_ivp
    return inside, OdeSolution(t, pieces, alt_segment=later_piece)(inside).T


class _Interruptible:
    """A callback (…, out) of compiled code, which loses its steps where a callback raises: after Ctrl-C it gives NaN.

    As a context it takes care of Ctrl-C within the compiled code, which Python would raise at the first line of a callback.
    """

    def __init__(self, function: Callable):
        self.function, self.inside = function, False
        self.interruption: KeyboardInterrupt | None = None

    def __enter__(self):
        main = threading.current_thread() is threading.main_thread()
        self.replaced = main and signal.getsignal(signal.SIGINT) is signal.default_int_handler
        if self.replaced:
            signal.signal(signal.SIGINT, self._pressed)
        return self

    def __exit__(self, *_):
        if self.replaced:
            signal.signal(signal.SIGINT, signal.default_int_handler)

    def _pressed(self, number: int, frame):
        if self.inside:
            raise KeyboardInterrupt
        self.interruption = KeyboardInterrupt()

    def __call__(self, *given):
        """Call the function, before the interruption."""
        if self.interruption is None:
            try:
                self.inside = True
                self.function(*given)
                self.inside = False
            except KeyboardInterrupt as error:
                self.inside, self.interruption = False, error
        if self.interruption is not None:
            given[-1][:] = np.nan

    def solution(self, found, steps: int, failure: str | None) -> LibrarySolution:
        """Solution from a result of SUNDIALS, as far as it is one."""
        if self.interruption is None:
            return LibrarySolution(found.t, found.y, steps, found.nfev, int(found.njev), failure)
        kept = np.isfinite(found.y).all(axis=1)
        kept[1:] &= np.arange(1, kept.size) < kept.size - 1  # the last step was in progress
        counts = found.nfev, int(found.njev)
        return LibrarySolution(found.t[kept], found.y[kept], steps, *counts, None, self.interruption)


def _cvode(method: str) -> Callable:
    def solve(f, times, y0, rtol, atol, largest) -> LibrarySolution:
        try:
            from sksundae.cvode import CVODE
        except ImportError as error:
            raise SimulationError("CVODE needs SUNDIALS: pip install scikit-sundae.") from error

        def rate(t, y, out):
            out[:] = f(t, y)

        largest = 0.0 if np.isinf(largest) else largest
        options = {"method": method, "rtol": max(rtol, 1e-15), "atol": atol, "max_step": largest}
        callback = _Interruptible(rate)
        with callback:
            found = CVODE(lambda t, y, out: callback(t, y, out), max_num_steps=MOST_STEPS, **options).solve(times, y0)
        steps = len(found.t) - 1 if len(times) == 2 else 0
        return callback.solution(found, steps, None if found.success else str(found.message))

    return solve


def _ida(residual, times, start, rtol, atol, largest, algebraic) -> LibrarySolution:
    try:
        from sksundae.ida import IDA
    except ImportError as error:
        raise SimulationError("IDA needs SUNDIALS: pip install scikit-sundae.") from error
    options = {"rtol": max(rtol, 1e-15), "atol": atol, "max_step": 0.0 if np.isinf(largest) else largest}
    monitor = _StallMonitor(times[0], times[-1])

    def watched(t, y, slope, out):
        residual(t, y, slope, out)
        if monitor.stalls(t):
            out[:] = np.nan  # ends the integration

    callback, index = _Interruptible(watched), list(algebraic) or None
    with callback:
        options |= {"algebraic_idx": index, "max_num_steps": MOST_STEPS}
        solver = IDA(lambda t, y, slope, out: callback(t, y, slope, out), **options)
        found = solver.solve(times, *start)
    steps = len(found.t) - 1 if len(times) == 2 else 0
    failure = None if found.success else monitor.reason or str(found.message)
    return callback.solution(found, steps, failure)


class _StallMonitor:
    """Progress per evaluation: at singular or redundant constraints IDA factors a new matrix in ever smaller steps."""

    def __init__(self, begin: float, end: float):
        self.begin, self.least = begin, LEAST_PROGRESS * (end - begin)
        self.before, self.calls, self.reason = begin, 0, ""

    def stalls(self, t: float) -> bool:
        """Whether the integration stalls; called at every evaluation."""
        self.calls += 1
        if self.calls % STALL_WINDOW == 0 and not self.reason:
            mean = (self.before - self.begin) / max(self.calls // STALL_WINDOW - 1, 1)
            if t - self.before < max(self.least, LEAST_PACE * mean):
                self.reason = f"it stalls: {STALL_WINDOW} evaluations from t = {self.before:.6g} s to {t:.6g} s"
            self.before = t
        return bool(self.reason)


_HAIRER = "SciPy solve_ivp; Hairer and Wanner"
_SUNDIALS = "SUNDIALS through scikit-sundae; Hindmarsh et al., ACM TOMS 31, 2005"
LIBRARIES = (
    Library("scipy_dop853", "DOP853 of SciPy", 8, _HAIRER, 12, _scipy("DOP853")),
    Library("scipy_radau", "Radau of SciPy", 5, _HAIRER, 12, _scipy("Radau")),
    Library("scipy_lsoda", "LSODA of SciPy, orders to 12", 12, "Petzold 1983; SciPy solve_ivp", 2, _scipy("LSODA")),
    Library("cvode_adams", "CVODE, Adams–Moulton, orders to 12", 12, _SUNDIALS, 2, _cvode("Adams")),
    Library("cvode_bdf", "CVODE, BDF, orders to 5", 5, _SUNDIALS, 2, _cvode("BDF")),
)
IMPLICIT = (Library("ida", "IDA, BDF, orders to 5, index 2 with loops", 5, _SUNDIALS, 2, _ida, implicit=True),)
