"""Symplectic methods in momenta p = M(q) v: their energy error stays bounded over any number of steps.

A step is stationary for the discrete action S = h Σ b_i L(q₀ ⊕ Θ_i, Θ̇_i) in the chart around its start. On plain coordinates
that is the Runge–Kutta method for (q, p). On rotations the chart moves with q₀, and the momenta −∂S/∂q₀ and ∂S/∂q₁ are

    R(Θ) p₁ = p₀ + h Σ b_i R(Θ_i) f_i,   f = ∂T/∂q + Q at fixed rates v,

a balance of momentum in the axes of the joint's parent; p₀ gives the momentum in the chart for the stages
(Marsden and West, Discrete mechanics and variational integrators, Acta Numerica 2001, 2.6; Hall and Leok, Lie group spectral
variational integrators, Found. Comput. Math. 17, 2017; Bou-Rabee and Marsden, Hamilton–Pontryagin integrators on Lie groups,
Found. Comput. Math. 9, 2009). So momenta of cyclic coordinates, and angular momenta about axes of symmetry, are conserved.

Coordinates and momenta are compensated sums, so that the rounding error of the energy is a random walk whose steps are
roundings of the change in a step (Hairer, McLachlan, Razakarivony, Achieving Brouwer's law with implicit Runge–Kutta
methods, BIT 48, 2008).
"""

from functools import partial

import numpy as np

from gauss import math
from gauss.codegen import Scalar
from gauss.integrators.collocation import RATTLE, SymplecticTableau, gauss_legendre
from gauss.integrators.control import SMALLEST_DIVISOR
from gauss.integrators.iterate import finest, fixed_point
from gauss.integrators.method import FixedStep
from gauss.integrators.step import CompensatedSums, Cost, Mechanics, Point, Reached, method_state_of
from gauss.system import System, retract, rounded


def step(method: SymplecticTableau, mechanics: Mechanics, point: Point, h: Scalar) -> tuple[Point, Cost]:
    """One step.

    The equations are solved by simplified Newton iterations with the mass matrix and the constraints of the start: in
    W_k = Σ ā_kj δV_j and μ = h ā ã δΛ they are r systems M W + Kᵀ μ = Σ ā_kj R_j, K W = −g_k / h.
    """
    state, s, n, m = point.state, method.b.size, mechanics.system.n_v, mechanics.n_constraints
    r = len(method.a_nodes) if m else 0
    sums = CompensatedSums.of(method_state_of(point), n)
    begin, mechanism = math.where(sums.begun > 0.0, sums.momentum, mechanics.momentum(state)), mechanics.mechanism(state)
    own, flat = mechanics.in_own_axes(state.q, begin), mechanics.system.is_flat
    mixed, least = (
        np.linalg.inv(method.a_nodes @ method.a_reactions),
        finest(mechanics.system, state.q, h, mechanics.extent) + SMALLEST_DIVISOR,
    )

    def stages(V):
        """Momenta and forces in the chart, powers, and forces in axes of parents; (s, …) each."""
        rows = [(state.t + c * h, state.q, h * (a @ V), v) for a, c, v in zip(method.a, method.c, V, strict=True)]
        if flat:
            found = [mechanics.impulses(*row) for row in rows]
            return *map(np.array, zip(*found, strict=True)), None
        transported = [(*impulses, force) for impulses, force in (mechanics.transported(*row) for row in rows)]
        return tuple(map(np.array, zip(*transported, strict=True)))

    def reactions(V, L):
        nodes = [np.zeros(n), *(h * (a @ V) for a in method.a_nodes[:-1])]
        times = [state.t + c * h for c in method.c_nodes[:-1]]
        found = [mechanics.reaction(t, state.q, *of_node) for t, *of_node in zip(times, nodes, L, strict=True)]
        return tuple(map(np.array, zip(*found, strict=True)))

    def impulse(F, held, compensation=0.0):
        """Change of momentum by forces, and by reactions at all nodes but the last."""
        push = compensation + h * (method.b @ F)
        return push if held is None else push + h * (method.b_nodes[:-1] @ held)

    def lead(V, F, carried, held):
        """Difference of the momentum in the chart and along the rates at the start, of the order of the local error."""
        in_chart, in_space = (None, None) if held is None else (held[0], held[2])
        whole = impulse(carried, in_space, sums.momentum_compensation)
        return mechanics.in_chart(state.q, h * (method.b @ V), begin, whole) - impulse(F, in_chart)

    def violation(c, moved):
        return mechanics.violation(state.t + c * h, retract(mechanics.system, state.q, h * moved))

    def iterate(x):
        V, L = x[: s * n].reshape(s, n), x[s * n :].reshape(r, m)
        P, F, _, carried = stages(V)
        held = reactions(V, L) if m else None
        if flat:
            residual = begin + (sums.momentum_compensation + h * (method.a_momenta @ F)) - P
        else:
            residual = own + (lead(V, F, carried, held) + h * (method.a_momenta @ F)) - P
        if held is None:
            free = np.array([mechanism.released(own, np.zeros(0)) for own in residual])
            return changed(mechanics.system, x, free.ravel(), V, least)
        residual = residual + h * (method.a_reactions @ held[0])
        nodes = zip(method.a_nodes, method.a_nodes @ residual, method.c_nodes[1:], strict=True)
        pulls = mixed @ np.array([mechanism.response(own, -violation(c, a @ V) / h)[1] for a, own, c in nodes])
        change = [mechanism.released(own, pull) for own, pull in zip(residual, method.a_reactions @ pulls, strict=True)]
        if mechanics.redundant and r > 1:  # undetermined multipliers at the start would act at other nodes
            pulls = np.array([mechanism.determined(pull) for pull in pulls])
        return changed(mechanics.system, x, np.concatenate([*change, (pulls / h).ravel()]), V, least)

    guess = [state.v + c * h * point.rates.acceleration for c in method.c]
    x, count, _, unsolved = fixed_point(iterate, np.concatenate([*guess, np.zeros(r * m)]))
    V, L = x[: s * n].reshape(s, n), x[s * n :].reshape(r, m)
    (_, F, power, carried), theta = stages(V), sums.compensation + h * (method.b @ V)
    held = reactions(V, L) if m else (None, None, None)
    push = impulse(F if flat else carried, held[2], sums.momentum_compensation)
    work = sums.work_compensation + h * (method.b @ power)
    if m:
        work = work + h * np.array([method.b_nodes[:-1] @ held[1], 0.0, 0.0])
    end = mechanics.reached(state.t + h, state.q, theta, begin, push)
    return arrived(mechanics, point, theta, end, work), Cost(s * (count + 1), 0, unsolved)


