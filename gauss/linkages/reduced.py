"""A linkage reduced to its crank: J_e θ̈ + b θ̇² = M1 + Q.

With primes for derivatives at crank speed 1 and acceleration 0: J_e = Σ m |G'|² + J θ'², b = Σ m G'·G'' + J θ' θ'' (half the
slope of J_e), and Q the power of gravity and loads on that motion.
"""

from gauss.linkages.loads import acting, centre, power
from gauss.linkages.motion import LinkageKinematics
from gauss.linkages.plane import dot


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
