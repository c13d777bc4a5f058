"""Rounds of Newton steps on a contact problem, each from the best forces so far.

Projected Gauss–Seidel sweeps may precede the steps of a round. Forces are kept at the least residual that was met; a round
ends early where the residuals are infinite or no numbers.
"""

from collections.abc import Callable
from typing import NamedTuple, Protocol

import numpy as np

from gauss.codegen import INTEGER, constant_array
from gauss.codegen.kernels.arrays import Array, Routine, Value

LARGEST_RESIDUAL_SUM = 1e300  # sum of the residuals above which they count as infinite


class Round(NamedTuple):
    """Round of Newton steps."""

    sweeps: int  # Gauss–Seidel sweeps before it
    # ε, relative to the diagonal of the Delassus matrix: large values change the forces less by a step, and converge
    # linearly where small ones may cycle
    regularisation: float
    steps: int  # Newton steps
    # Factor of the ε of a contact in each step in which its mode (open, sticking, slipping) stays; a change sets ε back. So
    # contacts that cycle move little, and the others as far as without regularisation. 1 keeps ε.
    decay: float = 1.0
    above: float = 1.0  # above, below: residuals, in units of the target, between which the round is made
    below: float = np.inf


class ContactIteration(Protocol):
    """Writer of what a round consists of; ``f`` are the forces, ``best`` the best ones."""

    r: Routine
    f: Array
    best: Array

    def begin_round(self, regularisation: Value, decay: Value):
        """Emit what sets the regularisation of a round."""

    def accumulate(self):
        """Emit the velocities under new forces, where they are kept."""

    def sweep(self):
        """Emit one projected Gauss–Seidel sweep."""

    def residuals(self) -> Value:
        """Emit residuals and their derivatives; returns the largest residual."""

    def newton(self):
        """Emit one Newton step from them."""


def write_rounds(
    code: ContactIteration, name: str, rounds: tuple[Round, ...], n: Value, target: Callable[[], Value], span=None
) -> tuple[Array, Array, Array]:
    """Emit rounds until the residual is at most a target.

    Parameters
    ----------
    code : ContactIteration
        What a round consists of.
    name : str
        Name of the problem in the module.
    n : Value
        Number of forces.
    target : callable
        Emits the target of the residual.
    span : pair of Value, optional
        First round that is made, and the end of these; all by default.

    Returns
    -------
    tuple of Array
        Least residual, numbers of Newton steps and of rounds; each has one entry.
    """
    r, f, best = code.r, code.f, code.best
    with r.each(n) as i:
        best[i] = f[i]
    first, end = span or (0, len(rounds))
    least, done, round_, total = r.variable(np.inf), r.variable(0, INTEGER), r.variable(first, INTEGER), r.variable(0.0)
    columns = zip(Round._fields, zip(*rounds, strict=True), strict=True)
    sweeps, regularisation, steps, decay, above, below = (
        _table(r, f"{name}_{column}", values) for column, values in columns
    )
    with r.loop() as leave_if:
        leave_if((round_[0] >= end) | (done[0] > 0))
        tries = r.variable(steps[round_[0]], INTEGER)
        with r.when((least[0] > target() * above[round_[0]]) & (least[0] <= target() * below[round_[0]])):
            tries[0] = 0
            with r.each(n) as i:
                f[i] = best[i]
            code.accumulate()
            code.begin_round(regularisation[round_[0]], decay[round_[0]])
            with r.each(sweeps[round_[0]]):
                code.sweep()
        with r.loop() as leave_round_if:
            leave_round_if((tries[0] >= steps[round_[0]]) | (done[0] > 0))
            residual = code.residuals()
            with r.when(residual < least[0]):
                least[0] = residual
                with r.each(n) as i:
                    best[i] = f[i]
            with r.when(least[0] <= target()):
                done[0] = 1
            with r.when(done[0] < 1):
                code.newton()
                total[0] = total[0] + 1.0
            tries[0] = tries[0] + 1
            with r.when(residual >= LARGEST_RESIDUAL_SUM):
                tries[0] = steps[round_[0]]
        round_[0] = round_[0] + 1
    with r.each(n) as i:
        f[i] = best[i]
    round_[0] = round_[0] - first
    return least, total, round_


def _table(r: Routine, name: str, values: tuple) -> Array:
    """Constant table of a module."""
    return Array(r.b, r.b.gep(constant_array(r.module, name, np.array(values)), [INTEGER(0), INTEGER(0)]))
