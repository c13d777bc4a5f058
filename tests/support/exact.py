"""Forward dynamics of trees of revolute joints in 60 digits: an independent route, by inverse dynamics column by column.

Newton–Euler inverse dynamics gives τ = M q̈ + h; M is collected from unit accelerations and M q̈ = τ − h is solved by
Gaussian elimination. The data of the system (frames, inertias, state) are taken as exact binary numbers.
"""

import mpmath as mp
import numpy as np

DIGITS = 60


def accelerations(system, state, effort):
    """Joint accelerations of a tree of revolute joints, list of mpf."""
    with mp.workdps(DIGITS):
        n = len(system.joints)
        zero = [mp.mpf(0)] * n
        v = [mp.mpf(x) for x in state.v]
        gravity = [mp.mpf(x) for x in system.scene.gravity]
        bias = _inverse_dynamics(system, state, v, zero, gravity)
        M = mp.matrix(n)
        for k in range(n):
            unit = list(zero)
            unit[k] = mp.mpf(1)
            column = _inverse_dynamics(system, state, zero, unit, [mp.mpf(0)] * 3)
            for i in range(n):
                M[i, k] = column[i]
        right = mp.matrix([mp.mpf(t) - b for t, b in zip(effort, bias, strict=True)])
        return list(mp.lu_solve(M, right))


def relative_error(computed, exact):
    """Largest difference over the largest exact value."""
    with mp.workdps(DIGITS):
        difference = max(abs(mp.mpf(float(c)) - e) for c, e in zip(computed, exact, strict=True))
        return float(difference / max(abs(e) for e in exact))


def _inverse_dynamics(system, state, v, acceleration, gravity):
    bodies, outward = {-1: (_eye(), *[_zero()] * 4)}, []
    for edge in system.structure.tree:
        joint = system.joints[edge.constraint]
        k = joint.v.start
        R_p, x_p, W_p, alpha_p, a_p = bodies[joint.parent]
        R_joint = _mul(R_p, _exact(joint.R_parent))
        axis = [row[2] for row in R_joint]
        c, s = mp.cos(mp.mpf(state.q[k])), mp.sin(mp.mpf(state.q[k]))
        R = _mul(_mul(R_joint, [[c, -s, 0], [s, c, 0], [0, 0, 1]]), _transpose(_exact(joint.R_child)))
        to_joint, to_com = _apply(R_p, _exact(joint.p_parent)), _scale(-1, _apply(R, _exact(joint.p_child)))
        spin = _scale(v[k], axis)
        W = _add(W_p, spin)
        alpha = _add(alpha_p, _scale(acceleration[k], axis), _cross(W_p, spin))
        a_joint = _add(a_p, _cross(alpha_p, to_joint), _cross(W_p, _cross(W_p, to_joint)))
        a = _add(a_joint, _cross(alpha, to_com), _cross(W, _cross(W, to_com)))
        P = _add(x_p, to_joint)
        bodies[joint.child] = (R, _add(P, to_com), W, alpha, a)
        outward.append((joint, k, axis, P))
    effort = [mp.mpf(0)] * len(v)
    wrenches = {i: (_zero(), _zero()) for i in range(-1, len(bodies) - 1)}  # force, moment about the world's origin
    for joint, k, axis, P in reversed(outward):
        R, x, W, alpha, a = bodies[joint.child]
        J, m = _exact(system.Phi[6 * joint.child : 6 * joint.child + 3]), mp.mpf(system.Phi[6 * joint.child + 3])
        Rt = _transpose(R)
        turn = lambda w, R=R, Rt=Rt, J=J: _apply(R, [Ji * c for Ji, c in zip(J, _apply(Rt, w), strict=True)])  # noqa: E731
        force = _scale(m, _add(a, _scale(-1, gravity)))
        moment = _add(turn(alpha), _cross(W, turn(W)), _cross(x, force))
        force, moment = _add(force, wrenches[joint.child][0]), _add(moment, wrenches[joint.child][1])
        effort[k] = _dot(axis, _add(moment, _scale(-1, _cross(P, force))))
        inner = wrenches[joint.parent]
        wrenches[joint.parent] = (_add(inner[0], force), _add(inner[1], moment))
    return effort


def _exact(array):
    return [[mp.mpf(float(x)) for x in row] for row in array] if np.ndim(array) == 2 else [mp.mpf(float(x)) for x in array]


def _eye():
    return [[mp.mpf(i == j) for j in range(3)] for i in range(3)]


def _zero():
    return [mp.mpf(0)] * 3


def _transpose(A):
    return [list(row) for row in zip(*A, strict=True)]


def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _apply(A, b):
    return [_dot(row, b) for row in A]


def _mul(A, B):
    columns = _transpose(B)
    return [[_dot(row, column) for column in columns] for row in A]


def _cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def _scale(s, a):
    return [s * x for x in a]


def _add(*vectors):
    return [sum(parts) for parts in zip(*vectors, strict=True)]
