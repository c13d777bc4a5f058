"""How much of a step is resolved: crossings of switching functions, and the defect of opaque laws.

The defect y' − f(t, y) of the dense output (Enright, BIT 29 (1989)) is sampled where laws are opaque: where it would change
the speeds by far more than the error allowed, a law has switched between the stages of the step.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from gauss.rotors.run import RotorRun

DEFECT_PLACES = (0.187, 0.431, 0.569, 0.813)  # of a step: no stages of the integrators
DIFFERENCE_STEP = 1e-4  # of a step, for the slope of the dense output
ALLOWED_DEFECT = 1e5  # errors allowed: defects of smooth laws stay far below
REFUSED_SHARE = 0.5  # of a step that is made instead
SHORTEST_SEARCHED = 1e-6  # of the run: in shorter steps no defect is sought


def resolved_share(run: RotorRun, begin: float, end: float, dense: Callable) -> tuple[float, float | None]:
    """Share of a step in which no law switches unseen, 1 for all of it; and the time of a discontinuity of a law [s]."""
    switching, share, jump = run.switching, 1.0, None
    if switching.surfaces and end - begin > switching.finest:
        share, jump = switching.surfaces.share(begin, end, lambda t: dense(t)[: 2 * run.n_g], switching.finest)
        if jump is not None:
            share = min(share, (jump - begin - switching.finest) / (end - begin))
    if share == 1.0 and switching.opaque and end - begin > SHORTEST_SEARCHED * switching.duration:
        share = REFUSED_SHARE if any(_defective(run, begin, end, dense, place) for place in DEFECT_PLACES) else 1.0
    return share, jump


def _defective(run: RotorRun, begin: float, end: float, dense: Callable, place: float) -> bool:
    """Whether the defect of the speeds at a place in a step exceeds what is allowed."""
    h, speeds = end - begin, slice(run.n_g, 2 * run.n_g)
    times = begin + (place + DIFFERENCE_STEP * np.array([-1.0, 0.0, 1.0])) * h
    y = dense(times)
    slope = (y[speeds, 2] - y[speeds, 0]) / (times[2] - times[0])
    defect = slope - run.phase.instant(times[1], *run.split(y[:, 1])).acceleration
    return bool((h * np.abs(defect) > ALLOWED_DEFECT * (run.atol[speeds] + run.rtol * np.abs(y[speeds, 1]))).any())
