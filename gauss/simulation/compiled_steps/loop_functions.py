"""Functions that the compiled loop of an integrator calls: one source, written down for the system at hand."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from gauss import math
from gauss.codegen import Scalar, write
from gauss.codegen.kernels import TRIAL_SETTINGS, Adaptive, Fixed, FixedStepBatchLoop, Loop
from gauss.dynamics.traced_system import Program
from gauss.integrators import Controlled, ExplicitPair, FixedStep, Point, Taylor, Tolerance, first_step
from gauss.simulation.compiled_steps.coordinate_partitioning import Partition
from gauss.simulation.compiled_steps.explicit_stages import Stages
from gauss.simulation.compiled_steps.momentum_form import Mechanics
from gauss.simulation.compiled_steps.projected_stages import LoopConstraintBlock, passing
from gauss.simulation.compiled_steps.taylor_step import expanded
from gauss.system import State

CLOSED = 1e-10  # gap, relative to the sizes of the rows, of a state that meets the constraints


def adaptive(program: Program, method: Controlled, many: bool = False, shares=None) -> Adaptive:
    """Functions of a method that chooses its step, for one motion or for many side by side; shares of the tolerance."""
    layout, size = program.layout, program.layout.size
    begin = _beginning(program, method)
    if isinstance(method, ExplicitPair) and not program.drift.partitioned:
        stages = Stages(program, method, many, shares)
        (trial, dense), dense_evaluations, trimmed = stages.functions(), method.pair.extra_c.size, stages.coefficients
    else:
        trial, dense, dense_evaluations = _written(program, method, begin, shares)
        trimmed = lambda coefficients: coefficients  # noqa: E731

    def sample(x, h, coefficients, t):
        equations = begin(layout.point(x))
        state, work = method.interpolate(equations, layout.point(x), h[0], trimmed(coefficients), t[0])
        if program.drift.partitioned:
            state, _ = equations.settled(state)
        if program.projects:
            state, _, _ = program.on_constraints(state)
        return [state.t], state.q, state.v, work

    sample = write(sample, size, 1, len(dense.outputs), 1, name="sample")
    settle, check = program.projection(), write(program.watched_point, size, name="check")
    return Adaptive(size, layout.row, trial, settle, check, dense, sample, dense_evaluations, program.rates)


def single(program: Program, method: Controlled | Taylor, shares=None) -> Loop:
    """Machine code of a method that chooses its step, for one motion; shares of the tolerance.

    Its function "start" is (t, q, v, rtol, atol, atol_rates) → (point, what its check says, first step).
    """
    functions = expanded(program, shares) if isinstance(method, Taylor) else adaptive(program, method, shares=shares)
    check = functions.check

    def begun(t, q, v, rtol, atol, atol_rates):
        state, tolerance = State(t[0], q, v), Tolerance(rtol[0], atol[0], atol_rates[0], shares)
        point, h = beginning(program, method, state, tolerance)
        packed = program.layout.pack(point)
        return packed, check(packed), [h]

    return functions.compile(write(begun, 1, program.layout.n_q, program.layout.n_v, 1, 1, 1, name="start"))


def beginning(program: Program, method: Controlled | Taylor, state: State, tolerance: Tolerance) -> tuple[Point, Scalar]:
    """Point of a traced state where a motion begins, and its first step."""
    point = Point(state, np.zeros(3), program.evaluate(state), np.zeros(program.layout.memory))
    if isinstance(method, Taylor):
        return point, np.inf  # its series tell
    return point, first_step(program, point, tolerance, method.order)


def _beginning(program: Program, method: Controlled | FixedStep) -> Callable:
    """Equations of the step that begins in a point."""
    if program.drift.partitioned:
        return Partition(program).begin
    equations = Mechanics(program) if method.mechanical else program
    return lambda point: equations


def _settled(program: Program, equations, point: Point) -> tuple[Point, Scalar]:
    """Point of which dependent coordinates follow, and the gap that is left."""
    if not program.drift.partitioned:
        return point, 0.0
    state, gap = equations.settled(point.state)
    return replace(point, state=state, rates=program.evaluate(state)), gap


def _written(program: Program, method: Controlled, begin: Callable, shares):
    """Trial step and dense output written out, and the evaluations of the latter."""
    layout, size = program.layout, program.layout.size
    counts = {}

    def trial(x, h, rtol, atol, atol_rates, refused, last, smallest):
        equations = begin(layout.point(x))
        tolerance = Tolerance(rtol[0], atol[0], atol_rates[0], shares)
        found = method.attempt(equations, layout.point(x), h[0], tolerance)
        counts["kept"] = np.size(found.kept)
        point, gap = _settled(program, equations, found.point)
        error = math.where(gap <= CLOSED, found.error, np.inf) if program.drift.partitioned else found.error
        error, factor = program.watch.judged((layout.point(x), point), error, found.factor, refused[0], smallest[0])
        numbers = [error, factor, found.cost.evaluations, found.cost.factorisations]
        return layout.pack(point), numbers, found.kept

    def dense(x, reached, h, kept):
        point = layout.point(x)
        coefficients, counts["dense"] = method.dense(begin(point), point, h[0], kept)
        return coefficients

    trial = write(trial, size, *[1] * len(TRIAL_SETTINGS), name="trial")
    return trial, write(dense, size, size, 1, counts["kept"], name="dense"), counts["dense"]


def fixed(program: Program, method: FixedStep) -> Fixed:
    """Functions of a method whose step is given."""
    layout, size = program.layout, program.layout.size

    def steps(begin):
        return lambda x, h: stepped(begin(layout.point(x)), x, h)

    def unseen(x, reached: Point):
        return program.watch.passes(layout.point(x), reached)

    def stepped(equations, x, h):
        reached, cost = method.step(equations, layout.point(x), h[0])
        if method.carries:  # it meets the constraints itself, and being moved would take digits from its sums
            gap = [equations.off(reached.state)]
            return layout.pack(reached), gap, [cost.evaluations, cost.factorisations, cost.unsolved, unseen(x, reached)]
        reached, gap = _settled(program, equations, reached)
        packed, gap = layout.pack(reached), [gap]
        packed, gap = program.projected(packed) if program.projects else (packed, gap)
        numbers = [cost.evaluations + int(program.projects), cost.factorisations, cost.unsolved]
        return packed, gap, [*numbers, unseen(x, reached)]

    free = not method.mechanical and not program.drift.partitioned
    if program.may_lose_rank and free:
        step = passing(program, steps)
    elif program.has_redundant_rows and free:  # rows that repeat others on the constraints contradict them beside these
        step = write(steps(lambda point: LoopConstraintBlock(program)), size, 1, name="step")
    else:
        step = write(steps(_beginning(program, method)), size, 1, name="step")
    check = write(program.watched_point, size, name="check")
    settle = None if method.carries else program.projection()
    return Fixed(size, layout.row, step, settle, check, method.evaluations, program.rates)


def many(program: Program, method: FixedStep) -> FixedStepBatchLoop:
    """Machine code of a method whose step is given, over many motions."""
    layout = program.layout

    def start(x):
        point = layout.point(x)
        begun = layout.pack(Point(point.state, point.work, program.evaluate(point.state)))
        return begun, [program.residual(point.state)], program.energies(x)

    states = slice(1, 1 + layout.n_q + layout.n_v)
    return FixedStepBatchLoop(fixed(program, method), write(start, layout.size, name="start"), states)
