"""Rotations in space over numbers or symbols: matrices R, unit quaternions Q, rotation vectors θ with Q = exp(θ/2).

Quaternions are unit, scalar first (w, x, y, z). ``R_ab`` takes components in frame b to frame a.
"""

import numpy as np

from gauss.codegen import Expression, as_number
from gauss.shapes import Shaped

Vector = Shaped[np.ndarray, " 3"]
Matrix = Shaped[np.ndarray, "3 3"]
Quaternion = Shaped[np.ndarray, " 4"]

AXIS_NAMES = ("x", "y", "z")
SMALL_ANGLE = 0.03  # rad: below it the power series are exact to round-off with the terms kept here
ROUNDED_ENTRY = 1e-15  # distance of an entry of a constant rotation from 0 or ±1 that is round-off
SMALL_SINE = 1e-8  # of half an angle: below it sin and angle agree to round-off


def cross(a: Vector, b: Vector) -> Vector:
    """Vector product a × b."""
    a1, a2, a3 = a
    b1, b2, b3 = b
    return np.array([a2 * b3 - a3 * b2, a3 * b1 - a1 * b3, a1 * b2 - a2 * b1])


def skew(a: Vector) -> Matrix:
    """Matrix [a]× with [a]× b = a × b."""
    a1, a2, a3 = a
    return np.array([[0.0, -a3, a2], [a3, 0.0, -a1], [-a2, a1, 0.0]])


def about_z(angle) -> Matrix:
    """Rotation by an angle [rad] about the z-axis."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def about_x(angle) -> Matrix:
    """Rotation by an angle [rad] about the x-axis."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


