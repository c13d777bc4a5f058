"""Instances of the suite of quadratic programmes, which several tests share."""

import pytest

from gauss.bench.suite import CLASSES, instances, recipes

EACH = 3  # instances of a class that are made here; the export makes and checks all
LARGE = ["large net 100"]  # of the large ones: ten thousand unknowns, a thousand of them at a bound
FIRST = (
    "equality panda",
    "contacts stops 4 F2",
    "infeasible clamp 2^-20",
    "unbounded gears 4",
    "coulomb table 3",
    "mpc crane 10",
)


@pytest.fixture(scope="session")
def some():
    """A few instances of each class, the first and others evenly spread."""
    return {kind: instances([kind], _names(kind)) for kind in CLASSES}


@pytest.fixture(scope="session")
def few():
    """One instance of each of the classes that differ in what files hold."""
    return instances(None, FIRST)


def _names(kind: str) -> list[str]:
    names = LARGE if kind == "large" else [recipe.name for recipe in recipes(kind)]
    return names[:: max(1, len(names) // EACH)][:EACH]
