"""References: Taylor's method in 80 bits, whose sums carry three digits more; for ladders, their one equation of motion."""

import numpy as np

from benchmarks.work_precision.scenes import TimedScene
from gauss.bench.precision import ReferencePositions, reference
from gauss.system import System

TOLERANCE = 1e-18


def find(case: TimedScene, system: System) -> ReferencePositions:
    """Reference of a case; by two methods of gauss where heyoka is not installed."""
    try:
        from benchmarks.work_precision.heyoka_ import HeyokaTaylor
    except ImportError:
        return reference(system, case.duration)
    if case.windows:
        return ReferencePositions(_ladder(case, system), np.nan, "one equation of motion; Taylor in 80 bits")
    taylor = HeyokaTaylor(system, TOLERANCE, np.longdouble)
    taylor.move(case.duration)
    positions = taylor.centres()
    return ReferencePositions(positions, np.nan, "Taylor in 80 bits")


def _ladder(case: TimedScene, system: System) -> np.ndarray:
    """Centres of mass of a ladder whose cranks turn alike: ((n + 1)/3 + n) l θ̈ = g ((n + 1)/2 + n) sin θ."""
    import heyoka as hy

    n, (angle, rate) = case.windows, hy.make_vars("angle", "rate")
    g, one = np.longdouble(9.81), np.longdouble(1)
    factor = g * ((n + 1) / (2 * one) + n) / ((n + 1) / (3 * one) + n)
    equations = [(angle, rate), (rate, hy.expression(factor) * hy.sin(angle))]
    start, kind = np.array([0, 1], dtype=np.longdouble), np.longdouble
    integrator = hy.taylor_adaptive(equations, start, tol=kind(TOLERANCE), fp_type=kind)
    integrator.propagate_until(np.longdouble(case.duration))
    x, y = np.sin(integrator.state[0]), np.cos(integrator.state[0])
    places = {f"crank{i}": (i + x / 2, y / 2, 0) for i in range(n + 1)}
    places |= {f"coupler{i}": (i - 0.5 + x, y, 0) for i in range(1, n + 1)}
    return np.array([places[name] for name in system.structure.bodies], dtype=float)
