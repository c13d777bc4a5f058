"""Values as users type them, checked at once and turned into plain floats and tuples."""

import inspect
import math
from collections.abc import Callable
from numbers import Real

import numpy as np

from gauss import rotations
from gauss.errors import SceneError
from gauss.math import piecewise
from gauss.tracing import Expression, Graph

UNIT_TOLERANCE = 1e-6  # a rotation typed with 7 digits is meant as one; it is normalised


def number(value, what: str, unit: str, *, positive=False, non_negative=False) -> float:
    """Finite float, or a SceneError that says what was expected."""
    sign = "a positive " if positive else "a non-negative " if non_negative else "a "
    if isinstance(value, bool) or not isinstance(value, Real):
        raise SceneError(f"{what}: expected {sign}number in [{unit}], got {value!r} ({type(value).__name__}).")
    value = float(value)
    if not math.isfinite(value) or (positive and value <= 0) or (non_negative and value < 0):
        raise SceneError(f"{what}: expected {sign}finite number in [{unit}], got {value!r}.")
    return value


def vector(value, what: str, unit: str, size: int = 3) -> tuple[float, ...]:
    """Tuple of finite floats of the given size."""
    try:
        entries = np.asarray(value, dtype=object).reshape(-1).tolist()
    except ValueError:
        entries = []
    if isinstance(value, str) or len(entries) != size:
        raise SceneError(f"{what}: expected {size} numbers in [{unit}], got {value!r}.")
    return tuple(number(entry, what, unit) for entry in entries)


def direction(value, what: str) -> tuple[float, float, float]:
    """Vector of three numbers that is not zero; its length does not matter."""
    entries = vector(value, what, "1")
    if not np.linalg.norm(entries):
        raise SceneError(f"{what}: expected a direction, got the zero vector {entries}; give for instance (0, 0, 1).")
    return entries


def unit(entries) -> np.ndarray:
    """Unit vector along a direction, exact for coordinate axes."""
    array = np.asarray(entries, dtype=float)
    return rotations.clean(array / np.linalg.norm(array))


def rotation(value, what: str) -> tuple:
    """Rotation as (roll, pitch, yaw) [rad], unit quaternion (w, x, y, z) or 3 × 3 matrix; kept as given."""
    size = np.size(np.asarray(value, dtype=object))
    if size not in (3, 4, 9):
        raise SceneError(
            f"{what}: expected (roll, pitch, yaw) in [rad], a quaternion (w, x, y, z) or a 3 × 3 matrix, got {value!r}."
        )
    entries = vector(value, what, "rad" if size == 3 else "1", size)
    if size == 3 and max(map(abs, entries)) > 2 * np.pi:
        raise SceneError(f"{what}: (roll, pitch, yaw) are in [rad], got {value!r}; np.deg2rad turns degrees into them.")
    if size == 4 and abs(np.linalg.norm(entries) - 1.0) > UNIT_TOLERANCE:
        raise SceneError(f"{what}: the quaternion {entries} has length {np.linalg.norm(entries):.6g}, expected 1.")
    if size == 9:
        R = np.reshape(entries, (3, 3))
        if np.abs(R @ R.T - np.eye(3)).max() > UNIT_TOLERANCE or np.linalg.det(R) < 0:
            raise SceneError(f"{what}: {value!r} is not a rotation matrix (rows orthonormal, determinant +1).")
        return tuple(entries[i : i + 3] for i in (0, 3, 6))
    return entries


def rotation_matrix(value: tuple) -> np.ndarray:
    """Rotation matrix (3, 3) of a checked rotation; typed digits are orthonormalised."""
    if np.size(value) == 3:
        return rotations.clean(rotations.from_rpy(*value))
    if np.size(value) == 4:
        return rotations.clean(rotations.from_quaternion(np.array(value) / np.linalg.norm(value)))
    R = np.array(value, dtype=float)
    if np.abs(R @ R.T - np.eye(3)).max() > 1e-15:
        U, _, Vt = np.linalg.svd(R)
        R = U @ Vt
    return rotations.clean(R)


def law(value, what: str, unit: str, size: int = 1):
    """Return a constant, or a function of (t) or (t, motion), as it was given after a check."""
    if not callable(value):
        return number(value, what, unit) if size == 1 else vector(value, what, unit, size)
    if arguments(value) not in (1, 2):
        raise SceneError(
            f"{what}: a law is called as law(t) or law(t, motion); {value!r} takes {arguments(value)} arguments."
        )
    return value


def as_function(law_or_constant) -> Callable:
    """Function of (t, motion), whatever form the law was given in."""
    if not callable(law_or_constant):
        return lambda t, motion: law_or_constant
    if arguments(law_or_constant) == 1:
        return lambda t, motion: law_or_constant(t)
    return law_or_constant


def smooth_law(value, what: str, unit: str, size: int = 1):
    """Return a constant, a spline of scipy, or a function of one variable that can be differentiated, after a check."""
    if not callable(value):
        return number(value, what, unit) if size == 1 else vector(value, what, unit, size)
    try:
        result = np.ravel(np.asarray(evaluate(value, Graph().symbol("t")), dtype=object))
    except Exception as error:
        raise SceneError(
            f"{what}: the law cannot be differentiated ({error}). Write it as a function of one variable with arithmetic, "
            "functions of numpy (np.sin, not math.sin) or gauss.math; a table goes into scipy.interpolate.CubicSpline."
        ) from error
    if len(result) != size or not all(isinstance(entry, Real | Expression) for entry in result):
        raise SceneError(f"{what}: the law must return {size} number{'s' * (size > 1)} in [{unit}], got {list(result)!r}.")
    return value


def evaluate(law, x):
    """Value of a checked law at a number or a traced expression."""
    if not callable(law):
        return law
    if hasattr(law, "c") and hasattr(law, "extrapolate"):  # a piecewise polynomial of scipy
        return piecewise(law, x)
    return law(x)


def arguments(function) -> int:
    """Number of arguments that a law takes."""
    try:
        return len(inspect.signature(function).parameters)
    except (TypeError, ValueError):  # a builtin that hides its signature
        return 1


def text(value, what: str) -> str:
    """Non-empty name."""
    if not isinstance(value, str) or not value.strip():
        raise SceneError(f"{what}: expected a non-empty name, got {value!r}.")
    return value
