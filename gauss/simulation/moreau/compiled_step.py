"""Compiled step of Moreau–Jean time stepping, traced from the equations of one step, for compiled loops of fixed steps.

The method state is the contact forces of the last step, from which the solver of the next one starts, the share of that step
in which coordinates moved with the rates before it, and the largest residual of the contact and friction laws so far; of
single motions also the contact modes after the step, which events are found from.
"""

from typing import TYPE_CHECKING

import numpy as np

from gauss import math
from gauss.codegen import write
from gauss.codegen.kernels import FirstAccepted, Fixed, FixedStepBatchLoop, Notes
from gauss.dynamics.contact.implicit_damping import traced_damping
from gauss.dynamics.contact.moreau_step import (
    MIDPOINT,
    MISSED_CLOSING_RATE,
    MoreauStepper,
    advance_positions,
    advance_rates,
)
from gauss.dynamics.traced_system import FINITE_SUM, Program, largest
from gauss.integrators import Point, method_state_of
from gauss.simulation.compiled_steps.loop_functions import batch_loop
from gauss.simulation.moreau.moreau_jean import KnownRates, time_step

if TYPE_CHECKING:
    from gauss.codegen.gpu.batches import DeviceFixedStepLoop


def compiled_steps(stepper: MoreauStepper, program: Program) -> Fixed:
    """Functions of the step loop.

    Parameters
    ----------
    stepper : Stepper
        Unilateral and set-valued elements.
    program : Program
        The system without these, with the size of the method state.
    """
    layout, system, laws = program.layout, program.system, stepper.laws
    tried = len(stepper.shares)
    noted = layout.memory - method_state_size(stepper)  # codes of contact modes
    slides, n = slice(laws.normal.size, laws.normal.size + laws.across.size), stepper.lossy.size

    def step(x, h, share=(0.0,)):
        point, h, share = layout.point(x), h[0], share[0]
        method_state = method_state_of(point)
        v, before = point.state.v, method_state[:n] * (1.0 / stepper.unit)
        state, rest = advance_positions(system, point.state, h, share), stepper.rest(v)
        touch, (mechanism, first) = stepper.relative(stepper.kernel.written(state)), program.instant(state)
        H, damped = traced_damping(stepper.damping, state, stepper.compliance(mechanism), h)
        expected = H @ (touch.J.T @ before) * (method_state[n] * (1.0 / MIDPOINT))  # zero after an impact
        still = first.acceleration if damped is None else damped.acceleration(first.acceleration)
        later = advance_rates(state, still + expected, h, share)
        _, free = program.instant(later)
        free = free if damped is None else damped.later(free, v, later.v)
        after = stepper.without_forces(touch, free.acceleration, h, rest, share, before)
        limits = MISSED_CLOSING_RATE * (1.0 + largest([*touch.rate, 0.0])), stepper.slow(v)
        force, error, doubtful = stepper.forces(after, h, touch.J, H, before, touch.rate[slides], *limits)
        added = H @ (touch.J.T @ force)
        jam, rates = stepper.forbids(state, added), stepper.over(state, touch, free, v, h, force, added, damped)
        found, _ = time_step(KnownRates(system, rates, share), point, h)
        worst = math.where(error > method_state[n + 1], error, method_state[n + 1])
        kept, losses = [*(force * stepper.unit), share, worst], np.zeros(0)
        if noted:
            modes = stepper.modes.after(touch, free.acceleration, added, force, v, h, rest, share)
            kept, losses = [*kept, *modes[:noted]], modes[noted:]
        end = Point(program.on_trains(found.state), found.work, rates, np.array(kept, dtype=object))
        packed, violation = layout.pack(end), [0.0]
        packed, violation = program.projected(packed) if program.projects else (packed, violation)
        normals = math.where(sum(np.abs(touch.J).ravel()) <= FINITE_SUM, 0.0, 1.0)  # above 0 without a contact normal
        lost = [
            math.where(apart <= -deepest, 1.0, 0.0)
            for apart, deepest in zip(touch.apart, stepper.overlaps.deepest.values(), strict=True)
        ]
        hits = [] if tried == 1 else [sum(stepper.hits(touch, free.acceleration, h, rest, share), 0.0)]
        reached = Point(found.state, found.work, rates)
        passed, oscillated = program.watch.passes(point, reached), program.watch.oscillates(point, reached)
        unseen = math.where(oscillated > passed, oscillated, passed)
        return packed, violation, [1.0, 0.0, doubtful + jam + normals + sum(lost), unseen, *losses], hits

    def check(x):
        point = layout.point(x)
        rates = program.evaluate(point.state)
        return program.watched_point(layout.pack(Point(point.state, point.work, rates, point.method_state)))

    one, check = write(step, layout.size, *[1] * tried, name="moreau_step"), write(check, layout.size, name="check")
    compiled = one if tried == 1 else FirstAccepted(one, stepper.shares)
    first = layout.row + layout.n_v + 3 + n + 2
    notes = Notes(slice(first, first + noted), len(stepper.modes.elements)) if noted else None
    return Fixed(layout.size, layout.row, compiled, program.projection(), check, 1, program.rates, notes)


def compiled_batch(
    stepper: MoreauStepper, program: Program, device: str | None = None
) -> "FixedStepBatchLoop | DeviceFixedStepLoop":
    """Machine code of a batch of motions: one after the other, for the contact problem is solved motion by motion."""
    return batch_loop(program, compiled_steps(stepper, program), width=1, device=device)


def method_state_size(stepper: MoreauStepper) -> int:
    """Numbers of the method state of a batch, without contact modes."""
    return stepper.lossy.size + 2
