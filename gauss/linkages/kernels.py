"""The numerical core of a linkage as machine code: the same source, called once with symbols.

Reduced to its crank, a linkage has J_e θ̈ + b θ̇² = M1 + Q. With primes for derivatives at crank speed 1 and acceleration 0:
J_e = Σ m |G'|² + J θ'², b = Σ m G'·G'' + J θ' θ'' (half the slope of J_e), and Q the power of gravity and loads.
"""

import numpy as np

from gauss.codegen import Kernel, trace
from gauss.linkages.chain import Chain
from gauss.linkages.loads import acting, centre, power
from gauss.linkages.motion import LinkageKinematics, move
from gauss.linkages.plane import dot
from gauss.linkages.reactions import react


def cycle_kernel(chain: Chain) -> Kernel:
    """Crank angle, speed, acceleration, and poses near those of ternary links → M1, then the reactions of all joints.

    Reactions are pairs (x, y) or (n, m) in the order of ``chain.joints``. Called with columns (n, k) it takes k angles at
    once in SIMD code. Nothing is checked: where the linkage does not close the numbers are nan.

    Parameters
    ----------
    chain : Chain
        The linkage.

    Returns
    -------
    Kernel
        Machine code.

    Raises
    ------
    LinkageError
        If the law of a load cannot be traced.

    Examples
    --------
    >>> import gauss
    >>> bar = gauss.load_linkage("four_bar")
    >>> from gauss.linkages import cycle_kernel
    >>> kernel = cycle_kernel(bar.chain)
    >>> kernel.__class__.__name__
    'Kernel'
    """

    def forces(x):
        reactions, torque = react(move(chain, x[0], x[1], x[2], _poses(chain, x[3:])))
        return np.array([torque, *(part for value in reactions.values() for part in (value.real, value.imag))], dtype=object)

    return trace(forces, 3 + 3 * len(chain.triads))


def reduced_kernel(chain: Chain) -> Kernel:
    """Crank angle, crank speed, and poses near those of ternary links → J_e, b, Q.

    Parameters
    ----------
    chain : Chain
        The linkage.

    Returns
    -------
    Kernel
        Machine code.

    Raises
    ------
    LinkageError
        If the law of a load cannot be traced.

    Examples
    --------
    >>> import gauss
    >>> bar = gauss.load_linkage("four_bar")
    >>> from gauss.linkages import reduced_kernel
    >>> kernel = reduced_kernel(bar.chain)
    >>> type(kernel).__name__
    'Kernel'
    """

    def terms(x):
        poses = _poses(chain, x[2:])
        unit = move(chain, x[0], 1.0, 0.0, poses)
        actual = move(chain, x[0], x[1], 0.0, poses) if any(load.varies for load in chain.loads) else unit
        return np.array([*inertia_terms(unit), generalised_force(unit, actual)], dtype=object)

    return trace(terms, 2 + 3 * len(chain.triads), batch=False)


def _poses(chain: Chain, entries) -> dict:
    return {triad.ternary.name: entries[3 * k : 3 * k + 3] for k, triad in enumerate(chain.triads)}


def inertia_terms(motion: LinkageKinematics):
    """J_e and b [kg m²] of a motion with crank speed 1 and acceleration 0."""
    J_e = b = 0.0 * motion.crank_angle
    for link in motion.chain.links:
        moving, G = motion.links[link.name], centre(motion, link)
        v, a = moving.velocity(G), moving.acceleration(G)
        J_e = J_e + link.mass * dot(v, v) + link.inertia * moving.omega * moving.omega
        b = b + link.mass * dot(v, a) + link.inertia * moving.omega * moving.alpha
    return J_e, b


def generalised_force(unit: LinkageKinematics, actual: LinkageKinematics):
    """Q [N m]: power of gravity and of the loads of the actual motion on the motion with crank speed 1."""
    Q = 0.0 * unit.crank_angle
    for link in unit.chain.links:
        Q = Q + link.mass * dot(unit.chain.gravity, unit.links[link.name].velocity(centre(unit, link)))
    for load in unit.chain.loads:
        Q = Q + power(unit, acting(load, actual), load.link)
    return Q
