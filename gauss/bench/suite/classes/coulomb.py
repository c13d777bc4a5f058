"""Coulomb's law of friction: u_n ≥ 0, r_n ≥ 0, u_n r_n = 0, |r_t| ≤ μ r_n, and r_t against u_t where it slides."""

from collections.abc import Iterator
from functools import partial

import numpy as np

from gauss.bench.suite.bodies import balls, stack, table
from gauss.bench.suite.classes.cones import forces, heaps


def recipes() -> Iterator:
    """Names and constructors of the instances."""
    for name, heap, friction in heaps():
        yield f"coulomb {name}", partial(forces, "coulomb", f"coulomb {name}", heap, friction)
    for legs in (3, 6, 8, 12):
        load = np.zeros((1, 6))
        load[0] = (0.5, 1.0, 0.25, 3.0, -1.0, 0.0)
        heap = table(legs, height=0.5, push=4.0 * load)
        yield f"coulomb table {legs}", partial(forces, "coulomb", f"coulomb table {legs}", heap, 0.25)
    for ratio in (4.0, 16.0, 64.0):
        load = np.zeros((3, 6))
        load[1, 3] = 8.0 * ratio
        heap = stack(3, ratio=ratio, push=load)
        yield f"coulomb stack ratio {ratio:g}", partial(forces, "coulomb", f"coulomb stack ratio {ratio:g}", heap, 0.5)
    for seed in (1, 2, 3):
        yield f"coulomb balls seed {seed}", partial(forces, "coulomb", f"coulomb balls seed {seed}", balls(5, seed), 0.25)
