"""Directions of power flow through the gears of a group, found together with its acceleration.

For given torques on its shafts the equation of a group, J_r α̈ + Σ φ(α̈) − Q_r = 0, is strictly increasing and piecewise
linear in α̈, so that exactly one pattern of directions fits (Rotor chains, section 2).
"""

import numpy as np
from scipy.optimize import brentq

from gauss.errors import SimulationError
from gauss.rotors.reduced import ReducedNetwork

MOST_PATTERNS = 200


def group_pattern(reduced: ReducedNetwork, group: int, applied, turning, forward) -> tuple[float, np.ndarray]:
    """Acceleration of the root [rad/s²] and directions of all links, those of the group found.

    SimulationError if no pattern is found, which only rounding can cause.

    Parameters
    ----------
    applied : ndarray, shape (n,)
        Torques on the shafts but those of gears [N m].
    turning : ndarray, shape (n,)
        Sense of rotation of each shaft, 1 or −1.
    forward : ndarray of bool, shape (n_l,)
        First guess of the directions.
    """
    branches, root, forward = reduced.branches(group), reduced.roots[group], forward.copy()
    low, high = -np.inf, np.inf
    for _ in range(MOST_PATTERNS):
        alpha = _newton(reduced, branches, root, applied, forward)
        if not low < alpha < high:
            alpha = 0.5 * (low + high)
        residual, found = _residual(reduced, branches, root, applied, turning, alpha)
        if np.array_equal(found[_links(branches)], forward[_links(branches)]):
            return alpha, forward
        forward[_links(branches)] = found[_links(branches)]
        low, high = (max(low, alpha), high) if residual < 0 else (low, min(high, alpha))
        if np.isfinite(high - low) and high - low <= 4 * np.finfo(float).eps * max(abs(low), abs(high)):
            return alpha, forward  # at a kink: both patterns give this acceleration
    raise SimulationError(
        f"the group of shaft {reduced.names[root]!r}: no pattern of power flow found in {MOST_PATTERNS} rounds; "
        "check its torques."
    )


def resting_torques(reduced: ReducedNetwork, group: int, ahead, back) -> dict[int, float]:
    """Torques of the gears of a group that sticks at rest, each between its limits.

    They are not unique: all friction is taken at the same share between the two directions of breakaway.

    Parameters
    ----------
    reduced, group
        As in :func:`group_pattern`.
    ahead, back : (applied, forward)
        Torques on the shafts (n,) and directions of power (n_l,) at breakaway forward and backward.
    """
    branches, root = reduced.branches(group), reduced.roots[group]

    def transmitted(share: float):
        applied = (1 - share) * ahead[0] + share * back[0]
        asked, torques = dict.fromkeys(_shafts(branches, root), 0.0), {}
        for branch in branches:
            link, needed = reduced.links[branch.link], asked[branch.child] - applied[branch.child]
            f = (1 - share) * link.factor(bool(ahead[1][branch.link])) + share * link.factor(bool(back[1][branch.link]))
            torques[branch.link] = needed if branch.forward else -needed / f
            asked[branch.parent] += f * needed if branch.forward else needed / f
        return asked[root] - applied[root], torques

    if transmitted(0.0)[0] * transmitted(1.0)[0] >= 0:  # one of the two directions balances to rounding
        return transmitted(float(abs(transmitted(1.0)[0]) < abs(transmitted(0.0)[0])))[1]
    return transmitted(brentq(lambda share: transmitted(share)[0], 0.0, 1.0, xtol=1e-15))[1]


def _links(branches) -> list[int]:
    return [branch.link for branch in branches]


def _newton(reduced, branches, root, applied, forward) -> float:
    """Acceleration of the root for one pattern [rad/s²]."""
    J, Q = dict.fromkeys(_shafts(branches, root), 0.0), dict.fromkeys(_shafts(branches, root), 0.0)
    for branch in branches:
        f = reduced.links[branch.link].factor(bool(forward[branch.link]))
        factor = f if branch.forward else 1.0 / f
        J[branch.parent] += factor * branch.rate * (reduced.inertia[branch.child] + J[branch.child])
        Q[branch.parent] += factor * (applied[branch.child] + Q[branch.child])
    return (applied[root] + Q[root]) / (reduced.inertia[root] + J[root])


def _residual(reduced, branches, root, applied, turning, alpha) -> tuple[float, np.ndarray]:
    """Residual torque on the root [N m] and the pattern, for one acceleration of the root."""
    asked = dict.fromkeys(_shafts(branches, root), 0.0)
    forward = np.ones(len(reduced.links), dtype=bool)
    for branch in branches:
        link, child = reduced.links[branch.link], branch.child
        needed = reduced.inertia[child] * reduced.K[child] * alpha - applied[child] + asked[child]
        driver = branch.parent if branch.forward else child
        # into the link from the driver: φ ω_driver, of the sign of Q_em ω_driver / i
        flow = needed / link.ratio if branch.forward else -needed
        forward[branch.link] = flow * turning[driver] >= 0
        f = link.factor(bool(forward[branch.link]))
        asked[branch.parent] += f * needed if branch.forward else needed / f
    return reduced.inertia[root] * alpha - applied[root] + asked[root], forward


def _shafts(branches, root) -> list[int]:
    return [root, *(branch.child for branch in branches)]