def about_y(angle) -> Matrix:
    """Rotation by an angle [rad] about the y-axis."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def congruent(R: Matrix, M: Matrix) -> Matrix:
    """R M Rᵀ; about a coordinate axis with half the multiplications.

    With u = s (m₁₁ − m₂₂) + c (m₁₂ + m₂₁) a turn in the plane gives m₁₁ − s u, m₂₂ + s u, c u − m₂₁ and c u − m₁₂.
    """
    axis = _kept_axis(R)
    if axis is None:
        return R @ M @ R.T
    i, j, k = (axis + 1) % 3, (axis + 2) % 3, axis
    c, s = R[i, i], R[j, i]
    u = s * (M[i, i] - M[j, j]) + c * (M[i, j] + M[j, i])
    turned = np.empty((3, 3), dtype=np.result_type(R, M))
    turned[i, i], turned[j, j], turned[k, k] = M[i, i] - s * u, M[j, j] + s * u, M[k, k]
    turned[i, j], turned[j, i] = c * u - M[j, i], c * u - M[i, j]
    turned[i, k], turned[j, k] = c * M[i, k] - s * M[j, k], s * M[i, k] + c * M[j, k]
    turned[k, i], turned[k, j] = c * M[k, i] - s * M[k, j], s * M[k, i] + c * M[k, j]
    return turned


def _kept_axis(R: Matrix) -> int | None:
    """Coordinate axis about which a rotation turns by no multiple of a right angle, if that is known."""
    known = np.array([[as_number(entry) for entry in row] for row in R], dtype=object)
    for axis in range(3):
        kept = [known[axis, (axis + k) % 3] for k in range(3)]
        if kept == [1.0, 0.0, 0.0] and known[axis - 2, axis - 2] not in (-1.0, 0.0, 1.0):
            return axis
    return None


def from_rpy(roll, pitch, yaw) -> Matrix:
    """Rotation of fixed-axis roll, pitch, yaw angles [rad] as in URDF: Rz(yaw) Ry(pitch) Rx(roll)."""
    return about_z(yaw) @ about_y(pitch) @ about_x(roll)


def from_quaternion(Q: Quaternion) -> Matrix:
    """Rotation matrix of a unit quaternion."""
    w, x, y, z = Q
    return np.array(
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
        ]
    )


def to_quaternion(R: Matrix) -> Quaternion:
    """Unit quaternion of a rotation matrix, with w ≥ 0 (Shepperd 1978: the largest component first)."""
    squares = np.array([np.trace(R), R[0, 0], R[1, 1], R[2, 2]])
    k = int(np.argmax(squares))
    if k == 0:
        Q = np.array([1.0 + np.trace(R), R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    else:
        i = k - 1
        j, m = (i + 1) % 3, (i + 2) % 3
        Q = np.empty(4)
        Q[0] = R[m, j] - R[j, m]
        Q[1 + i] = 1.0 + R[i, i] - R[j, j] - R[m, m]
        Q[1 + j] = R[j, i] + R[i, j]
        Q[1 + m] = R[m, i] + R[i, m]
    Q = Q / np.linalg.norm(Q)
    return -Q if Q[0] < 0 else Q


def multiply(P: Quaternion, Q: Quaternion) -> Quaternion:
    """Quaternion product P ∘ Q."""
    p0, p1, p2, p3 = P
    q0, q1, q2, q3 = Q
    return np.array(
        [
            p0 * q0 - p1 * q1 - p2 * q2 - p3 * q3,
            p0 * q1 + p1 * q0 + p2 * q3 - p3 * q2,
            p0 * q2 - p1 * q3 + p2 * q0 + p3 * q1,
            p0 * q3 + p1 * q2 - p2 * q1 + p3 * q0,
        ]
    )


def exponential(rotation_vector: Vector) -> Quaternion:
    """Unit quaternion of a rotation vector θ: (cos |θ|/2, sin(|θ|/2) θ/|θ|)."""
    square = rotation_vector @ rotation_vector
    small = square < SMALL_ANGLE**2
    angle = np.sqrt(_away_from_zero(small, square))
    w = _choose(small, lambda: _series(square, 1, -1 / 8, 1 / 384, -1 / 46080), lambda: np.cos(angle / 2))
    half = _choose(small, lambda: _series(square, 1 / 2, -1 / 48, 1 / 3840, -1 / 645120), lambda: np.sin(angle / 2) / angle)
    return np.array([w, *(half * rotation_vector)])


def exponential_lead(rotation_vector: Vector) -> Quaternion:
    """Difference of exp(θ), see :func:`exponential`, from 1: −2 sin²(|θ|/4) first."""
    quarter = exponential(0.5 * rotation_vector)
    return np.array([-2.0 * (quarter[1:] @ quarter[1:]), *exponential(rotation_vector)[1:]])


def rotate(Q: Quaternion, vector: Vector) -> Vector:
    """Vector p + 2 (w u × p + u × (u × p)) / |Q|², Q = (w, u): turned to rounding, whether Q is of unit length or not."""
    turn = cross(Q[1:], vector)
    return vector + (2.0 / (Q @ Q)) * (Q[0] * turn + cross(Q[1:], turn))


def conjugate(Q: Quaternion) -> Quaternion:
    """Quaternion Q̄ = (w, −u), the inverse of a unit one."""
    w, x, y, z = Q
    return np.array([w, -x, -y, -z])


def rotation_vector_rate(theta: Vector, omega: Vector) -> Vector:
    """Rate of the rotation vector θ of R₀ exp(θ) that turns with body-fixed angular velocity ω.

    θ̇ = ω + ½ θ × ω + k θ × (θ × ω), k = (1 − (|θ|/2) cot(|θ|/2))/|θ|²
    (Hairer, Lubich, Wanner, Geometric Numerical Integration, III.4, eq. 4.5 and IV.8).
    """
    return omega + rotation_vector_lead(theta, omega)


def rotation_vector_lead(theta: Vector, omega: Vector) -> Vector:
    """Difference θ̇ − ω, see :func:`rotation_vector_rate`; small where θ is."""
    square = theta @ theta
    small = square < SMALL_ANGLE**2
    large = _away_from_zero(small, square)
    half = np.sqrt(large) / 2.0
    k = _choose(
        small,
        lambda: _series(square, 1 / 12, 1 / 720, 1 / 30240),
        lambda: (1.0 - half / np.tan(half)) / large,
    )
    turn = cross(theta, omega)
    return 0.5 * turn + k * cross(theta, turn)


def rotation_vector_velocity(theta: Vector, rate: Vector) -> Vector:
    """Body-fixed angular velocity ω of R₀ exp(θ) whose rotation vector has the rate θ̇; see :func:`rotation_vector_rate`.

    ω = θ̇ − (1 − cos|θ|)/|θ|² θ × θ̇ + (|θ| − sin|θ|)/|θ|³ θ × (θ × θ̇)
    """
    first, second = _velocity_parts(theta, rate)
    return rate - first + second


def rotation_vector_velocity_lead(theta: Vector, rate: Vector) -> Vector:
    """Difference ω − θ̇, see :func:`rotation_vector_velocity`; small where θ is."""
    first, second = _velocity_parts(theta, rate)
    return second - first


def _velocity_parts(theta: Vector, rate: Vector) -> tuple[Vector, Vector]:
    square = theta @ theta
    small = square < SMALL_ANGLE**2
    large = _away_from_zero(small, square)
    angle = np.sqrt(large)
    near = _series(square, 1 / 2, -1 / 24, 1 / 720, -1 / 40320), _series(square, 1 / 6, -1 / 120, 1 / 5040, -1 / 362880)
    first = _choose(small, lambda: near[0], lambda: (1.0 - np.cos(angle)) / large)
    second = _choose(small, lambda: near[1], lambda: (angle - np.sin(angle)) / (large * angle))
    turn = cross(theta, rate)
    return first * turn, second * cross(theta, turn)


def _away_from_zero(small, square):
    """Square of an angle, 1 where it is small: the branch that is not chosen has finite derivatives there."""
    return _choose(small, lambda: 1.0, lambda: square)


def _series(x, *coefficients):
    total = coefficients[-1]
    for coefficient in coefficients[-2::-1]:
        total = total * x + coefficient
    return total


def _choose(condition, near, far):
    """One of two values; of a traced condition both are traced and selected."""
    if isinstance(condition, Expression):
        return condition.graph.select(condition, near(), far())
    return near() if condition else far()


def to_rotation_vector(R: Matrix) -> Vector:
    """Rotation vector of a rotation matrix, angle in [0, π]."""
    Q = to_quaternion(R)
    sine = np.linalg.norm(Q[1:])
    return 2.0 * Q[1:] if sine < SMALL_SINE else 2.0 * np.arctan2(sine, Q[0]) / sine * Q[1:]


def along(axis: Vector) -> Matrix:
    """Rotation whose third column is the unit axis; a signed permutation when the axis is a coordinate axis."""
    helper = np.eye(3)[0 if abs(axis[0]) < 0.9 else 1]
    x = helper - axis * (axis @ helper)
    x = x / np.linalg.norm(x)
    return clean(np.column_stack([x, cross(axis, x), axis]))


def clean(R):
    """Set entries of a constant rotation at round-off from 0 and ±1 (cos 90° = 6e-17) to these."""
    nearest = np.round(R)
    return np.where(np.abs(R - nearest) < ROUNDED_ENTRY, nearest, R) + 0.0
