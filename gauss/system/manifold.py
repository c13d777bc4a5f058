"""The configuration manifold: coordinates are moved by rates; unit quaternions stay unit by the exponential map.

Near a configuration q₀ a chart θ (n_v,) describes q = q₀ ⊕ θ: a plain coordinate moves by its entry of θ, a quaternion
is multiplied by exp(θ) from the right. Any Runge–Kutta method in θ keeps its order and never leaves the manifold
(Munthe-Kaas 1999; Hairer, Lubich, Wanner, Geometric Numerical Integration, IV.8).
"""

from collections.abc import Iterator

import numpy as np

from gauss import rotations
from gauss.shapes import Shaped
from gauss.system.scale import turning
from gauss.system.system import System


def retract(system: System, q: Shaped[np.ndarray, " nq"], theta: Shaped[np.ndarray, " nv"]) -> Shaped[np.ndarray, " nq"]:
    """Coordinates q ⊕ θ."""
    if system.is_flat:
        return q + theta
    moved = np.empty_like(q)
    for joint in system.joints:
        k = joint.pair.quaternion
        here, step = q[joint.q], theta[joint.v]
        if k is None:
            moved[joint.q] = here + step
            continue
        moved[joint.q] = np.concatenate([here[:k] + step[:k], turned(here[k:], step[k:])])
    return moved


def turned(Q: np.ndarray, theta: np.ndarray) -> np.ndarray:
    """Unit quaternion Q ∘ exp(θ), for a rotation vector θ."""
    moved = rotations.multiply(Q, rotations.exponential(theta))
    return moved / np.sqrt(moved @ moved)


def displacement(system: System, q, moved, theta) -> Shaped[np.ndarray, " nv"]:
    """Differences of plain coordinates between q and ``moved``, as rounded; θ itself for quaternions."""
    if system.is_flat:
        return moved - q
    found = theta.copy()
    for joint in system.joints:
        here = slice(joint.q.start, joint.q.start + joint.n_plain)
        found[joint.v][: joint.n_plain] = moved[here] - q[here]
    return found


def rounded(system: System, q, moved, theta) -> Shaped[np.ndarray, " nv"]:
    """Rounding error of coordinates: a small displacement (n_v,) of ``moved`` that leads to q ⊕ θ.

    About a quaternion Q it is what Q ∘ (exp(θ) − 1), a small sum with few roundings, has more than the numbers moved by.
    """
    lost = theta - displacement(system, q, moved, theta)
    for own, place in _quaternions(system):
        here, there = q[own], moved[own]
        more = rotations.multiply(here, rotations.exponential_lead(theta[place])) - (there - here)
        lost[place] = 2.0 * rotations.multiply(rotations.conjugate(there), more)[1:]
    return lost


def chart_rate(system: System, theta: Shaped[np.ndarray, " nv"], v: Shaped[np.ndarray, " nv"]) -> Shaped[np.ndarray, " nv"]:
    """Rate θ̇ of the chart when the system moves with rates v."""
    return v if system.is_flat else v + chart_lead(system, theta, v)


def chart_lead(system: System, theta: Shaped[np.ndarray, " nv"], v: Shaped[np.ndarray, " nv"]) -> Shaped[np.ndarray, " nv"]:
    """By how much the rate of the chart differs from v; nothing along plain coordinates, and small where θ is."""
    return _about_quaternions(system, theta, v, rotations.rotation_vector_lead)


def velocity_lead(
    system: System, theta: Shaped[np.ndarray, " nv"], rate: Shaped[np.ndarray, " nv"]
) -> Shaped[np.ndarray, " nv"]:
    """By how much rates v differ from the rate of the chart, see :func:`chart_velocity`; small where θ is."""
    return _about_quaternions(system, theta, rate, rotations.rotation_vector_velocity_lead)


def in_parent_axes(
    system: System, q: Shaped[np.ndarray, " nq"], vector: Shaped[np.ndarray, " nv"]
) -> Shaped[np.ndarray, " nv"]:
    """Vector along the rates whose parts about quaternions are taken from the axes of the joint to those of its parent."""
    return _turned(system, q, vector, lambda Q: Q)


