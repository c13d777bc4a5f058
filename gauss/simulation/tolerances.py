"""Local error tolerances given for all coordinates, for a kind of them, or for a joint, as the tolerance of a system."""

import sys
from collections.abc import Mapping
from numbers import Integral

import numpy as np

from gauss.arguments import LARGEST_FLOAT, real_numbers
from gauss.errors import ArgumentError, SimulationError, did_you_mean
from gauss.integrators import Tolerance
from gauss.system import System, rate_units

DEFAULT_ATOL = 1e-12  # relative to the scale of the scene: 1 rad, its length, and these in its time
WHOLE = 1e-9  # share of a step by which a duration may differ from a whole number of steps
KINDS = {"angle": "rad/s", "length": "m/s"}
SCALARS = (float, int)  # exact types that need no array to be checked


def tolerance(system: System, rtol: float, atol) -> Tolerance:
    """Tolerance of a system, of ``atol`` as for :func:`gauss.simulate`.

    SimulationError if there is no such joint, or a number is not positive.
    """
    if atol is None:
        make = lambda: _default(system, rtol)  # noqa: E731
        key = _default, rtol, system.scale.length, system.scale.time
        return make() if system.dynamics is None else system.dynamics.on_demand(key, make)
    if not isinstance(atol, Mapping):
        return Tolerance(rtol, *_pair(atol, "atol"))
    own = _units(system)
    units, joints = list(rate_units(system).values()), {joint.name: joint for joint in system.joints}
    allowed = DEFAULT_ATOL * own
    for kind in sorted(atol, key=lambda name: name in joints):  # joints override kinds
        here = joints[kind].v if kind in joints else [unit == KINDS.get(kind) for unit in units]
        if kind not in joints and kind not in KINDS:
            hint = did_you_mean(str(kind), [*KINDS, *joints])
            raise SimulationError(f"atol: no joint {kind!r}, and no kind of coordinates of this name. {hint}")
        allowed[:, here] = np.array(_pair(atol[kind], f"atol of {kind!r}"))[:, None]
    return Tolerance(rtol, 1.0, 1.0, allowed, float(allowed.min(initial=np.inf)))


def _default(system: System, rtol: float) -> Tolerance:
    own = _units(system)
    return Tolerance(rtol, DEFAULT_ATOL, DEFAULT_ATOL, None if (own == 1.0).all() else own, 1.0)


def shares_of_scale(system: System, share: float) -> dict[str, tuple[float, float]]:
    """Absolute tolerances that are a share of the scale of a system, as a mapping for ``atol``."""
    length, time = system.scale.length, system.scale.time
    return {"angle": (share, share / time), "length": (share * length, share * length / time)}


def _units(system: System) -> np.ndarray:
    """Unit of each coordinate, and of each rate, in the scale of the scene (2, n_v)."""
    return np.array([system.scale.coordinates, system.scale.rates])


def check_tolerances(**numbers):
    """Raise a SimulationError if a value is not a positive number; ``atol`` may be None, a pair or a mapping, too."""
    for name, value in numbers.items():
        if name == "atol":
            if value is not None and not isinstance(value, Mapping):
                _pair(value, name)
        elif not _is_positive(value) or (type(value) not in SCALARS and np.ndim(value)):
            raise SimulationError(f"{name}: expected a positive number, got {value!r}.")
        elif name == "rtol" and value >= 1.0:
            raise SimulationError(f"rtol: expected a number below 1, a share of each coordinate and rate, got {value!r}.")


def step_count(duration, step, what: str) -> int:
    """Number of equal steps of a duration [s], for the function ``what``.

    SimulationError if either is not a positive number; ArgumentError if the duration is no whole number of steps.
    """
    check_tolerances(duration=duration, step=step)
    count = round(duration / step)
    if count < 1 or abs(count * step - duration) > WHOLE * step:
        raise ArgumentError(f"{what}: duration {duration} s is no whole number of steps of {step} s.")
    return count


def _pair(value, what: str) -> tuple[float, float]:
    """Absolute tolerance of coordinates, and of rates."""
    found = None if type(value) in SCALARS else real_numbers(value)
    size = () if found is None else found.shape
    is_pair = bool(size)
    if is_pair and size != (2,):
        raise SimulationError(f"{what}: expected a number, or a pair for coordinates and rates, got {value!r}.")
    if not _is_positive(value):
        raise SimulationError(f"{what}: expected a positive number, got {value!r}.")
    return (float(value[0]), float(value[1])) if is_pair else (float(value), float(value))


def _is_positive(value) -> bool:
    if type(value) in SCALARS:
        return 0.0 < value <= LARGEST_FLOAT
    given = real_numbers(value)
    if given is None or np.asarray(value).dtype == bool:
        return False
    return bool(np.isfinite(given).all() and (given > 0).all())


def checked_count(name: str, value) -> int:
    """A positive whole number; SimulationError if it is none."""
    if not isinstance(value, Integral) or isinstance(value, bool) or not 1 <= int(value) <= sys.maxsize:
        raise SimulationError(f"{name}: expected a positive whole number, got {value!r:.80}.")
    return int(value)
