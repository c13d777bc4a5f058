"""Taylor's method as machine code: what its loop calls, written down for the system at hand.

The motion is expanded in (q, v, work) themselves: rates of quaternions are polynomials, and after a step they are made unit
length again.
"""

from dataclasses import replace

import numpy as np

from gauss import math
from gauss.codegen import Function, Series, without_series, write
from gauss.codegen.kernels import TaylorStep
from gauss.dynamics.traced_system import Program, applied_loads, largest
from gauss.errors import SimulationError
from gauss.integrators import WATCHED, Point, Tolerance, reach
from gauss.system import State, System, coordinate_rates

DEFECT = 1e4  # times the error allowed of a rate: more than this is off at the end of a step where its series misses a law


def remembered(system: System) -> int:
    """Numbers that compensated sums remember: what rounding took from (q, v, work) and from t."""
    return system.n_q + system.n_v + 3 + 1


def expanded(program: Program, shares=None) -> TaylorStep:
    """Functions of Taylor's method for one motion; shares of the tolerance.

    Raises
    ------
    SimulationError
        If a force has no Taylor series.
    """
    layout, system = program.layout, program.system
    n, size = layout.row - 1, layout.size

    def far(x, rtol, atol, atol_rates, order, orders, coefficients):
        tolerance, moving = Tolerance(rtol[0], atol[0], atol_rates[0], shares), slice(0, system.n_q + system.n_v)
        rows = coefficients.reshape(WATCHED, n)[:, moving]
        return [reach(system, layout.state(x), tolerance, order[0], orders, rows)]

    def finish(x, h, change):
        state, work, memory = _moved(program, x, h[0], change)
        return layout.pack(Point(state, work, layout.point(x).rates, memory))

    def renew(x):
        point = layout.point(x)
        return layout.pack(replace(point, rates=program.evaluate(point.state)))

    def defect(x, before, slope, h, rtol, atol, atol_rates):
        point, tolerance = layout.point(x), Tolerance(rtol[0], atol[0], atol_rates[0], shares)
        allowed = tolerance.scale(system, point.state)[system.n_v :]
        off = h[0] * largest((slope - point.rates.acceleration) / allowed) / DEFECT
        return [math.where(program.watch.passes(layout.point(before), point) > 0.0, np.inf, off)]

    def sample(x, h, change):
        state, work, _ = _moved(program, x, h[0], change)
        if program.projects:
            state, _, _ = program.on_constraints(state)
        return [state.t], state.q, state.v, work

    settle = program.projection()
    return TaylorStep(
        size,
        layout.row,
        Series(_rates(program)),
        write(far, size, 1, 1, 1, 1, WATCHED, WATCHED * n, name="reach"),
        WATCHED,
        write(finish, size, 1, n, name="finish"),
        write(renew, size, name="renew"),
        write(defect, size, size, system.n_v, 1, 1, 1, 1, name="defect") if program.laws.outputs else None,
        system.n_q,
        settle,
        write(program.watched_point, size, name="check"),
        write(sample, size, 1, n, name="sample"),
        program.rates,
    )


def _rates(program: Program) -> Function:
    """Function (t, q, v, work) → their rates, but for that of t."""
    system, n = program.system, program.system.n_v

    def rates(t, q, v, work):
        found = program.rates.inlined(t, q, v)
        return coordinate_rates(system, q, v), found

    written = write(rates, 1, system.n_q, n, 3, name="expanded_rates")
    if without_series(written):
        raise SimulationError(_rough(program, without_series(written)))
    return written


def _rough(program: Program, operations: list[str]) -> str:
    """Message when something in a system has no Taylor series."""
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
    """All that a load says: forces on coordinates and bodies, and power."""
    effort, forces, power = applied_loads(system, [bound], state)
    return (effort, power, *(part for pair in forces.values() for part in pair))


def _moved(program: Program, x, h, change):
    """State and work after a change of (q, v, work) in a time h, and what rounding took from them.

    Compensated summation (Kahan 1965; Hairer, Lubich, Wanner, Geometric Numerical Integration, VIII.5).
    """
    point, system = program.layout.point(x), program.system
    state, (*lost, late) = point.state, point.memory
    before, change, h = np.concatenate([state.q, state.v, point.work]), change + np.array(lost), h + late
    after, t = before + change, state.t + h
    memory = np.concatenate([change - (after - before), [h - (t - state.t)]])
    q, v, work = after[: system.n_q].copy(), after[system.n_q : -3], after[-3:]
    for place in system.quaternions.values():
        q[place] = q[place] / np.sqrt(q[place] @ q[place])
    return State(t, q, v), work, memory
