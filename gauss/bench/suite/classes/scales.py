"""One mechanism in many units, and with masses orders apart: errors that absolute residuals do not show."""

from collections.abc import Iterator
from functools import partial

import numpy as np
from scipy import sparse

from gauss.bench.scenes import chain
from gauss.bench.suite.bodies import stack
from gauss.bench.suite.classes.mechanisms import anywhere, of_compulsion
from gauss.bench.suite.instance import SuiteInstance, programme

UNITS = {
    "m kg": (1.0, 1.0, "m/s²"),
    "mm g": (1e3, 1e3, "mm/s²"),
    "km t": (1e-3, 1e-3, "km/s²"),
    "um mg": (1e6, 1e6, "um/s²"),
}
LINKS = 8


def recipes() -> Iterator:
    """Names and constructors of the instances."""
    for units in UNITS:
        yield f"scales {units}", partial(_units, units)
    for digits in (3, 6, 9, 12):
        heavy, light = [1.0] * (LINKS - 1) + [10.0**digits], [1.0] * (LINKS - 1) + [10.0**-digits]
        in_turn = [1.0, 10.0**digits] * (LINKS // 2)
        yield f"scales heavy tip 1e{digits}", partial(_masses, f"heavy tip 1e{digits}", heavy)
        yield f"scales light tip 1e-{digits}", partial(_masses, f"light tip 1e-{digits}", light)
        if digits < 12:
            yield f"scales in turn 1e{digits}", partial(_masses, f"in turn 1e{digits}", in_turn)
    for digits in (1, 2, 3, 4, 6):
        yield f"scales stack 1e{digits}", partial(_stack, digits)


def _units(units: str) -> SuiteInstance:
    length, mass, acceleration = UNITS[units]
    scene = chain([mass] * LINKS, length=length, gravity=9.81 * length)
    story = f"Chain of {LINKS} rods of 1 m and 1 kg in {units.replace(' ', ' and ')}."
    return of_compulsion(f"scales {units}", "scales", story, anywhere(scene), units=("rad/s²", acceleration))


def _masses(name: str, masses: list[float]) -> SuiteInstance:
    story = f"Chain of {LINKS} rods whose masses are {name}: no residual in newtons notices the light ones."
    return of_compulsion(f"scales {name}", "scales", story, anywhere(chain(masses)))


def _stack(digits: int) -> SuiteInstance:
    """Cubes on each other, each heavier than the one below by a power of two near a power of ten."""
    heap = stack(3, ratio=2.0 ** round(digits * np.log2(10.0)), push=None)
    load = heap.load.copy()
    load[:, :2] += heap.mass[:, None] * (0.5, 0.25)
    rows = heap.rows(heap.normal)
    story = f"Three cubes on each other, each 1e{digits} times as heavy as the one below and pushed to tilt."
    M, h = sparse.diags_array(heap.weights), np.zeros(rows.shape[0])
    return programme(f"scales stack 1e{digits}", "scales", story, M, -load.ravel(), G=-rows, h=h, **heap.names())
