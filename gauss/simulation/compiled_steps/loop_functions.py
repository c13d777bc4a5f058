"""Traced functions of one system and integrator (trial step, dense output, projection, check), for its compiled loop."""

from collections.abc import Callable
from dataclasses import replace
from functools import reduce
from typing import TYPE_CHECKING, Any, TypeGuard

import numpy as np

from gauss import math
from gauss.codegen import Function, NativeFunction, Scalar, write
from gauss.codegen.kernels import TRIAL_SETTINGS, Adaptive, CheckedSwitch, Fixed, FixedStepBatchLoop, Loop
from gauss.dynamics.laws.narrow_peaks import ends_of
from gauss.dynamics.traced_system import Program
from gauss.integrators import Controlled, ExplicitPair, FixedStep, Point, Taylor, Tolerance, first_step
from gauss.simulation.compiled_steps.coordinate_partitioning import PartitionedSystem
from gauss.simulation.compiled_steps.explicit_stages import ExplicitStages
from gauss.simulation.compiled_steps.momentum_form import MomentumForm
from gauss.simulation.compiled_steps.projected_stages import ProjectedEquations, with_projected_stages
from gauss.simulation.compiled_steps.taylor_step import taylor_step
from gauss.system import State

if TYPE_CHECKING:
    from gauss.codegen.gpu.batches import DeviceFixedStepLoop

CONSISTENT = 1e-10  # largest residual, relative to the sizes of the constraints, of a state that satisfies them


def adaptive(program: Program, method: Controlled, batch: bool = False, shares=None) -> Adaptive:
    """Functions of an adaptive method, for one motion or for a batch; ``shares`` are factors of the tolerance."""
    layout, size = program.layout, program.layout.size
    begin = _equations(program, method)
    sample: Function | NativeFunction
    project: Function | NativeFunction | None
    if _is_explicit(method, program):
        stages = ExplicitStages(program, method, batch, shares)
        (trial, dense), sample, dense_evaluations = stages.functions(), stages.sample(), method.pair.extra_c.size
        project = stages.projection()
    else:
        trial, dense, dense_evaluations = _written(program, method, begin, shares)
        sample, project = _sample(program, method, begin, len(dense.outputs)), program.projection()
    return Adaptive(size, layout.row, trial, project, program.point_check, dense, sample, dense_evaluations, program.rates)


def _sample(program: Program, method: Controlled, begin: Callable, count: int) -> Function:
    """Function (point, h, coefficients of dense output, t) → state and work at t."""
    layout = program.layout

    def sample(x, h, coefficients, t):
        equations = begin(layout.point(x))
        state, work = method.interpolate(equations, layout.point(x), h[0], coefficients, t[0])
        if program.drift.partitioned:
            state, _ = equations.completed(state)
        state = program.on_trains(state)
        if program.projects:
            state, _, _ = program.on_constraints(state)
        return [state.t], state.q, state.v, work

    return write(sample, layout.size, 1, count, 1, name="sample")


def single(program: Program, method: Controlled | Taylor, shares=None) -> Loop:
    """Machine code of an adaptive method, for one motion; ``shares`` are factors of the tolerance.

    Its function "start" is (t, q, v, rtol, atol, atol_rates) → (point, its check, first step).
    """
    functions = taylor_step(program, shares) if isinstance(method, Taylor) else adaptive(program, method, shares=shares)
    check = functions.check
    if _is_explicit(method, program):
        return functions.compile(ExplicitStages(program, method, shares=shares).first(check))

    def start(t, q, v, rtol, atol, atol_rates):
        state, tolerance = State(t[0], q, v), Tolerance(rtol[0], atol[0], atol_rates[0], shares)
        point, h = beginning(program, method, state, tolerance)
        packed = program.layout.pack(point)
        return packed, check(packed), [h]

    return functions.compile(write(start, 1, program.layout.n_q, program.layout.n_v, 1, 1, 1, name="start"))


def _is_explicit(method: Controlled | Taylor, program: Program) -> TypeGuard[ExplicitPair]:
    """Whether the steps of a method are those of :class:`ExplicitStages`."""
    return isinstance(method, ExplicitPair) and not program.drift.partitioned


def beginning(program: Program, method: Controlled | Taylor, state: State, tolerance: Tolerance) -> tuple[Point, Scalar]:
    """Initial point of a motion, and its first step."""
    point = Point(state, np.zeros(3), program.evaluate(state), np.zeros(program.layout.memory))
    if isinstance(method, Taylor):
        return point, np.inf  # the series gives it
    return point, first_step(program, point, tolerance, method.order)


def _equations(program: Program, method: Controlled | FixedStep) -> Callable[[Point], Any]:
    """Point → equations of the step that begins there."""
    if program.drift.partitioned:
        return PartitionedSystem(program).begin
    equations = MomentumForm(program) if method.mechanical else program
    return lambda point: equations


def _completed(program: Program, equations, point: Point) -> tuple[Point, Scalar]:
    """Point at the end of a step with dependent coordinates from the independent ones, and the remaining residual."""
    if not program.drift.partitioned:
        return replace(point, state=program.on_trains(point.state)), 0.0
    state, residual = equations.completed(point.state)
    return replace(point, state=state, rates=program.evaluate(state)), residual


