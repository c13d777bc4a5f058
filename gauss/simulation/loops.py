"""Functions that the compiled loop of an integrator calls: one source, written down for the system at hand."""

import numpy as np

from gauss.integrators import Controlled, ExplicitPair, FixedStep, Point, Tolerance
from gauss.kernels import GIVEN, Adaptive, Fixed, Many
from gauss.simulation.mechanics import Mechanics
from gauss.simulation.program import Program
from gauss.simulation.stages import Stages
from gauss.tracing import write


def adaptive(program: Program, method: Controlled) -> Adaptive:
    """Functions of a method that chooses its step."""
    layout, size = program.layout, program.layout.size
    if isinstance(method, ExplicitPair):
        stages = Stages(program, method)
        (trial, dense), dense_evaluations, trimmed = stages.functions(), method.pair.extra_c.size, stages.coefficients
    else:
        trial, dense, dense_evaluations = _written(program, method)
        trimmed = lambda coefficients: coefficients  # noqa: E731

    def sample(x, h, coefficients, t):
        state, work = method.interpolate(program, layout.point(x), h[0], trimmed(coefficients), t[0])
        if program.settles:
            state, _, _ = program.on_constraints(state)
        return [state.t], state.q, state.v, work

    sample = write(sample, size, 1, len(dense.outputs), 1, name="sample")
    settle = write(program.settled, size, name="settle") if program.settles else None
    check = write(program.check, size, name="check")
    return Adaptive(size, layout.row, trial, settle, check, dense, sample, dense_evaluations, program.rates)


def _written(program: Program, method: Controlled):
    """Trial step and dense output written out, and the evaluations of the latter."""
    layout, size = program.layout, program.layout.size
    counts = {}

    def trial(x, h, rtol, atol, atol_rates, refused):
        found = method.attempt(program, layout.point(x), h[0], Tolerance(rtol[0], atol[0], atol_rates[0]))
        counts["kept"] = np.size(found.kept)
        numbers = [found.error, found.factor, found.cost.evaluations, found.cost.factorisations]
        return layout.pack(found.point), numbers, found.kept

    def dense(x, reached, h, kept):
        coefficients, counts["dense"] = method.dense(program, layout.point(x), h[0], kept)
        return coefficients

    trial = write(trial, size, *[1] * len(GIVEN), name="trial")
    return trial, write(dense, size, size, 1, counts["kept"], name="dense"), counts["dense"]


def fixed(program: Program, method: FixedStep) -> Fixed:
    """Functions of a method whose step is given."""
    layout, size = program.layout, program.layout.size
    equations = Mechanics(program) if method.mechanical else program

    def step(x, h):
        reached, cost = method.step(equations, layout.point(x), h[0])
        packed = layout.pack(reached)
        packed, gap = program.settled(packed) if program.settles else (packed, [0.0])
        return packed, gap, [cost.evaluations + int(program.settles), cost.factorisations, cost.unsolved]

    step, check = write(step, size, 1, name="step"), write(program.check, size, name="check")
    return Fixed(size, layout.row, step, check, method.evaluations, program.rates)


def many(program: Program, method: FixedStep) -> Many:
    """Machine code of a method whose step is given, over many motions."""
    layout = program.layout

    def start(x):
        point = layout.point(x)
        return layout.pack(Point(point.state, point.work, program.evaluate(point.state))), [program.gap(point.state)]

    states = slice(1, 1 + layout.n_q + layout.n_v)
    return Many(fixed(program, method), write(start, layout.size, name="start"), states)
