"""What is done at one link of a large scene, each a function of its constants and of what its neighbours hand on.

Each takes the link, the kinematics of the joint to its inner side, whether the link is the child there, and vectors.
"""

import numpy as np

from gauss.dynamics.aba import Elimination, acceleration_outward, add, eliminate, force_inward, inertia_to_inner
from gauss.dynamics.rnea import JointKinematics, force_to_inner, gyroscopic, inertial, kinematics_of_joint, to_outer
from gauss.dynamics.tree_recursion import UPPER, symmetric


def _passage(R, p, S, bias=None) -> JointKinematics:
    return JointKinematics(R, p, S, np.zeros(6) if bias is None else bias)


def pass_outward(link, pair, forward, q, v, inner):
    """Passage across the joint, angular velocity of the link, and what it needs to go on turning."""
    kin, omega = kinematics_of_joint(pair, forward, link, q, v, inner)
    return *kin, omega, gyroscopic(link, omega)


def place(link, pair, forward, q, inner):
    """Pose (12,) of the link in world: rotation and origin."""
    kin, _ = kinematics_of_joint(pair, forward, link, q, np.zeros(pair.n_v), np.zeros(3))
    R, x = inner[:9].reshape(3, 3), inner[9:]
    R_here = R @ link.R @ kin.R
    return (np.concatenate([R_here.ravel(), x + R @ (link.p + link.R @ kin.p)]),)


def eliminate_link(link, pair, forward, R, p, S, collected, inner):
    """Elimination of the joint, and the inertia of the inner link with what it feels of this one."""
    kin = _passage(R, p, S)
    found = eliminate(kin, add(link.inertia, _inertia(collected)))
    moved = add(_inertia(inner), inertia_to_inner(link, kin, found.projected))
    return found.U, found.D_inverse, _flat(found.projected), _flat(moved)


def _inertia(numbers):
    A, B, C = np.split(numbers, [6, 15])
    return symmetric(A), B.reshape(3, 3), symmetric(C)


def _flat(inertia) -> np.ndarray:
    A, B, C = inertia
    return np.concatenate([A[UPPER], B.ravel(), C[UPPER]])


def carry_row(link, pair, forward, R, p, S, U, D_inverse, pushes):
    """What the joint feels (k, m) of force vectors (6, m) on the link, and what remains of them for the inner link."""
    kin, eliminated = _passage(R, p, S), Elimination(U, D_inverse, (np.zeros((3, 3)),) * 3)
    felt, onward = [], []
    for push in pushes.T:
        short, pull = force_inward(kin, eliminated, -push, np.zeros(6), np.zeros(pair.n_v))
        felt.append(short)
        onward.append(-force_to_inner(link, kin, pull))
    return np.array(felt, dtype=object).T, np.array(onward, dtype=object).T


def pull(link, pair, forward, R, p, S, U, D_inverse, projected, force, bias, driven, inner):
    """What the drive of the joint falls short of, and the force vector of the inner link with what remains for it."""
    kin, eliminated = _passage(R, p, S, bias), Elimination(U, D_inverse, _inertia(projected))
    short, pull = force_inward(kin, eliminated, force, bias, driven)
    return short, inner + force_to_inner(link, kin, pull)


def carry(link, pair, forward, R, p, S, U, D_inverse, short, bias, inner):
    """Accelerations of the joint and the link."""
    kin, eliminated = _passage(R, p, S, bias), Elimination(U, D_inverse, None)
    return acceleration_outward(kin, eliminated, short, to_outer(link, kin, inner) + bias)


def move_outward(link, pair, forward, R, p, S, bias, rates, inner):
    """Acceleration of the link, given that of the joint."""
    kin = _passage(R, p, S, bias)
    return (to_outer(link, kin, inner) + bias + S @ rates,)


def balance(link, pair, forward, R, p, S, omega, acceleration, pushed, effort, inner):
    """What the joint lacks to move as it does, and the force vector that the inner link has to bear."""
    kin, force = _passage(R, p, S), inertial(link, omega, acceleration) + pushed
    return effort - S.T @ force, inner + force_to_inner(link, kin, force)
