"""Rows that hold without force, and more of them than freedoms: no strict complementarity, no unique multipliers.

All data are multiples of powers of two, so that what is at the brink is there exactly.
"""

from collections.abc import Iterator
from functools import partial

import numpy as np
from scipy import sparse

from gauss.bench.suite.bodies import stack, table, wall
from gauss.bench.suite.classes.contacts import accelerations
from gauss.bench.suite.instance import SuiteInstance, programme

WEIGHT = 40.0  # [N], of a table


def recipes() -> Iterator:
    """Names and constructors of the instances."""
    for legs in (4, 8, 12):
        for share, where in (
            (0.0, "at rest"),
            (1.0, "at the brink"),
            (1.0 - 2.0**-40, "just before"),
            (1.0 + 2.0**-40, "just after"),
        ):
            yield f"degenerate table {legs} {where}", partial(_table, legs, share, where)
    for count in (2, 4, 8):
        yield f"degenerate stack {count}", partial(_stack, count)
    for columns, rows in ((2, 2), (3, 3)):
        yield f"degenerate wall {columns} x {rows}", partial(_wall, columns, rows)
    for copies in (2, 4):
        yield f"degenerate corner {copies}", partial(_corner, copies)
    for n in (4, 16, 64):
        yield f"degenerate stops {n}", partial(_stops, n)


def _table(legs: int, share: float, where: str) -> SuiteInstance:
    push = np.zeros((1, 6))
    push[0, 1] = -share * WEIGHT  # tilts about the edge at x = −1 m, the weight acting at 1 m from it
    story = (
        f"Table on {legs} legs with a moment of {share:.17g} of what tilts it: {where}, legs beyond the edge carry nothing."
    )
    return accelerations(f"degenerate table {legs} {where}", "degenerate", story, table(legs, push=push))


def _stack(count: int) -> SuiteInstance:
    story = f"{count} cubes on each other at rest, four points where three would do: all accelerations are zero."
    return accelerations(f"degenerate stack {count}", "degenerate", story, stack(count))


def _wall(columns: int, rows: int) -> SuiteInstance:
    story = f"Wall of {columns} × {rows} bricks at rest, or as far as bricks at its end do not tilt."
    return accelerations(f"degenerate wall {columns} x {rows}", "degenerate", story, wall(columns, rows))


def _corner(copies: int) -> SuiteInstance:
    """Mass in a corner whose planes are repeated in several scales, pushed along one of them."""
    planes = np.vstack([2.0**k * np.eye(3) for k in range(copies)])
    story = f"Mass in a corner of three planes, said {copies} times in different scales, pushed along one."
    names = {"variables": ("ax", "ay", "az"), "units": ("m/s²",) * 3}
    h = np.zeros(3 * copies)
    return programme(
        f"degenerate corner {copies}", "degenerate", story, 2 * np.eye(3), [8.0, 0.0, 4.0], G=-planes, h=h, **names
    )


def _stops(n: int) -> SuiteInstance:
    """Masses on springs between stops, a third pushed exactly to the stop, a third beyond it, a third not there."""
    K = sparse.diags_array([-np.ones(n - 1), 4.0 * np.ones(n), -np.ones(n - 1)], offsets=[-1, 0, 1])
    x = np.where(np.arange(n) % 3 == 2, 0.5, 1.0)
    beyond = np.where(np.arange(n) % 3 == 1, 2.0, 0.0)
    story = f"{n} masses on springs before stops at 1 m: a third rests there without force, a third is pressed."
    names = {"variables": tuple(f"mass{i}.x" for i in range(n)), "units": ("m",) * n}
    lower = np.full(n, -2.0)
    return programme(f"degenerate stops {n}", "degenerate", story, K, -(K @ x + beyond), lb=lower, ub=np.ones(n), **names)