def in_own_axes(
    system: System, q: Shaped[np.ndarray, " nq"], vector: Shaped[np.ndarray, " nv"]
) -> Shaped[np.ndarray, " nv"]:
    """Vector along the rates, back from :func:`in_parent_axes`."""
    return _turned(system, q, vector, rotations.conjugate)


def _turned(system: System, q, vector, which) -> Shaped[np.ndarray, " nv"]:
    """Vector (n_v,) of which the parts that belong to quaternions are rotated."""
    if system.is_flat:
        return vector
    found = vector.copy()
    for own, place in _quaternions(system):
        found[place] = rotations.rotate(which(q[own]), vector[place])
    return found


def _about_quaternions(system: System, theta, vector, function) -> Shaped[np.ndarray, " nv"]:
    """Function of the parts of two vectors (n_v,) that belong to quaternions; zero along plain coordinates."""
    found = np.zeros_like(vector)
    for _, place in _quaternions(system):
        found[place] = function(theta[place], vector[place])
    return found


def _quaternions(system: System) -> Iterator[tuple[slice, slice]]:
    """Places of each quaternion in q, and of the angular velocity that belongs to it in v."""
    for joint in system.joints:
        if joint.pair.quaternion is not None:
            k = joint.pair.quaternion
            yield slice(joint.q.start + k, joint.q.stop), slice(joint.v.start + k, joint.v.stop)


def along_rates(
    system: System, q: Shaped[np.ndarray, " nq"], gradient: Shaped[np.ndarray, " nq"]
) -> Shaped[np.ndarray, " nv"]:
    """Derivative (n_v,) along the rates of a function of the coordinates with a gradient (n_q,).

    Transposed :func:`coordinate_rates`: ½ of the vector part of Q̄ ∘ ∂/∂Q about a quaternion.
    """
    found = []
    for joint in system.joints:
        k, own = joint.pair.quaternion, gradient[joint.q]
        if k is None:
            found.append(own)
            continue
        turning = 0.5 * rotations.multiply(rotations.conjugate(q[joint.q][k:]), own[k:])[1:]
        found.append(np.concatenate([own[:k], turning]))
    return np.concatenate(found)


def coordinate_rates(
    system: System, q: Shaped[np.ndarray, " nq"], v: Shaped[np.ndarray, " nv"]
) -> Shaped[np.ndarray, " nq"]:
    """Time derivative of the coordinates when the system moves with rates v."""
    return np.concatenate([joint.pair.coordinate_rate(q[joint.q], v[joint.v]) for joint in system.joints])


def chart_velocity(
    system: System, theta: Shaped[np.ndarray, " nv"], rate: Shaped[np.ndarray, " nv"]
) -> Shaped[np.ndarray, " nv"]:
    """Rates v of a system whose chart moves at the rate θ̇; see :func:`chart_rate`."""
    if system.is_flat:
        return rate
    v = rate.copy()
    for _, place in _quaternions(system):
        v[place] = rotations.rotation_vector_velocity(theta[place], rate[place])
    return v


def sizes(system: System, q: Shaped[np.ndarray, " nq"]) -> Shaped[np.ndarray, " nv"]:
    """Size of each coordinate, to which a relative tolerance refers; 1 rad for the directions of a quaternion."""
    if system.is_flat:
        return np.abs(q)
    size = np.ones(system.n_v).astype(q.dtype)
    for joint in system.joints:
        size[joint.v][: joint.n_plain] = np.abs(q[joint.q][: joint.n_plain])
    return size


def random_state(system: System, rng: "np.random.Generator", spread: float = np.pi, slide: float = 0.5, speed: float = 1.0):
    """Random coordinates and rates of an open system; they need not meet closures.

    Parameters
    ----------
    system : System
        The system.
    rng : numpy.random.Generator
        Source of randomness.
    spread, slide : float
        Angles, and the components of rotation vectors, are uniform in ±spread [rad], displacements in ±slide [m].
    speed : float
        Standard deviation of the rates [rad/s, m/s].
    """
    theta = rng.uniform(-1.0, 1.0, system.n_v) * np.where(turning(system), spread, slide)
    q = retract(system, system.reference.q, theta)
    return system.state(q, speed * rng.standard_normal(system.n_v))
