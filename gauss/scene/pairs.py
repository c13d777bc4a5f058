"""Kinematic pairs: each is its pose map and its motion subspace (Featherstone, Rigid Body Dynamics Algorithms, ch. 4.4).

Both are written in the joint frame of the parent, whose z-axis is the axis of the pair. The pose map gives
rotation R (3, 3) and origin p (3,) [m] of the joint frame of the child; the motion subspace gives E_omega (3, k)
and E_v (3, k), so that the child turns with E_omega q̇ and its joint point moves with E_v q̇ relative to the parent.
Rates are the derivatives of the coordinates, except that a quaternion (w, x, y, z) has the three components of the
angular velocity in the axes of the joint frame of the child.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gauss import rotations
from gauss.codegen import forward, write
from gauss.shapes import Shaped

COMPLEX_STEP = 1e-100  # its error is its square: neither round-off nor truncation counts
E_X, E_Y, E_Z = np.eye(3)
ZERO = np.zeros(3)


@dataclass(frozen=True)
class Pair:
    """Kinematic pair with k rates.

    Parameters
    ----------
    kind : str
        Name of the pair.
    rates : tuple of str
        Suffix of each rate's name; ``("",)`` when the joint's own name says it all.
    reference : tuple of float
        Coordinates at the reference configuration; their number is n_q.
    pose, subspace : callable
        Pose map and motion subspace, functions of the coordinates.
    quaternion : int, optional
        Where a quaternion begins, in the coordinates and, with its angular velocity, in the rates.
    constant : bool
        Whether the subspace depends on no coordinate.
    """

    kind: str
    rates: tuple[str, ...]
    reference: tuple[float, ...]
    pose: Callable
    subspace: Callable
    quaternion: int | None = None
    constant: bool = True

    @property
    def n_q(self) -> int:
        """Number of coordinates."""
        return len(self.reference)

    @property
    def n_v(self) -> int:
        """Number of rates, k."""
        return len(self.rates)

    @property
    def turns(self) -> bool:
        """Whether any of its rates turns the child."""
        return bool(np.any(self.subspace(np.array(self.reference))[0]))

    def coordinate_rate(self, q: Shaped[np.ndarray, " nq"], v: Shaped[np.ndarray, " k"]) -> Shaped[np.ndarray, " nq"]:
        """Time derivative of the coordinates; of a quaternion ½ Q ∘ (0, ω)."""
        if self.quaternion is None:
            return v
        k = self.quaternion
        return np.concatenate([v[:k], rotations.multiply(q[k:], np.array([0.0, *v[k:]])) / 2])

    def subspace_on_child(self, q: Shaped[np.ndarray, " nq"]) -> tuple[np.ndarray, np.ndarray]:
        """E_omega and E_v (3, k) in the axes of the child, in which the angular velocity of a quaternion is given."""
        R, (E_omega, E_v) = self.pose(q)[0], self.subspace(q)
        k = self.quaternion
        turning = R.T @ E_omega if k is None else np.concatenate([np.zeros((3, k)), IDENTITY], axis=1)
        return turning, R.T @ E_v

    def subspace_bias(self, q: Shaped[np.ndarray, " nq"], v: Shaped[np.ndarray, " k"]):
        """E° q̇, angular and linear (3,): rate of the subspace at fixed parent times the rates, by differentiation.

        Quaternions have none: E_omega ω is R ω, its rate R (ω × ω).
        """
        if self.constant or self.quaternion is not None:
            return ZERO, ZERO
        if q.dtype == object:
            bias = write(self._bias, self.n_q, self.n_v, name=f"bias {self.kind}").inlined(q, v)  # q may hold constants
            return bias[:3], bias[3:]
        E_omega, E_v = self.subspace(q + 1j * COMPLEX_STEP * self.coordinate_rate(q, v))
        return np.imag(E_omega) / COMPLEX_STEP @ v, np.imag(E_v) / COMPLEX_STEP @ v

    def _bias(self, q, v):
        return tuple(forward(E, q, self.coordinate_rate(q, v)) @ v for E in self.subspace(q))


def _columns(*columns):
    return np.array(columns).T if columns else np.zeros((3, 0))


def screw(pitch: float) -> Pair:
    """Screw pair of given pitch [m/rad]."""
    subspace = _columns(E_Z), _columns(pitch * E_Z)
    return Pair("screw", ("",), (0.0,), lambda q: (rotations.about_z(q[0]), pitch * q[0] * E_Z), lambda q: subspace)


def _constant(kind, rates, pose, E_omega, E_v):
    return Pair(kind, rates, (0.0,) * len(rates), pose, lambda q: (E_omega, E_v))


IDENTITY = np.eye(3)
NONE = np.zeros((3, 0))

PAIRS: dict[str, Pair] = {
    pair.kind: pair
    for pair in (
        _constant("fixed", (), lambda q: (IDENTITY, ZERO), NONE, NONE),
        _constant("revolute", ("",), lambda q: (rotations.about_z(q[0]), ZERO), _columns(E_Z), _columns(ZERO)),
        _constant("prismatic", ("",), lambda q: (IDENTITY, q[0] * E_Z), _columns(ZERO), _columns(E_Z)),
        _constant(
            "cylindrical",
            ("angle", "slide"),
            lambda q: (rotations.about_z(q[0]), q[1] * E_Z),
            _columns(E_Z, ZERO),
            _columns(ZERO, E_Z),
        ),
        _constant(
            "planar",
            ("x", "y", "angle"),
            lambda q: (rotations.about_z(q[2]), np.array([q[0], q[1], 0.0])),
            _columns(ZERO, ZERO, E_Z),
            _columns(E_X, E_Y, ZERO),
        ),
        Pair(
            "universal",
            ("angle1", "angle2"),
            (0.0, 0.0),
            lambda q: (rotations.about_z(q[0]) @ rotations.about_x(q[1]), ZERO),
            lambda q: (_columns(E_Z, rotations.about_z(q[0]) @ E_X), np.zeros((3, 2))),
            constant=False,
        ),
        Pair(
            "ball",
            ("wx", "wy", "wz"),
            (1.0, 0.0, 0.0, 0.0),
            lambda q: (rotations.from_quaternion(q), ZERO),
            lambda q: (rotations.from_quaternion(q), np.zeros((3, 3))),
            quaternion=0,
            constant=False,
        ),
        Pair(
            "free",
            ("x", "y", "z", "wx", "wy", "wz"),
            (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0),
            lambda q: (rotations.from_quaternion(q[3:]), q[:3]),
            lambda q: (
                np.concatenate([np.zeros((3, 3)), rotations.from_quaternion(q[3:])], axis=1),
                np.concatenate([IDENTITY, np.zeros((3, 3))], axis=1),
            ),
            quaternion=3,
            constant=False,
        ),
        screw(0.0),
    )
}
