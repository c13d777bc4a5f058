"""Checks of values as users type them, which return plain floats and tuples; laws, and what calling them returns."""

import inspect
import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from numbers import Real
from types import FunctionType
from typing import Any

import numpy as np

from gauss import rotations
from gauss.arguments import is_masked
from gauss.codegen import Expression, Graph, branches
from gauss.errors import SceneError
from gauss.math import piecewise

UNIT_TOLERANCE = 1e-6  # error of the length of a quaternion, or of an orthonormal matrix, that is typed with 7 digits
ORTHONORMAL = 1e-15  # error of the same at round-off: nothing to normalise
FLOATS = float, np.float64  # kinds of numbers that laws return
OF_SIGNATURE = {"__wrapped__", "__signature__", "__text_signature__"}  # attributes of functions that say another signature


def keep(element, **checked):
    """Set fields of a frozen element to their checked values."""
    for field, value in checked.items():
        object.__setattr__(element, field, value)


def as_float(value) -> float:
    """Float of a real number; ±∞ of one that no float holds, as of 10**400."""
    try:
        return float(value)
    except OverflowError:
        return math.inf if value > 0 else -math.inf


def number(value, what: str, unit: str, *, positive=False, non_negative=False) -> float:
    """Finite float, or a SceneError with what was expected."""
    sign = "a positive " if positive else "a non-negative " if non_negative else "a "
    if type(value) is not float and (isinstance(value, bool) or not isinstance(value, Real)):
        raise SceneError(f"{what}: expected {sign}number in [{unit}], got {value!r} ({type(value).__name__}).")
    value = as_float(value)
    if not math.isfinite(value) or (positive and value <= 0) or (non_negative and value < 0):
        raise SceneError(f"{what}: expected {sign}finite number in [{unit}], got {value!r}.")
    return value


def vector(value, what: str, unit: str, size: int = 3) -> tuple[float, ...]:
    """Tuple of finite floats of the given size."""
    try:
        entries = np.asarray(value, dtype=object).reshape(-1).tolist()
    except ValueError:
        entries = []
    if isinstance(value, str) or is_masked(value) or len(entries) != size:
        raise SceneError(f"{what}: expected {size} numbers in [{unit}], got {value!r}.")
    return tuple(number(entry, what, unit) for entry in entries)


def times(value, what: str) -> tuple[float, ...]:
    """Tuple of finite times, in order."""
    if isinstance(value, str) or np.asarray(value, dtype=object).ndim != 1:
        raise SceneError(f"{what}: expected times in [s], as [5.0, 6.0]; got {value!r}.")
    return tuple(sorted(vector(value, what, "s", len(value)))) if len(value) else ()


def direction(value, what: str) -> tuple[float, float, float]:
    """Vector of three numbers that is not zero; its length does not matter."""
    entries = vector(value, what, "1")
    if not np.linalg.norm(entries):
        raise SceneError(f"{what}: expected a direction, got the zero vector {entries}; give for instance (0, 0, 1).")
    return entries[0], entries[1], entries[2]


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
    if np.abs(R @ R.T - np.eye(3)).max() > ORTHONORMAL:
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


def evaluated(law: Callable, given: tuple, what: str, size: int) -> np.ndarray:
    """Value of a law (size,): finite floats, or expressions where it is traced; see :func:`returned`.

    SceneError as :func:`returned`, or if it returns numbers that are not finite.
    """
    return _finite(_checked(_asked(law, given, what), given, what, size), given, what, size)


def put(law: Callable, given: tuple, what: str, size: int, numbers: np.ndarray, first: int):
    """Write the value of an opaque law to an array of floats, from a place on; as :func:`evaluated`."""
    try:
        value = law(*given)
    except Exception as error:  # a law may fail in any way
        raise _raised(error, given, what) from error
    kind = type(value)
    if size == 1 and kind in FLOATS and math.isfinite(value):  # the usual cases, quickly
        numbers[first] = value
    elif kind is tuple and len(value) == size and all(type(x) in FLOATS and math.isfinite(x) for x in value):
        numbers[first : first + size] = value
    else:
        numbers[first : first + size] = _finite(_checked(value, given, what, size), given, what, size)


def _finite(entries: np.ndarray, given: tuple, what: str, size: int) -> np.ndarray:
    if entries.dtype == float and not (math.isfinite(entries[0]) if size == 1 else np.isfinite(entries).all()):
        raise _refused(what, given[0], entries.tolist(), size)
    return entries


def returned(law: Callable, given: tuple, what: str, size: int) -> np.ndarray:
    """Value of a law (size,), called with arguments of which the first is the time: floats, or objects where it is traced.

    SceneError if it raises, or returns something else; the message names the law and the time.
    """
    return _checked(_asked(law, given, what), given, what, size)


