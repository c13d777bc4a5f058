"""Digits that the elimination of loop constraints by K M⁻¹ Kᵀ leaves in a state, over numbers or symbols.

Rates nearest to given ones in the mass metric, and accelerations under forces, meet K x = 0. Where bodies of one loop differ
in mass by many orders, or near singular configurations, those found miss it: the first where multipliers are wrong, the
second where accelerations are small differences of large ones, too. The relative error of M⁻¹ on the constraints was at most
thirty times the first and seven times the second in loops with bodies lighter or heavier by 1e-12 … 1e9.
"""

from dataclasses import replace
from functools import partial

import numpy as np

from gauss import math
from gauss.codegen import Scalar
from gauss.dynamics.given_link_frames import ungrouped
from gauss.dynamics.mechanism import Mechanism, loop_constraint_scales
from gauss.dynamics.store import cached
from gauss.system import Subsystem, System

LARGEST_LEAK = 1e-11  # relative: derivatives have eight digits; round-off of loops leaves 1e-15, near singular poses 1e-12
REFUSED_LEAK = 1e-7  # the same where nothing has more digits: five are left
SHARE_UNDER_FORCES = 0.01  # of the constraint accelerations under forces, whose round-off is that much larger

MASS_RATIO = 1e3  # ratio of masses, and of moments of inertia, of one loop up to which elimination leaves twelve digits


def may_leak(system: System) -> bool:
    """Whether bodies of loops differ so much in mass or inertia that elimination may lose digits: it is checked then."""
    return cached(system, (_has_unlike_bodies,), partial(_has_unlike_bodies, system))


def _has_unlike_bodies(system: System) -> bool:
    """As of :func:`may_leak`, evaluated anew."""
    return any(one.n_loop_constraints and not _are_alike(one) for one in system.subsystems)


def _are_alike(subsystem: Subsystem) -> bool:
    """Whether masses, and largest moments of inertia, of the bodies of a subsystem are of similar size, none zero."""
    moments, masses = _moments_and_masses(subsystem)
    return all(sizes.max() <= MASS_RATIO * sizes.min() for sizes in (moments.max(axis=1), masses))


def _moments_and_masses(subsystem: Subsystem) -> tuple[np.ndarray, np.ndarray]:
    """Principal moments of inertia (k, 3) and masses (k,) of the bodies."""
    own = np.array(subsystem.Phi, dtype=float).reshape(-1, 6)
    return own[:, :3], own[:, 3]


def with_alike_bodies(system: System, pattern: System | None = None) -> tuple[Subsystem, ...] | None:
    """Subsystems whose bodies are alike, for projections in another metric than that of the masses; None if they are alike.

    A projection of what a step left, and its multipliers, keep their digits in this metric.

    ``pattern``: a system of numbers, where those of this one are symbols.
    """
    pattern = pattern or system
    if not may_leak(pattern):
        return None
    return tuple(_with_alike(*pair) for pair in zip(system.subsystems, pattern.subsystems, strict=True))


def _with_alike(subsystem: Subsystem, pattern: Subsystem) -> Subsystem:
    """Subsystem whose masses and moments of inertia are at least a share of the largest."""
    raised = [np.maximum(sizes, sizes.max(initial=0.0) / MASS_RATIO) for sizes in _moments_and_masses(pattern)]
    Phi = np.concatenate([raised[0], np.repeat(raised[1][:, None], 3, axis=1)], axis=1).ravel()
    return ungrouped(replace(subsystem, Phi=Phi))


def refused_where_leaking(system: System, mechanism: Mechanism, values: np.ndarray) -> np.ndarray:
    """Values, numbers or symbols; NaN where elimination leaves less than five digits."""
    return math.where(constraint_leak(system, mechanism) <= REFUSED_LEAK, values, np.nan) if may_leak(system) else values


def constraint_leak(system: System, mechanism: Mechanism) -> Scalar:
    """Sum of K x, relative, of rates x nearest to random ones, and of accelerations x under random forces.

    Zero without loop constraints. The system is one of numbers.
    """
    if not mechanism.scale.size:
        return 0.0
    rng, n, still = np.random.default_rng(0), system.n_v, np.zeros(mechanism.scale.size)
    unit, scales = system.scale.coordinates, loop_constraint_scales(system)
    shares = rng.uniform(0.5, 1.0, (2, n)) * rng.choice([-1.0, 1.0], (2, n)) / n
    off = lambda rates: np.abs(mechanism.along_rows(rates) / scales).sum()  # noqa: E731
    nearest, pushed = mechanism.nearest(unit * shares[0], still), mechanism.response(shares[1] / unit, still)[0]
    return off(nearest) + SHARE_UNDER_FORCES * off(pushed) / np.abs(pushed / unit).sum()
