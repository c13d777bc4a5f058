"""Kinematic pairs as Pinocchio joints: coordinates, rates and accelerations of one in terms of the other.

    q_pin = configuration(q),   v_pin = T v,   a_pin = T a + γ,   and by equal power P = Tᵀ τ_pin

Pinocchio's tree grows outward only. Where the tree of gauss passes a joint from its child to its parent, Pinocchio
gets the inverse motion: a chain of motions exp(s₁q₁) exp(s₂q₂) … is inverted by −q in reverse order, a rotation R(Q)
and a placement (R, p) by hand.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gauss.errors import GaussError, did_you_mean, extra
from gauss.rotations import cross, from_quaternion, skew
from gauss.system import PlacedJoint

with extra():
    import pinocchio as pin

ONE, NULL = np.eye(3), np.zeros((3, 3))


@dataclass(frozen=True)
class JointMap:
    """Joint of Pinocchio that stands for a pair, and the maps to it."""

    model: object
    configuration: Callable  # q (n_q,) ↦ q_pin
    T: Callable  # q ↦ T (nv_pin, k)
    bias: Callable  # q, v ↦ γ (nv_pin,), acceleration of Pinocchio's rates at zero acceleration of gauss's


def forward(joint: PlacedJoint) -> JointMap:
    """Joint from its parent to its child.

    Raises
    ------
    GaussError
        If Pinocchio has no counterpart of the pair.
    """
    if joint.pair.kind in CHAINS:
        return _chain(CHAINS[joint.pair.kind](joint), joint.pair.n_v, 1)
    return _spatial(joint)[0]


def backward(joint: PlacedJoint) -> JointMap:
    """Inverse motion: joint from its child to its parent.

    Raises
    ------
    GaussError
        If Pinocchio has no counterpart of the pair.
    """
    if joint.pair.kind in CHAINS:
        return _chain(CHAINS[joint.pair.kind](joint), joint.pair.n_v, -1)
    return _spatial(joint)[1]


def _pitch(joint: PlacedJoint) -> float:
    _, E_v = joint.pair.subspace(np.array(joint.pair.reference))
    return float(E_v[2, 0])


# Motions about and along the axes of the joint frame, one after the other. A fixed joint is a hinge that is kept at
# zero: Pinocchio then reports its reaction like any other.
CHAINS: dict[str, Callable] = {
    "fixed": lambda joint: [pin.JointModelRZ()],
    "revolute": lambda joint: [pin.JointModelRZ()],
    "prismatic": lambda joint: [pin.JointModelPZ()],
    "screw": lambda joint: [pin.JointModelHZ(_pitch(joint))],
    "cylindrical": lambda joint: [pin.JointModelRZ(), pin.JointModelPZ()],
    "universal": lambda joint: [pin.JointModelRZ(), pin.JointModelRX()],
    "planar": lambda joint: [pin.JointModelPX(), pin.JointModelPY(), pin.JointModelRZ()],
}


def _chain(steps: list, freedoms: int, sign: int) -> JointMap:
    size, steps = len(steps), steps[::sign]
    model = steps[0]
    if size > 1:
        model = pin.JointModelComposite(size)
        for step in steps:
            model.addJoint(step, pin.SE3.Identity())
    T = sign * np.eye(size, freedoms)[::sign]
    zero = np.zeros(size)
    return JointMap(model, lambda q: T @ q, lambda q: T, lambda q, v: zero)


def _ball(sign: int) -> JointMap:
    def T(q):
        return ONE if sign > 0 else -from_quaternion(q)

    # d/dt (R ω) = R ω̇, because ω × ω = 0: no bias, neither forward nor inverted
    return JointMap(pin.JointModelSpherical(), lambda q: _xyzw(q, sign), T, lambda q, v: np.zeros(3))


def _free() -> JointMap:
    """Pinocchio's linear rate is ṗ in the axes of the child, u = Rᵀ ṗ; its derivative has the term −ω × u."""

    def T(q):
        return np.block([[from_quaternion(q[3:]).T, NULL], [NULL, ONE]])

    def bias(q, v):
        return np.concatenate([-cross(v[3:], from_quaternion(q[3:]).T @ v[:3]), np.zeros(3)])

    return JointMap(pin.JointModelFreeFlyer(), lambda q: np.concatenate([q[:3], _xyzw(q[3:], 1)]), T, bias)


def _free_inverted() -> JointMap:
    """Inverse of (R, p) is (Rᵀ, −Rᵀ p); with W = R ω its rates in the axes of the parent are W × p − ṗ and −W."""

    def configuration(q):
        return np.concatenate([-from_quaternion(q[3:]).T @ q[:3], _xyzw(q[3:], -1)])

    def T(q):
        R = from_quaternion(q[3:])
        return np.block([[-ONE, -skew(q[:3]) @ R], [NULL, -R]])

    def bias(q, v):
        return np.concatenate([cross(from_quaternion(q[3:]) @ v[3:], v[:3]), np.zeros(3)])

    return JointMap(pin.JointModelFreeFlyer(), configuration, T, bias)


SPATIAL: dict[str, tuple[JointMap, JointMap]] = {
    "ball": (_ball(1), _ball(-1)),
    "free": (_free(), _free_inverted()),
}


def _spatial(joint: PlacedJoint) -> tuple[JointMap, JointMap]:
    if joint.pair.kind not in SPATIAL:
        raise GaussError(
            f"joint {joint.name!r}: Pinocchio has no counterpart of a {joint.pair.kind} joint; "
            f"a crosscheck needs other joints. {did_you_mean(joint.pair.kind, [*CHAINS, *SPATIAL])}"
        )
    return SPATIAL[joint.pair.kind]


def _xyzw(Q: np.ndarray, sign: int) -> np.ndarray:
    """Quaternion (w, x, y, z) in Pinocchio's order; its conjugate when the sign is negative."""
    return np.array([sign * Q[1], sign * Q[2], sign * Q[3], Q[0]])
