"""Energy–momentum method: a midpoint rule with discrete-gradient forces, which conserves energy to rounding.

The momentum changes by h (F + γ d) over a step, F being the force at the midpoint. A step of the midpoint method errs in
energy by terms of third order, each with a change of a coordinate that forces depend on; γ cancels them, along
d = S M S u, u being the velocity at the midpoint and S the coordinates that forces act on: momenta of the others stay
(Gonzalez, Time integration and discrete Hamiltonian systems, J. Nonlinear Sci. 6, 1996; Hairer, Lubich, Wanner, Geometric
Numerical Integration, V.5). The energy is part of the method state and changes by the recorded work, so that rounding
errors do not accumulate. Angular momenta about axes of space are conserved to second order only; symplectic methods conserve
them (:mod:`gauss.integrators.symplectic`). Where S u is almost zero the correction would be rounding, and is left to the
next step.
"""

import numpy as np

from gauss import math
from gauss.codegen import Scalar
from gauss.integrators.control import SMALLEST_DIVISOR
from gauss.integrators.iterate import finest, fixed_point
from gauss.integrators.method import FixedStep
from gauss.integrators.step import CompensatedSums, Cost, Mechanics, Point, method_state_of
from gauss.integrators.symplectic import arrived, changed
from gauss.system import System, retract

LEAST_GAIN = 1e-13  # gain h dᵀu, relative to the energy and the time of the scene, below which a step is not corrected


def step(mechanics: Mechanics, point: Point, h: Scalar) -> tuple[Point, Cost]:
    """One step; unknowns are the velocity at the midpoint, γ, and the multipliers of the loop constraints at the start."""
    state, n, m, acts = point.state, mechanics.system.n_v, mechanics.n_constraints, mechanics.acts
    sums, energy = CompensatedSums.of(method_state_of(point)[:-1], n), method_state_of(point)[-1]
    carried = math.where(sums.begun > 0.0, sums.momentum, mechanics.momentum(state))
    begin, compensation = mechanics.in_own_axes(state.q, carried), mechanics.in_own_axes(state.q, sums.momentum_compensation)
    kinetic, potential = mechanics.energies(state)
    size, energy = kinetic + abs(potential), math.where(sums.begun > 0.0, energy, kinetic + potential)
    mechanism, middle, t = mechanics.mechanism(state), state.t + h / 2.0, state.t + h
    least = finest(mechanics.system, state.q, h, mechanics.extent) + SMALLEST_DIVISOR

    def reached(theta, push):
        return mechanics.reached(t, state.q, theta, carried, mechanics.out_of_chart(state.q, theta, carried, push))

    def over(x):
        """Momentum and force at the midpoint, corrected force, reaction, and work without that of the last reaction."""
        u, L = x[:n], x[n:]
        found = mechanics.impulses(middle, state.q, h / 2.0 * u, u)
        along = acts * mechanics.impulses(middle, state.q, h / 2.0 * u, acts * u).momentum
        held, power, _ = mechanics.reaction(state.t, state.q, np.zeros(n), L) if m else (np.zeros(n), 0.0, None)
        theta, gained = sums.compensation + h * u, 2.0 * (found.momentum - begin) - compensation
        end = reached(theta, gained - h / 2.0 * held)
        work = h * found.power + np.array([h / 2.0 * power, 0.0, 0.0])
        excess = sum(mechanics.energies(end.state)) - energy - (work[0] + end.work + work[1] - work[2])
        excess = excess - u @ (gained - compensation - h * (found.force + held))
        gain = h * (along @ u)
        gamma = math.where(
            np.abs(gain) > LEAST_GAIN * mechanics.system.scale.time * size, -excess / (gain + SMALLEST_DIVISOR), 0.0
        )
        return found, found.force + gamma * along, held, work

    def iterate(x):
        u = x[:n]
        found, force, held, _ = over(x)
        residual = begin + (compensation + h / 2.0 * (force + held)) - found.momentum
        if not m:
            return changed(mechanics.system, x, mechanism.released(residual, np.zeros(0)), u, least)
        off = mechanics.violation(t, retract(mechanics.system, state.q, h * u))
        pull = mechanism.response(residual, -off / h)[1]
        return changed(mechanics.system, x, np.concatenate([mechanism.released(residual, pull), 2.0 / h * pull]), u, least)

    start = state.v + h / 2.0 * point.rates.acceleration
    x, count, _, unsolved = fixed_point(iterate, np.concatenate([start, np.zeros(m)]))
    _, force, held, work = over(x)
    theta, push = sums.compensation + h * x[:n], compensation + h * (force + held / 2.0)
    end = reached(theta, push)
    energy = energy + (work[0] + end.work + work[1] - work[2])
    return arrived(mechanics, point, theta, end, sums.work_compensation + work, energy), Cost(2 * (count + 1), 0, unsolved)


def _size(system: System) -> int:
    return CompensatedSums.size(system) + 1


CONSERVING = (
    FixedStep(
        "energy_momentum",
        "energy–momentum method, midpoint",
        2,
        "Gonzalez 1996; Hairer, Lubich, Wanner, Geometric Numerical Integration, V.5",
        20,
        step,
        True,
        _size,
    ),
)
