"""Bodies that move freely, in machine code for all of them at once: poses, free motion, and the end of a time step.

    J ω̇ = −ω × J ω,   m u̇ = m g,   q₁ = q₀ ⊕ h (s v₀ + (1 − s) v₁)

A body hangs on a free joint between the ground and a frame of its own. Velocities (ω, u) of the bodies are in world axes, at
the centres of mass. The step is that of :mod:`gauss.dynamics.contact.moreau_step`.
"""

from functools import cache

import numpy as np

from gauss.codegen import Function, Kernel, from_disk, write
from gauss.dynamics.contact.pair_kernels import POSE
from gauss.rotations import cross
from gauss.scene.pairs import PAIRS
from gauss.system import PlacedJoint
from gauss.system.manifold import turned

FREE = PAIRS["free"]
CONSTANTS = 28  # joint frame in the ground and in the body (12 + 12), principal inertias (3), mass
BEGUN = 55  # coordinates (7), pose (12), velocities (6), their rates with q̈ = 0 (6), without (6), inertia and inverse (18)


def constants(joint: PlacedJoint, Phi: np.ndarray) -> np.ndarray:
    """Constants (28,) of a body by its free joint and its inertias Phi (6,)."""
    frames = joint.R_parent, joint.p_parent, joint.R_child, joint.p_child
    return np.concatenate([*map(np.ravel, frames), Phi[:4]])


class _FreeBody:
    """One body, traced."""

    def __init__(self, q, given):
        R_parent, p_parent, R_child, p_child, self.J, self.mass = np.split(given, [9, 12, 21, 24, 27])
        R, p = FREE.pose(q)
        self.axes = R_parent.reshape(3, 3)  # of the rates of the joint point
        self.turning = self.axes @ R  # axes of the angular velocity
        self.R = self.turning @ R_child.reshape(3, 3).T
        self.arm = self.R @ p_child  # from the centre of mass to the joint point
        self.x = p_parent + self.axes @ p - self.arm

    def velocities(self, v):
        """Angular velocity and velocity of the centre of mass."""
        W = self.turning @ v[3:]
        return W, self.axes @ v[:3] - cross(W, self.arm)

    def rates(self, spin, pull):
        """Rates (6,) of the joint from changes of the velocities."""
        return np.concatenate([self.axes.T @ (pull + cross(spin, self.arm)), self.turning.T @ spin])

    def bias(self, W):
        """Acceleration of the centre of mass while the rates of the joint are constant."""
        return -cross(W, cross(W, self.arm))

    def free_acceleration(self, v, gravity):
        """Angular and linear acceleration without contacts, less those of constant rates."""
        W, _ = self.velocities(v)
        omega = self.R.T @ W
        return self.R @ (cross(self.J * omega, omega) / self.J), gravity - self.bias(W)


def _moved(q, theta):
    return np.concatenate([q[:3] + theta[:3], turned(q[3:], theta[3:])])


def _begin(q, v, given, gravity, expected, step):
    h, share = step
    at = _moved(q, (share * h) * v)
    body = _FreeBody(at, given)
    spin, pull = body.free_acceleration(v, gravity)
    ahead = v + (share * h) * body.rates(spin + expected[:3], pull + expected[3:])
    W, u = body.velocities(v)
    inertia = [body.R @ (entries[:, None] * body.R.T) for entries in (body.J, 1.0 / body.J)]
    return at, body.R, body.x, W, u, np.zeros(3), body.bias(W), *body.free_acceleration(ahead, gravity), *inertia


def _end(at, v, given, change, step):
    h, share = step
    v = v + _FreeBody(at, given).rates(change[:3], change[3:])
    return _moved(at, ((1.0 - share) * h) * v), v


def _place(R, x, W, u, spin, pull, own, centre):
    """Pose and velocities of a shape that is fixed to a body."""
    R = R.reshape(3, 3)
    arm = R @ centre
    turning = cross(W, arm)
    return R @ own.reshape(3, 3), x + arm, W, u + turning, spin, pull + cross(spin, arm) + cross(W, turning)


def place_function() -> Function:
    """Traced function of :attr:`FreeBodyKernels.place`."""
    return write(_place, 9, 3, 3, 3, 3, 3, 9, 3, name="place")


def begin_function() -> Function:
    """Traced function of :attr:`FreeBodyKernels.begin`."""
    return write(_begin, 7, 6, CONSTANTS, 3, 6, 2, name="begin")


def end_function() -> Function:
    """Traced function of :attr:`FreeBodyKernels.end`."""
    return write(_end, 7, 6, CONSTANTS, 6, 2, name="end")


class FreeBodyKernels:
    """Machine code over columns, one for each body or shape.

    Attributes
    ----------
    begin : Kernel
        (q, v, constants, gravity, accelerations expected from contacts, h, share) → begin of a step (55,).
    end : Kernel
        (q after the share, v, constants, change of the velocities, h, share) → (q, v) at its end.
    place : Kernel
        (rotation, centre, velocities and biases of a body, rotation and centre of a shape in it) → pose (24,) of the shape.
    """

    def __init__(self):
        self.begin = Kernel(begin_function())
        self.end = Kernel(end_function())
        self.place = Kernel(place_function())
        assert (self.begin.n_out, self.place.n_out) == (BEGUN, POSE)


@cache
def free_body_kernels() -> FreeBodyKernels:
    """Machine code of free bodies, made once on a machine."""
    return from_disk((FreeBodyKernels,), FreeBodyKernels)
