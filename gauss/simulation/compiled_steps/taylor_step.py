"""Taylor step as machine code: series of (q, v, work) in time, summed at the step that their last terms allow.

Rates of quaternions are polynomials in (q, v); after a step quaternions are normalised. Steps are compensated sums.
"""

from dataclasses import replace

import numpy as np

from gauss import math
from gauss.codegen import Function, Series, without_series, write
from gauss.codegen.kernels import TaylorStep
from gauss.dynamics.traced_system import Program, applied_loads, largest
from gauss.errors import SimulationError
from gauss.integrators import WATCHED, Point, Tolerance, method_state_of, reach
from gauss.system import State, System, coordinate_rates

LARGEST_DEFECT = 1e4  # of the rates after a step, over the tolerance: a larger one shows that the series misses a law


def taylor_step(program: Program, shares=None) -> TaylorStep:
    """Functions of Taylor's method for one motion; ``shares`` are factors of the tolerance.

    Raises
    ------
    SimulationError
        If a force has no Taylor series.
    """
    layout, system = program.layout, program.system
    n, size = layout.row - 1, layout.size

    def longest(x, rtol, atol, atol_rates, order, orders, coefficients):
        tolerance, moving = Tolerance(rtol[0], atol[0], atol_rates[0], shares), slice(0, system.n_q + system.n_v)
        rows = coefficients.reshape(WATCHED, n)[:, moving]
        return [reach(system, layout.state(x), tolerance, order[0], orders, rows)]

    def finish(x, h, change):
        state, work, compensation = _moved(program, x, h[0], change)
        return layout.pack(Point(program.on_trains(state), work, layout.point(x).rates, compensation))

    def renew(x):
        point = layout.point(x)
        return layout.pack(replace(point, rates=program.evaluate(point.state)))

    def defect(x, before, slope, h, rtol, atol, atol_rates):
        point, tolerance = layout.point(x), Tolerance(rtol[0], atol[0], atol_rates[0], shares)
        allowed = tolerance.scale(system, point.state)[system.n_v :]
        off = h[0] * largest((slope - point.rates.acceleration) / allowed) / LARGEST_DEFECT
        return [math.where(program.watch.passes(layout.point(before), point) > 0.0, np.inf, off)]

    def sample(x, h, change):
        state, work, _ = _moved(program, x, h[0], change)
        state = program.on_trains(state)
        if program.projects:
            state, _, _ = program.on_constraints(state)
        return [state.t], state.q, state.v, work

    project = program.projection()
    return TaylorStep(
        size,
        layout.row,
        Series(_rates(program)),
        write(longest, size, 1, 1, 1, 1, WATCHED, WATCHED * n, name="reach"),
        WATCHED,
        write(finish, size, 1, n, name="finish"),
        write(renew, size, name="renew"),
        write(defect, size, size, system.n_v, 1, 1, 1, 1, name="defect") if program.laws.outputs or program.watch else None,
        system.n_q,
        project,
        program.point_check,
        write(sample, size, 1, n, name="sample"),
        program.rates,
    )


def _rates(program: Program) -> Function:
    """Function (t, q, v, work) → (q̇, v̇, power)."""
    system, n = program.system, program.system.n_v

    def rates(t, q, v, work):
        return coordinate_rates(system, q, v), *program.instant(State(t[0], q, v))[1]

    written = write(rates, 1, system.n_q, n, 3, name="taylor_rates")
    if without_series(written):
        raise SimulationError(_without_series(program, without_series(written)))
    return written


def _without_series(program: Program, operations: list[str]) -> str:
    """Message where a force has no Taylor series."""
    system = program.system

    def of(bound):
        forces = lambda t, q, v: _powers(system, bound, State(t[0], q, v))  # noqa: E731
        return without_series(write(forces, 1, system.n_q, system.n_v))

    names = [repr(bound.load.name) for bound in program.loads if of(bound)]
    return (
        f"integrator 'taylor' needs forces that have a Taylor series; {', '.join(names) or 'the equations of motion'} "
        f"use{'s' if len(names) == 1 else ''} {', '.join(operations)}. Use integrator 'dop853'."
    )


def _powers(system: System, bound, state: State):
    """Outputs of a load: forces on coordinates and bodies, and power."""
    effort, forces, power = applied_loads(system, [bound], state)
    return (effort, power, *(part for pair in forces.values() for part in pair))


def _moved(program: Program, x, h, change):
    """State and work after a change of (q, v, work) in a time h, and the new compensation.

    Compensated summation (Kahan 1965; Hairer, Lubich, Wanner, Geometric Numerical Integration, VIII.5).
    """
    point, system = program.layout.point(x), program.system
    state, (*lost, late) = point.state, method_state_of(point)
    before, change, h = np.concatenate([state.q, state.v, point.work]), change + np.array(lost), h + late
    after, t = before + change, state.t + h
    compensation = np.concatenate([change - (after - before), [h - (t - state.t)]])
    q, v, work = after[: system.n_q].copy(), after[system.n_q : -3], after[-3:]
    for place in system.quaternions.values():
        q[place] = q[place] / np.sqrt(q[place] @ q[place])
    return State(t, q, v), work, compensation
