"""Whether fixed steps sample laws of time: within a step, a law that they resolve is nearly a parabola.

A harmonic of which less than about two and a half steps make a period is sampled as another, slower one (aliasing). The law
is compared at irregular places with the parabola through its values at both ends of a step and in the middle.
"""

from collections.abc import Callable, Sequence

import numpy as np

from gauss.codegen import Expression, reachable
from gauss.dynamics.laws.intervals import Interval, enclose

LawOfTime = Callable[[np.ndarray], np.ndarray]  # times (k,) → values (k, m)

EXAMINED_STEPS = 512  # at most, spread over the interval: a fast oscillation lasts, and isolated peaks are found otherwise
PLACES = np.array([0.127, 0.353, 0.618, 0.871])  # relative to the step; no period coincides with all of them
LARGEST_DEFECT = 0.05  # of a law that steps resolve, relative to its range: 2.7 steps a period, then
SAMPLE_DISTANCE = 1e-6  # of a step
LEAST_RANGE = 1e-6  # of a law, relative to its size: less does not count


def laws_of_time(outputs, of_time: Sequence[Expression], clock: Expression) -> LawOfTime | None:
    """Parts of traced laws that depend on the time alone, as one function; None where there are none.

    ``outputs``: values of the laws, in one graph. ``of_time``: nodes that depend on the time alone, and are examined.
    """
    alone = {node.index for node in of_time}
    used = {x.index for node in reachable(outputs) if node.index not in alone for x in node.operands}
    used |= {x.index for x in outputs if isinstance(x, Expression)}
    asked = [node for node in of_time if node.index in used]
    if not asked:
        return None

    def values(times: np.ndarray) -> np.ndarray:
        with np.errstate(all="ignore"):
            found = enclose(asked, {clock.index: Interval.point(times)})
        return np.array([np.broadcast_to(value.low, times.shape) for value in found]).T

    return values


def coarse_steps(law: LawOfTime, begin: float, end: float, step: float, switches: np.ndarray) -> tuple[int, float]:
    """Number of fixed steps that do not resolve a law, estimated from some of them, and the begin of the first [s].

    ``switches`` (k,): times at which the law switches [s]: steps across one are not examined.
    """
    count = max(1, round((end - begin) / step))
    which = np.unique(np.linspace(0, count - 1, min(count, EXAMINED_STEPS)).astype(int))
    starts = begin + which * step
    beside = SAMPLE_DISTANCE * step  # where a switching time is an end of a step, values there may be those of either side
    whole = np.searchsorted(switches, starts - beside) == np.searchsorted(switches, starts + step + beside)
    starts = starts[whole & (starts + step <= end + beside)]
    if not starts.size:
        return 0, np.inf
    x = np.concatenate([[0.0, 0.5, 1.0], PLACES])
    found = law(np.ravel(starts[:, None] + step * x))
    values = found.reshape(starts.size, x.size, -1)
    first, middle, last = np.moveaxis(values[:, :3, None], 1, 0)
    u = PLACES[:, None]
    parabola = first * (1.0 - u) * (1.0 - 2.0 * u) + middle * 4.0 * u * (1.0 - u) + last * u * (2.0 * u - 1.0)
    extent = np.ptp(values, axis=(0, 1))
    counts = extent > LEAST_RANGE * np.abs(values).max(axis=(0, 1))
    off = np.abs(values[:, 3:] - parabola).max(axis=1) > LARGEST_DEFECT * extent
    coarse = (off & counts).any(axis=1)
    return int(np.ceil(coarse.mean() * count)), float(starts[coarse].min(initial=np.inf))
