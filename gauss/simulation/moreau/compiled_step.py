"""Time stepping as machine code: what a compiled loop of fixed steps calls, traced from the equations of one step.

What a point remembers is the forces of the step that led to it, from which those of the next are looked for, and the largest
error so far with which the laws of contacts and grips are met.
"""

from types import SimpleNamespace

import numpy as np

from gauss import math
from gauss.codegen import write
from gauss.codegen.kernels import FirstAccepted, Fixed
from gauss.dynamics.contact.moreau_step import MISSED_CLOSING_RATE, MoreauStepper, advance_positions, advance_rates
from gauss.dynamics.traced_system import FINITE_SUM, Program, largest
from gauss.integrators import Point
from gauss.simulation.moreau.moreau_jean import time_step


def strides(stepper: MoreauStepper, program: Program) -> Fixed:
    """Functions of time stepping.

    Parameters
    ----------
    stepper : Stepper
        What touches, rubs and holds.
    program : Program
        The system without it, with room for what a point remembers.
    """
    layout, system, laws = program.layout, program.system, stepper.laws
    tried = len(stepper.shares)
    slides, n = slice(laws.normal.size, laws.normal.size + laws.across.size), stepper.lossy.size

    def step(x, h, share=(0.0,)):
        point, h, share = layout.point(x), h[0], share[0]
        v, before = point.state.v, point.memory[:n] * (1.0 / stepper.unit)
        state, rest = advance_positions(system, point.state, h, share), stepper.rest(v)
        touch, (mechanism, first) = stepper.relative(stepper.kernel.written(state)), program.instant(state)
        _, free = program.instant(advance_rates(state, first.acceleration, h, share))
        H = stepper.compliance(mechanism)
        after = stepper.without_forces(touch, free.acceleration, h, rest, share)
        limits = MISSED_CLOSING_RATE * (1.0 + largest([*touch.rate, 0.0])), stepper.slow(v)
        force, error, doubtful = stepper.forces(after, h, touch.J, H, before, touch.rate[slides], *limits)
        added = H @ (touch.J.T @ force)
        jam, rates = stepper.forbids(state, added), stepper.over(touch, free, v, h, force, added)
        found, _ = time_step(SimpleNamespace(system=system, over=lambda point, h: (rates, share)), point, h)
        memory = [*(force * stepper.unit), math.maximum(point.memory[n], error)]
        packed, gap = layout.pack(Point(found.state, found.work, rates, np.array(memory, dtype=object))), [0.0]
        packed, gap = program.projected(packed) if program.projects else (packed, gap)
        sharp = math.where(sum(np.abs(touch.J).ravel()) <= FINITE_SUM, 0.0, 1.0)  # shapes that meet have a normal
        lost = [
            math.where(apart <= -deepest, 1.0, 0.0)
            for apart, deepest in zip(touch.apart, stepper.guarded.values(), strict=True)
        ]
        hits = [] if tried == 1 else [sum(stepper.hits(touch, free.acceleration, h, rest, share), 0.0)]
        unseen = program.watch.passes(point, Point(found.state, found.work, rates))
        return packed, gap, [1.0, 0.0, doubtful + jam + sharp + sum(lost), unseen], hits

    def check(x):
        point = layout.point(x)
        rates = program.evaluate(point.state)
        return program.watched_point(layout.pack(Point(point.state, point.work, rates, point.memory)))

    stride, check = write(step, layout.size, *[1] * tried, name="stride"), write(check, layout.size, name="check")
    stride = stride if tried == 1 else FirstAccepted(stride, stepper.shares)
    return Fixed(layout.size, layout.row, stride, program.projection(), check, 1, program.rates)
