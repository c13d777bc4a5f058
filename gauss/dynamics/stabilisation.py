"""Constraint stabilisation: projection, partitioning, Baumgarte feedback −2α φ̇ − β² φ, or Gear–Gupta–Leimkuhler.

Equations of motion hold the second derivatives of constraints only; position and velocity residuals drift.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from gauss.errors import SimulationError, did_you_mean
from gauss.system import State, System

STABILISATIONS = ("projection", "partitioning", "baumgarte", "ggl", "none")
GAIN_PER_RATE = 5.0  # gain relative to the rate at which the mechanism moves


@dataclass(frozen=True)
class Baumgarte:
    """Accelerations −2α φ̇ − β² φ are added along the constraints, so that residuals decay like e^(−αt).

    The gains do not depend on the step: gains that grow as steps shrink reduce the order of the method.

    Baumgarte, Computer Methods in Applied Mechanics and Engineering 1, 1972.

    Parameters
    ----------
    alpha, beta : float, optional
        Gains [1/s]; equal gains are critically damped. Five times the rate at which the mechanism moves, rounded to a power
        of two, when not given.
    """

    alpha: float | None = None
    beta: float | None = None

    def __post_init__(self):
        for name in ("alpha", "beta"):
            value = getattr(self, name)
            if value is not None and not (np.isfinite(value) and value >= 0):
                raise SimulationError(f"Baumgarte: {name}: expected a number of at least 0, got {value!r}.")


class Drift(NamedTuple):
    """Constraint stabilisation with its gains."""

    projects: bool = True  # whether position and velocity are projected after each step, in the mass metric
    gains: tuple[float, float] | None = None  # α and β of Baumgarte's method [1/s]
    # whether dependent coordinates follow from the independent ones, see
    # :mod:`gauss.simulation.compiled_steps.coordinate_partitioning`
    partitioned: bool = False


def drift(system: System, stabilisation: "str | Baumgarte", start: State) -> Drift:
    """Stabilisation of a name or a :class:`Baumgarte`; SimulationError if there is no such name."""
    if isinstance(stabilisation, Baumgarte):
        alpha = _gain(system, start) if stabilisation.alpha is None else stabilisation.alpha
        return Drift(False, (alpha, alpha if stabilisation.beta is None else stabilisation.beta) if system.closes else None)
    if stabilisation not in STABILISATIONS:
        raise SimulationError(f"no stabilisation {stabilisation!r}. {did_you_mean(stabilisation, STABILISATIONS)}")
    if stabilisation == "baumgarte":
        return drift(system, Baumgarte(), start)
    return Drift(stabilisation == "projection", None, stabilisation == "partitioning" and system.closes)


def _gain(system: System, start: State) -> float:
    """Gain from the larger of two rates: that of the start, and that of free fall by the size of the mechanism."""
    scale = system.scale
    falling = np.sqrt(np.linalg.norm(system.scene.gravity) / scale.length)
    rate = max(falling, np.abs(start.v / scale.coordinates).max(initial=0.0), 1.0 / scale.time)
    return float(2.0 ** np.round(np.log2(GAIN_PER_RATE * rate)))
