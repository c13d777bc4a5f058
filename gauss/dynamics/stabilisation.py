"""Control of drift: how a motion is kept on its constraints, of which its equations know the second derivatives only."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from gauss.errors import SimulationError, did_you_mean
from gauss.system import State, System

STABILISATIONS = ("projection", "partitioning", "baumgarte", "ggl", "none")
QUICKER = 5.0  # errors vanish so many times faster than the mechanism moves


@dataclass(frozen=True)
class Baumgarte:
    """Accelerations −2α ċ − β² c are added along the constraints, so that errors die out like e^(−αt).

    The gains do not depend on the step: within a step c is of lower order, and gains that grow as steps shrink would cost
    the order of the method.

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
    """What is done against drift.

    Attributes
    ----------
    settles : bool
        Whether position and velocity are projected after each step, in the mass metric.
    gains : tuple of float or None
        α and β of Baumgarte's method [1/s].
    partitioned : bool
        Whether dependent coordinates follow from the others, see
        :mod:`gauss.simulation.compiled_steps.coordinate_partitioning`.
    """

    settles: bool = True
    gains: tuple[float, float] | None = None
    partitioned: bool = False


def drift(system: System, stabilisation: "str | Baumgarte", start: State) -> Drift:
    """Return what a name or a :class:`Baumgarte` stands for.

    Raises
    ------
    SimulationError
        If there is no such name.
    """
    if isinstance(stabilisation, Baumgarte):
        alpha = _gain(system, start) if stabilisation.alpha is None else stabilisation.alpha
        return Drift(False, (alpha, alpha if stabilisation.beta is None else stabilisation.beta) if system.closes else None)
    if stabilisation not in STABILISATIONS:
        raise SimulationError(f"no stabilisation {stabilisation!r}. {did_you_mean(stabilisation, STABILISATIONS)}")
    if stabilisation == "baumgarte":
        return drift(system, Baumgarte(), start)
    return Drift(stabilisation == "projection", None, stabilisation == "partitioning" and system.closes)


def _gain(system: System, start: State) -> float:
    """Gain from the quicker of two rates: that of the start, and that of falling by the size of the mechanism."""
    scale = system.scale
    falling = np.sqrt(np.linalg.norm(system.scene.gravity) / scale.length)
    rate = max(falling, np.abs(start.v / scale.coordinates).max(initial=0.0), 1.0 / scale.time)
    return float(2.0 ** np.round(np.log2(QUICKER * rate)))
