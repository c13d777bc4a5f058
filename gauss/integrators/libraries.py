"""Integrators of other libraries: SciPy and CVODE for ODEs y' = f(t, y), IDA for DAEs F(t, y, y') = 0."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from gauss.errors import SimulationError

MOST_STEPS = 10_000_000  # between two samples
STALL_WINDOW = 100_000  # evaluations of the residual over which the progress of IDA is measured
LEAST_PROGRESS = 0.01  # of the interval in that window; IDA is stopped below it


class LibrarySolution(NamedTuple):
    """Times (k,), values (k, n), steps, evaluations, factorisations, and the reason of an early stop.

    Steps are 0 where the library does not report them.
    """

    t: np.ndarray
    y: np.ndarray
    steps: int
    evaluations: int
    factorisations: int
    failure: str | None


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
        from scipy.integrate import solve_ivp

        with np.errstate(all="ignore"):  # divergence is reported
            options = {"rtol": max(rtol, 3e-14), "atol": atol, "max_step": largest, "dense_output": len(times) > 2}
            found = solve_ivp(f, (times[0], times[-1]), y0, method=method, **options)
        failure, counts = None if found.success else found.message, (len(found.t) - 1, found.nfev, int(found.nlu))
        if len(times) == 2:
            return LibrarySolution(found.t, found.y.T, *counts, failure)
        t = times[times <= found.t[-1]]
        return LibrarySolution(t, found.sol(t).T, *counts, failure)

    return solve


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
        found = CVODE(rate, max_num_steps=MOST_STEPS, **options).solve(times, y0)
        steps = len(found.t) - 1 if len(times) == 2 else 0
        return LibrarySolution(
            found.t, found.y, steps, found.nfev, int(found.njev), None if found.success else str(found.message)
        )

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

    solver = IDA(watched, algebraic_idx=list(algebraic) or None, max_num_steps=MOST_STEPS, **options)
    found = solver.solve(times, *start)
    steps = len(found.t) - 1 if len(times) == 2 else 0
    failure = None if found.success else monitor.reason or str(found.message)
    return LibrarySolution(found.t, found.y, steps, found.nfev, int(found.njev), failure)


class _StallMonitor:
    """Progress per evaluation: at singular or redundant constraints IDA factors a new matrix in ever smaller steps."""

    def __init__(self, begin: float, end: float):
        self.least, self.before, self.calls, self.reason = LEAST_PROGRESS * (end - begin), begin, 0, ""

    def stalls(self, t: float) -> bool:
        """Whether the integration stalls; called at every evaluation."""
        self.calls += 1
        if self.calls % STALL_WINDOW == 0 and not self.reason:
            if t - self.before < self.least:
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
