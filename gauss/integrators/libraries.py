"""Methods of other libraries: those of SciPy and CVODE of SUNDIALS for ODEs y' = f(t, y), IDA for F(t, y, y') = 0."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from gauss.errors import SimulationError

MOST_STEPS = 10_000_000  # between two samples
MOST_STEPS_IDA = 20_000  # the same of IDA, which at singular or redundant rows would take ever smaller ones


class Found(NamedTuple):
    """Times (k,), values (k, n), steps, evaluations, matrices factored, and why it stopped early, if it did.

    There are 0 steps where the library does not tell.
    """

    t: np.ndarray
    y: np.ndarray
    steps: int
    evaluations: int
    factorisations: int
    failure: str | None


@dataclass(frozen=True)
class Library:
    """Method of a library.

    Parameters
    ----------
    name, title, order, reference, evaluations
        See :class:`gauss.integrators.method.Integrator`; of a method that changes its order, the highest.
    solve : callable
        (f, times, y0, rtol, atol (n,), largest step) → :class:`Found`; every step when there are two times.
    implicit : bool
        Whether it asks for a residual F(t, y, y', out), for (y, y') at the start, and last for the places of algebraic
        variables.
    """

    name: str
    title: str
    order: int
    reference: str
    evaluations: int
    solve: Callable
    implicit: bool = False


def _scipy(method: str) -> Callable:
    def solve(f, times, y0, rtol, atol, largest) -> Found:
        from scipy.integrate import solve_ivp

        with np.errstate(all="ignore"):  # what diverges is reported
            options = {"rtol": max(rtol, 3e-14), "atol": atol, "max_step": largest, "dense_output": len(times) > 2}
            found = solve_ivp(f, (times[0], times[-1]), y0, method=method, **options)
        failure, counts = None if found.success else found.message, (len(found.t) - 1, found.nfev, int(found.nlu))
        if len(times) == 2:
            return Found(found.t, found.y.T, *counts, failure)
        t = times[times <= found.t[-1]]
        return Found(t, found.sol(t).T, *counts, failure)

    return solve


def _cvode(method: str) -> Callable:
    def solve(f, times, y0, rtol, atol, largest) -> Found:
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
        return Found(found.t, found.y, steps, found.nfev, int(found.njev), None if found.success else str(found.message))

    return solve


def _ida(residual, times, start, rtol, atol, largest, algebraic) -> Found:
    try:
        from sksundae.ida import IDA
    except ImportError as error:
        raise SimulationError("IDA needs SUNDIALS: pip install scikit-sundae.") from error
    options = {"rtol": max(rtol, 1e-15), "atol": atol, "max_step": 0.0 if np.isinf(largest) else largest}
    found = IDA(residual, algebraic_idx=list(algebraic) or None, max_num_steps=MOST_STEPS_IDA, **options).solve(
        times, *start
    )
    steps = len(found.t) - 1 if len(times) == 2 else 0
    return Found(found.t, found.y, steps, found.nfev, int(found.njev), None if found.success else str(found.message))


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
