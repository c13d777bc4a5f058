"""Digits that the elimination of loop constraints by K M⁻¹ Kᵀ leaves in a state, over numbers or symbols.

The rates nearest to given ones in the mass metric meet K x = 0. Where bodies of one loop differ in mass by many orders, or
near singular configurations, those found miss it, by a fifth or more of the relative error of M⁻¹ on the constraints.
"""

import numpy as np

from gauss.codegen import Scalar
from gauss.dynamics.mechanism import Mechanism, loop_constraint_scales
from gauss.system import System

LARGEST_LEAK = 1e-11  # relative: derivatives have nine digits; round-off of loops leaves 1e-15, near singular poses 1e-12


def constraint_leak(system: System, mechanism: Mechanism) -> Scalar:
    """Sum of the constraint rates K x, relative, of the rates x nearest to random ones; 0 without loop constraints.

    Parameters
    ----------
    system : System
        The system, of numbers.
    mechanism : Mechanism
        The system in one state.
    """
    if not mechanism.scale.size:
        return 0.0
    rng, n = np.random.default_rng(0), system.n_v
    shares = rng.uniform(0.5, 1.0, n) * rng.choice([-1.0, 1.0], n) / n
    nearest = mechanism.nearest(system.scale.coordinates * shares, np.zeros(mechanism.scale.size))
    return np.abs(mechanism.along_rows(nearest) / loop_constraint_scales(system)).sum()
