"""Rows that depend on each other: overconstrained loops, and repeated rows; x is unique, the multipliers are not.

Rows of mechanisms depend on each other but for the rounding of their entries: each is kept to some sixteen digits, and
the rest is reported as the contradiction of the reference. Repeated rows, and sums of others, do so exactly.
"""

from collections.abc import Iterator
from functools import partial

import numpy as np
from scipy import sparse

from gauss.bench.suite.bodies import table
from gauss.bench.suite.classes.mechanisms import loaded, of_compulsion, started
from gauss.bench.suite.instance import SuiteInstance, programme

LOOPS: dict[str, dict] = {
    "four_bar": {},
    "parallelogram": {},
    "slider_crank": {},
    "bricard": {},
    "cardan": {},
    "planetary_gears": {},
}
GRID = 2.0**10  # entries are multiples of its inverse, so that sums of rows are exact


def recipes() -> Iterator:
    """Names and constructors of the instances."""
    for name in LOOPS:
        yield f"redundant {name}", partial(_loop, name, name, {})
    for n in (2, 5, 10, 20):
        yield f"redundant ladder {n}", partial(_loop, f"ladder {n}", "n_four_bar", {"n": n})
    for n in (6, 24):
        yield f"redundant hung chain {n}", partial(_loop, f"hung chain {n}", "hung_chain", {"n": n})
    for seed, copies in enumerate((1, 2, 4, 8, 12)):
        yield f"redundant sums {copies}", partial(_sums, copies, seed)
    for legs in (6, 10, 16):
        yield f"redundant legs twice {legs}", partial(_legs_twice, legs)


def _loop(title: str, name: str, options: dict) -> SuiteInstance:
    story = f"Mechanism {name} {options or ''} at its start under random loads: rows of its loops that say the same."
    return of_compulsion(f"redundant {title}", "redundant", story, started(loaded(name, **options)))


def _sums(copies: int, seed: int) -> SuiteInstance:
    rng = np.random.default_rng(seed)
    n, m = 24, 12
    A = np.round(GRID * rng.standard_normal((m, n)) * (rng.random((m, n)) < 0.4)) / GRID + np.eye(m, n)
    b = np.round(GRID * rng.standard_normal(m)) / GRID
    T = rng.integers(-2, 3, (copies, m)).astype(float)
    story = f"{m} rows of couplings between 24 masses, and {copies} exact sums of them: consistent to the last digit."
    names = {"variables": tuple(f"mass{i}.acceleration" for i in range(n)), "units": ("m/s²",) * n}
    weights = 2.0 ** rng.integers(-3, 4, n)
    q = np.round(GRID * rng.standard_normal(n)) / GRID
    rows, right = np.vstack([A, T @ A]), np.concatenate([b, T @ b])
    return programme(f"redundant sums {copies}", "redundant", story, np.diag(weights), q, A=rows, b=right, **names)


def _legs_twice(legs: int) -> SuiteInstance:
    push = np.array([[4.0, -2.0, 0.0, 1.0, 0.0, 0.0]])
    heap = table(legs, push=push)
    J = heap.rows(heap.normal)
    G = -sparse.vstack([J, J, 2.0 * J])
    story = f"Table on {legs} legs, each of them said three times in two scales."
    M = sparse.diags_array(heap.weights)
    title = f"redundant legs twice {legs}"
    return programme(title, "redundant", story, M, -heap.load.ravel(), G=G, h=np.zeros(3 * legs), **heap.names())
