"""Lie-group generalised-α method with constraints on positions (index 3): ρ∞ sets the damping of high frequencies.

Chung and Hulbert, J. Appl. Mech. 60, 1993 (the method); Arnold and Brüls, Convergence of the generalized-α scheme for
constrained mechanical systems, Multibody System Dynamics 18, 2007; Brüls and Cardona, J. Comput. Nonlinear Dyn. 5, 2010 (on
Lie groups).
"""

from functools import partial
from numbers import Real
from typing import NamedTuple

import numpy as np

from gauss.codegen import Scalar
from gauss.errors import SimulationError
from gauss.integrators.iterate import finest, newton
from gauss.integrators.method import FixedStep
from gauss.integrators.radau import REST_RATE
from gauss.integrators.step import Cost, Mechanics, Point, method_state_of

REGULARISATION = 1e-8  # relative to rows of K M⁻¹ Kᵀ on free bodies: redundant constraints stay solvable


class Weights(NamedTuple):
    """Coefficients of the method, from the spectral radius ρ∞ at infinite frequency (Chung and Hulbert, eqs. 17, 20, 25)."""

    alpha_m: float
    alpha_f: float
    beta: float
    gamma: float

    @classmethod
    def of(cls, rho: float) -> "Weights":
        """Coefficients of least low-frequency damping for a spectral radius."""
        alpha_m, alpha_f = (2.0 * rho - 1.0) / (rho + 1.0), rho / (rho + 1.0)
        gamma = 0.5 + alpha_f - alpha_m
        return cls(alpha_m, alpha_f, (gamma + 0.5) ** 2 / 4.0, gamma)


def step(w: Weights, mechanics: Mechanics, point: Point, h: Scalar) -> tuple[Point, Cost]:
    """One step; unknowns are the accelerations along the free coordinates and the multipliers.

    The method state is the acceleration-like variable a: (1 − α_m) a₁ + α_m a₀ = (1 − α_f) v̇₁ + α_f v̇₀.
    """
    state, before, a = point.state, point.rates.acceleration, method_state_of(point)
    scale, spread = mechanics.mechanism(state).scale, mechanics.spread
    n, t = spread.shape[1], state.t + h

    def reached(x):
        """Chart coordinates θ, rates v, and a at the end."""
        after = ((1.0 - w.alpha_f) * (spread @ x[:n]) + w.alpha_f * before - w.alpha_m * a) / (1.0 - w.alpha_m)
        theta = h * (state.v + h * ((0.5 - w.beta) * a + w.beta * after))
        return theta, state.v + h * ((1.0 - w.gamma) * a + w.gamma * after), after

    def residual(x):
        theta, v, _ = reached(x)
        forces, violation = mechanics.residual(t, state.q, theta, v, spread @ x[:n], scale * x[n:])
        share = w.beta * (1.0 - w.alpha_f) / (1.0 - w.alpha_m) * h * h  # ∂θ/∂v̇
        return np.concatenate([spread.T @ forces, scale * violation / share])

    start = np.concatenate([spread.T @ before / np.sum(spread**2, axis=0), np.zeros(scale.size)])
    softness = np.concatenate([np.zeros(n), np.full(scale.size, -REGULARISATION)])
    unit = mechanics.system.scale
    whole = lambda rates: np.sum(np.abs(rates) / unit.coordinates)  # noqa: E731
    size = (whole(state.v) + REST_RATE / unit.time) / h + whole(a) + whole(before)
    size = size + finest(mechanics.system, state.q, h * h, mechanics.extent)
    units = np.concatenate([along_free(spread, unit.coordinates), np.full(scale.size, np.sqrt(unit.mass) * unit.length)])
    found = newton(residual, start, size, units, softness)
    theta, v, after = reached(found.x)
    end = mechanics.tracked(t, state.q, theta, v)
    rates = mechanics.evaluate(end)
    work = point.work + h / 2.0 * (np.asarray(point.rates.power) + rates.power)
    return Point(end, work, rates, after), Cost(found.calls + 1, found.factorisations, found.unsolved)


def along_free(spread: np.ndarray, units: np.ndarray) -> np.ndarray:
    """Units (n,) of the free coordinates, from the units (n_v,) of all coordinates."""
    first = np.argmax(spread != 0.0, axis=0)
    return units[first] / np.abs(spread[first, np.arange(first.size)])


def generalised_alpha(rho: float = 0.8) -> FixedStep:
    """Generalised-α method for a spectral radius ρ∞ at infinite frequency.

    Parameters
    ----------
    rho : float
        Spectral radius: 1 damps no frequency, 0 annihilates the highest frequencies in one step.

    Returns
    -------
    FixedStep
        The method, for ``integrator=``.

    Raises
    ------
    SimulationError
        If ρ∞ is not between 0 and 1.
    """
    if not isinstance(rho, Real) or not 0.0 <= rho <= 1.0:
        raise SimulationError(f"generalised_alpha: rho: expected a number from 0 to 1, got {rho!r}.")
    return FixedStep(
        "generalised_alpha" if rho == 0.8 else f"generalised_alpha({rho:g})",
        f"generalised-α on Lie groups, index 3, ρ∞ = {rho:g}",
        2,
        "Brüls and Cardona 2010; Arnold and Brüls 2007",
        24,
        partial(step, Weights.of(rho)),
        mechanical=True,
        starts_from_accelerations=True,
        evaluates_end=True,
    )


GENERALISED_ALPHA = (generalised_alpha(),)