def _asked(law: Callable, given: tuple, what: str):
    """What a law returns."""
    try:
        return branches(lambda: law(*given)) if isinstance(given[0], Expression) else law(*given)
    except Exception as error:  # a law may fail in any way
        raise _raised(error, given, what) from error


def _raised(error: Exception, given: tuple, what: str) -> SceneError:
    return SceneError(f"{what}: at {_when(given[0])} its law raised {type(error).__name__}: {error}")


def _checked(value, given: tuple, what: str, size: int) -> np.ndarray:
    """What a law has returned, as an array (size,) of floats, or of objects where it is traced."""
    if size == 1 and type(value) in FLOATS:  # the usual case, quickly
        return np.array([value])
    entries = _entries(value)
    if entries.dtype != float and all(isinstance(entry, Real) for entry in entries):  # fractions, very large integers
        entries = np.array([as_float(entry) for entry in entries])
    if entries.size == size and (entries.dtype == float or all(map(is_scalar, entries))):
        return entries
    raise _refused(what, given[0], value, size)


def _refused(what: str, t, value, size: int) -> SceneError:
    return SceneError(f"{what}: at {_when(t)} its law returned {value!r}; {size} finite numbers are needed.")


def is_scalar(entry) -> bool:
    """Whether an entry is a number, or traced."""
    return isinstance(entry, Expression | Real | np.bool_)


def _entries(value) -> np.ndarray:
    """Flat array of floats, or of objects where something else is among them."""
    try:
        array = np.asarray(None if is_masked(value) else value)
    except ValueError:  # lists of several lengths
        array = np.asarray([None], dtype=object)
    return np.ravel(array.astype(float) if array.dtype.kind in "fiub" else array.astype(object))


def _when(t) -> str:
    return f"t = {t:.6g} s" if isinstance(t, Real) else "any time"


@dataclass(frozen=True, slots=True)
class ConstantLaw:
    """Function of (t, motion) with the same value at all times."""

    value: Any  # the value; expressions where parameters are

    def __call__(self, t, motion):
        """The value."""
        return self.value


def as_function(law_or_constant) -> Callable:
    """Function of (t, motion), whatever form the law was given in."""
    if not callable(law_or_constant):
        return ConstantLaw(law_or_constant)
    return _of_time(law_or_constant) if arguments(law_or_constant) == 1 else law_or_constant


def _of_time(law: Callable) -> Callable:
    """Function of (t, motion) that asks a law of (t), which is its attribute ``law_of_time``."""

    def asked(t, motion):
        return law(t)

    asked.law_of_time = law  # type: ignore[attr-defined]
    return asked


def law_of_time_alone(function: Callable) -> Callable | None:
    """Law of (t) behind a function of :func:`as_function`; None if that takes the motion."""
    return getattr(function, "law_of_time", None)


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
    return branches(lambda: law(x)) if isinstance(x, Expression) else law(x)


def arguments(function) -> int:
    """Number of arguments that a law is called with: those that it requires, and one if all of them have defaults."""
    if isinstance(function, np.ufunc):
        return function.nin
    if type(function) is FunctionType and vars(function).keys().isdisjoint(OF_SIGNATURE):  # the usual case, quickly
        return _arguments_of_code(function)
    try:
        parameters = inspect.signature(function).parameters.values()
    except (TypeError, ValueError):  # a builtin that hides its signature
        return 1
    places = [p for p in parameters if p.kind in (p.POSITIONAL_ONLY, p.POSITIONAL_OR_KEYWORD, p.VAR_POSITIONAL)]
    required = sum(p.default is p.empty and p.kind is not p.VAR_POSITIONAL for p in places)
    return max(required, 1) if places else 0


def _arguments_of_code(function: FunctionType) -> int:
    """The same of a function that is written in Python, and no decorator says otherwise."""
    code = function.__code__
    has_places = code.co_argcount or code.co_flags & inspect.CO_VARARGS
    return max(code.co_argcount - len(function.__defaults__ or ()), 1) if has_places else 0


def kind(element) -> str:
    """Kind of an element, as the methods of a scene and the sections of its file are called: ``joint_spring``."""
    return _kind_of_class(type(element).__name__)


@cache
def _kind_of_class(name: str) -> str:
    return re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name).lower()


def text(value, what: str) -> str:
    """Non-empty name, of characters that files can hold."""
    if not isinstance(value, str) or not value.strip():
        raise SceneError(f"{what}: expected a non-empty name, got {value!r}.")
    if "\0" in value or any("\ud800" <= letter <= "\udfff" for letter in value):
        raise SceneError(f"{what}: {value!r} has a character that no file can hold: NUL, or half of a pair of UTF-16.")
    return value