def _written(program: Program, method: Controlled, begin: Callable, shares):
    """Trial step and dense output as straight-line code, and the evaluations of the latter."""
    layout, size = program.layout, program.layout.size
    counts = {}

    def trial(x, h, rtol, atol, atol_rates, refused, last, smallest):
        equations = begin(layout.point(x))
        tolerance = Tolerance(rtol[0], atol[0], atol_rates[0], shares)
        found = method.attempt(equations, layout.point(x), h[0], tolerance)
        counts["kept"] = np.size(found.kept)
        point, residual = _completed(program, equations, found.point)
        error = math.where(residual <= CONSISTENT, found.error, np.inf) if program.drift.partitioned else found.error
        ends = layout.point(x), point
        error, factor = program.watch.judged(ends, error, found.factor, refused[0], smallest[0], tolerance)
        numbers = [error, factor, found.cost.evaluations, found.cost.factorisations]
        return layout.pack(point), numbers, found.kept

    def dense(x, reached, h, kept):
        point = layout.point(x)
        coefficients, counts["dense"] = method.dense(begin(point), point, h[0], kept)
        return coefficients

    trial = write(trial, size, *[1] * len(TRIAL_SETTINGS), name="trial")
    return trial, write(dense, size, size, 1, counts["kept"], name="dense"), counts["dense"]


def fixed(program: Program, method: FixedStep) -> Fixed:
    """Functions of a fixed-step method."""
    layout, size = program.layout, program.layout.size

    def steps(equations_at):
        return lambda x, h: stepped(equations_at(layout.point(x)), x, h)

    def begun(equations, x) -> Point:
        point = layout.point(x)  # inputs may have changed since its rates were computed
        return replace(point, rates=equations.evaluate(point.state)) if program.inputs else point

    def stepped(equations, x, h):
        begin = begun(equations, x)
        reached, cost = method.step(equations, begin, h[0])
        seen = program.watch.passes(begin, reached), program.watch.oscillates(begin, reached), missed(begin, reached)
        unseen = reduce(lambda one, other: math.where(other > one, other, one), seen, 0.0)  # NaN is no jump: its step fails
        reached = replace(reached, rates=begin.rates) if program.inputs else reached  # the next step computes its own
        if method.state_size:  # it satisfies the constraints itself, and a projection would spoil its compensated sums
            residual = equations.largest_violation(reached.state)
            return (
                layout.pack(replace(reached, state=program.on_trains(reached.state))),
                [residual],
                [cost.evaluations, cost.factorisations, cost.unsolved, unseen],
            )
        reached, residual = _completed(program, equations, reached)
        packed, residuals = layout.pack(reached), [residual]
        packed, residuals = program.projected(packed) if program.projects else (packed, residuals)
        numbers = [cost.evaluations + int(program.projects), cost.factorisations, cost.unsolved]
        return packed, residuals, [*numbers, unseen]

    missed = _missed_peaks(program)
    free = not method.mechanical and not program.drift.partitioned
    step: Function | CheckedSwitch
    if program.may_lose_rank and free:
        step = with_projected_stages(program, steps)
    elif program.has_redundant_rows and free:  # off the constraints, redundant constraints contradict each other
        step = write(steps(lambda point: ProjectedEquations(program)), size, 1, name="step")
    else:
        step = write(steps(_equations(program, method)), size, 1, name="step")
    project = None if method.state_size else program.projection()
    return Fixed(size, layout.row, step, project, program.point_check, method.evaluations, program.rates)


def _missed_peaks(program: Program) -> Callable[[Point, Point], Scalar]:
    """Ends of a fixed step → 1 where it does not resolve a smooth peak of a law, else 0."""
    if not program.watch.may_be_narrow:
        return lambda begin, end: 0.0
    look = program.watch.narrow.unresolved(lambda state: program.evaluate(state).acceleration, program.order_inputs)

    def missed(begin: Point, end: Point) -> Scalar:
        return look(*ends_of(begin, end))[0]

    return missed


def fixed_batch(
    program: Program, method: FixedStep, device: str | None = None
) -> "FixedStepBatchLoop | DeviceFixedStepLoop":
    """Machine code of a fixed-step method for a batch of motions, of this CPU or of a device."""
    return batch_loop(program, fixed(program, method), device=device)


def batch_loop(
    program: Program, functions: Fixed, width: int | None = None, device: str | None = None
) -> "FixedStepBatchLoop | DeviceFixedStepLoop":
    """Machine code of a batch of motions; samples are coordinates, rates and work.

    Parameters
    ----------
    program : Program
        The system.
    functions : Fixed
        Functions of the step.
    width : int, optional
        Number of motions at a time, 1 for steps of one motion; that of the vector register when not given.
    device : str, optional
        Name of a device; this CPU by default.
    """
    layout = program.layout

    def start(x):
        point = layout.point(x)
        begun = layout.pack(Point(point.state, point.work, program.evaluate(point.state), point.method_state))
        return begun, [program.residual(point.state)], program.energies(x)

    begin, written, inputs = write(start, layout.size, name="start"), slice(1, layout.row), len(program.inputs)
    if device is None:
        return FixedStepBatchLoop(functions, begin, written, inputs, width)
    from gauss.codegen.gpu.batches import DeviceFixedStepLoop

    return DeviceFixedStepLoop(device, functions, begin, written, inputs)