def arrived(mechanics: Mechanics, point: Point, theta, end: Reached, work, *more: Scalar) -> Point:
    """End of a step; its method state holds the compensation of coordinates, momentum and work, and further numbers."""
    work, free = work + np.array([end.work, 0.0, 0.0]), np.any(mechanics.spread != 0.0, axis=1)
    moved, done = rounded(mechanics.system, point.state.q, end.state.q, theta), point.work + work
    sums = CompensatedSums(np.where(free, moved, 0.0), end.momentum, end.compensation, work - (done - point.work), 1.0)
    return Point(end.state, done, mechanics.evaluate(end.state), np.concatenate([sums.packed, [*more]]))


def changed(system: System, x, change, V, least):
    """New x, and its change relative to the velocities and to the least resolved rate, over the units of the scene."""
    shares = np.tile(1.0 / system.scale.coordinates, np.size(V) // system.n_v)
    largest, moved = (sum(np.abs(part[: shares.size]) * shares) for part in (x, change))
    return x + change, moved / (largest + least)


_JAY = "Jay 2007; Hairer, Lubich, Wanner, Geometric Numerical Integration, II.1.3 and VII.1.4"
SYMPLECTIC = (
    FixedStep(
        "verlet",
        "Störmer–Verlet, RATTLE with constraints",
        2,
        "Hairer, Lubich, Wanner, Geometric Numerical Integration, VI.3 eq. 3.4 and VII.1.4 eq. 1.26",
        10,
        partial(step, RATTLE),
        True,
        CompensatedSums.size,
        evaluates_end=True,
    ),
    FixedStep(
        "variational_midpoint",
        "variational midpoint method",
        2,
        "Marsden and West, Discrete mechanics and variational integrators, Acta Numerica 2001, 2.3.1",
        7,
        partial(step, gauss_legendre(1)),
        True,
        CompensatedSums.size,
    ),
    *(
        FixedStep(name, f"Gauss–Legendre collocation, {s} stages", 2 * s, _JAY, 7 * s, way, True, CompensatedSums.size)
        for name, s, way in (
            ("gauss4", 2, partial(step, gauss_legendre(2))),
            ("gauss6", 3, partial(step, gauss_legendre(3))),
        )
    ),
)
