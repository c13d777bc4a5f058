"""Functions for laws of forces, drives and constraints: the same names over numbers, arrays and traced expressions.

A law written with these, and with ``+ − * / ** < >``, is traced and compiled with its scene::

    from gauss import math
    scene.drive("A", torque=lambda t: 2.0 * math.sin(3.0 * t))
    scene.drive("B", torque=lambda t, motion: math.where(t < 1.0, 0.0, -4.0 * motion.rate("B")))
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from gauss.arguments import real_array
from gauss.codegen import Column, Expression, graph_of, looked_up
from gauss.errors import SceneError

MOST_WRITTEN = 32  # pieces of a table that are written as operations; of more of them, coefficients are data
CONTINUOUS = 1e-9  # jump of a piecewise polynomial that is rounding, relative to its terms

pi = np.pi
sin: Callable[..., Any]
cos: Callable[..., Any]
tan: Callable[..., Any]
exp: Callable[..., Any]
log: Callable[..., Any]
sqrt: Callable[..., Any]
floor: Callable[..., Any]
sin, cos, tan, exp, log, sqrt, floor = np.sin, np.cos, np.tan, np.exp, np.log, np.sqrt, np.floor

__all__ = [
    "abs",
    "arctan2",
    "atan2",
    "clip",
    "cos",
    "exp",
    "floor",
    "interp",
    "log",
    "maximum",
    "minimum",
    "pi",
    "piecewise",
    "sign",
    "sin",
    "sqrt",
    "tan",
    "tanh",
    "where",
]


def arctan2(y, x):
    """Return the angle of the point (x, y) in the plane [rad], −π … π, entry by entry.

    Parameters
    ----------
    y, x : float, ndarray or Expression
        Second and first coordinate.

    Returns
    -------
    float, ndarray or Expression
        Of their common shape.

    Examples
    --------
    >>> from gauss import math
    >>> float(math.arctan2(0.0, 1.0))
    0.0
    """
    return _atan2(y, x) if _traced(y, x) else np.arctan2(y, x)


atan2 = arctan2


def minimum(x, y):
    """Return the smaller of x and y, entry by entry.

    Parameters
    ----------
    x, y : float, ndarray or Expression
        Arguments.

    Returns
    -------
    float, ndarray or Expression
        Of their common shape.

    Examples
    --------
    >>> from gauss import math
    >>> float(math.minimum(2.0, 3.0))
    2.0
    """
    return _minimum(x, y) if _traced(x, y) else np.minimum(x, y)


def maximum(x, y):
    """Return the larger of x and y, entry by entry.

    Parameters
    ----------
    x, y : float, ndarray or Expression
        Arguments.

    Returns
    -------
    float, ndarray or Expression
        Of their common shape.

    Examples
    --------
    >>> from gauss import math
    >>> float(math.maximum(2.0, 3.0))
    3.0
    """
    return _maximum(x, y) if _traced(x, y) else np.maximum(x, y)


def where(condition, x, y):
    """Return x where the condition holds, else y, entry by entry; the condition may be a comparison of expressions.

    Parameters
    ----------
    condition : bool, ndarray or Expression
        A comparison.
    x, y : float, ndarray or Expression
        What is chosen from.

    Returns
    -------
    float, ndarray or Expression
        Of their common shape.

    Examples
    --------
    >>> import numpy as np
    >>> from gauss import math
    >>> t = np.array([0.0, 2.0])
    >>> math.where(t < 1.0, 1.0, -1.0)
    array([ 1., -1.])
    """
    return _where(condition, x, y) if _traced(condition, x, y) else np.where(condition, x, y)[()]


def clip(x, lowest, highest):
    """Return x within the two bounds, entry by entry.

    Parameters
    ----------
    x, lowest, highest : float, ndarray or Expression
        Argument and bounds.

    Returns
    -------
    float, ndarray or Expression
        Of the shape of x.

    Examples
    --------
    >>> from gauss import math
    >>> float(math.clip(5.0, -2.0, 2.0))
    2.0
    """
    return minimum(maximum(x, lowest), highest)


def abs(x):
    """Return the absolute value, entry by entry.

    Parameters
    ----------
    x : float, ndarray or Expression
        Argument.

    Returns
    -------
    float, ndarray or Expression
        Of the shape of x.

    Examples
    --------
    >>> from gauss import math
    >>> float(math.abs(-2.0))
    2.0
    """
    return np.abs(x)


def sign(x):
    """Return −1, 0 or 1, entry by entry.

    Parameters
    ----------
    x : float, ndarray or Expression
        Argument.

    Returns
    -------
    float, ndarray or Expression
        Of the shape of x.

    Examples
    --------
    >>> from gauss import math
    >>> float(math.sign(-0.3))
    -1.0
    """
    return where(x < 0.0, -1.0, where(x > 0.0, 1.0, 0.0))


def tanh(x):
    """Hyperbolic tangent, entry by entry; a smooth step from −1 to 1.

    Parameters
    ----------
    x : float, ndarray or Expression
        Argument.

    Returns
    -------
    float, ndarray or Expression
        Of the shape of x.

    Examples
    --------
    >>> from gauss import math
    >>> round(float(math.tanh(0.5)), 6)
    0.462117
    """
    shrinking = exp(-2.0 * abs(x))
    return sign(x) * (1.0 - shrinking) / (1.0 + shrinking)


def interp(x, xp, fp):
    """Value of a table, linear between its rows and constant beyond its ends, as of :func:`numpy.interp`.

    Parameters
    ----------
    x : float, ndarray or Expression
        Where.
    xp, fp : array_like, shape (n,)
        Arguments, increasing, and values of the table.

    Returns
    -------
    float, ndarray or Expression
        Of the shape of x.

    Raises
    ------
    SceneError
        If the arguments do not increase, or the two differ in length.

    Examples
    --------
    >>> from gauss import math
    >>> float(math.interp(0.5, [0.0, 1.0, 2.0], [0.0, 10.0, 0.0]))
    5.0
    """
    xp, fp = (real_array(entries, "interp", "tables of numbers") for entries in (xp, fp))
    if xp.ndim != 1 or xp.shape != fp.shape or not xp.size or not (np.diff(xp) > 0.0).all():
        raise SceneError(f"interp: expected increasing arguments and as many values, got shapes {xp.shape} and {fp.shape}.")
    if not _traced(x):
        return np.interp(x, xp, fp)
    if xp.size > MOST_WRITTEN:
        slopes = np.diff(fp) / np.diff(xp)
        return _looked_up(Column(xp[1:-1]), x, clip(x, xp[0], xp[-1]), xp[:-1], (slopes, fp[:-1]))
    value = fp[0]
    for start, length, rise in zip(xp, np.diff(xp), np.diff(fp), strict=False):
        value = value + clip((x - start) / length, 0.0, 1.0) * rise
    return value


def piecewise(polynomial, x):
    """Value of a piecewise polynomial of scipy, such as a CubicSpline, entry by entry.

    Parameters
    ----------
    polynomial : scipy.interpolate.PPoly
        Of scalar or vector values. One that extrapolates periodically is continued so; else its first and last piece go on.
    x : float, ndarray or Expression
        Where.

    Returns
    -------
    float, ndarray or Expression
        Value at x.
    """
    if polynomial.c.ndim > 2:
        return np.array([_piecewise(polynomial, polynomial.c[:, :, k], x) for k in range(polynomial.c.shape[2])])
    return _piecewise(polynomial, polynomial.c, x)


def _piecewise(polynomial, pieces, x):
    breaks = polynomial.x
    if polynomial.extrapolate == "periodic":
        x = breaks[0] + (x - breaks[0]) % (breaks[-1] - breaks[0])
    if pieces.shape[1] > MOST_WRITTEN and _traced(x):
        return _looked_up(Column(breaks[1:-1], _jumps(breaks, pieces)), x, x, breaks[:-1], pieces)
    start, coefficients = float(breaks[0]), [float(c) for c in pieces[:, 0]]
    for k in range(1, pieces.shape[1]):
        inside = x > float(breaks[k])
        start = where(inside, float(breaks[k]), start)
        coefficients = [where(inside, float(new), old) for new, old in zip(pieces[:, k], coefficients, strict=True)]
    return _horner(coefficients, x - start)


def _looked_up(breaks: Column, x, within, starts, pieces):
    """Value of a piecewise polynomial whose pieces are data: that of the row of x, at a number within the table."""
    row = looked_up("row", breaks, x)
    return _horner([looked_up("entry", Column(c), row) for c in pieces], within - looked_up("entry", Column(starts), row))


def _horner(coefficients, s):
    """Value of a polynomial of these coefficients, that of the highest power first."""
    value = 0.0
    for coefficient in coefficients:
        value = value * s + coefficient
    return value


def _jumps(breaks: np.ndarray, pieces: np.ndarray) -> bool:
    """Whether a piecewise polynomial jumps at a break."""
    lengths = np.diff(breaks)[:-1]
    ends, sizes = (_horner(list(part[:, :-1]), lengths) for part in (pieces, np.abs(pieces)))
    return bool((np.abs(ends - pieces[-1, 1:]) > CONTINUOUS * sizes).any())


def _traced(*values) -> bool:
    return any(isinstance(value, Expression) or getattr(value, "dtype", None) is np.dtype(object) for value in values)


def _binary(op: str, plain):
    def apply(x, y):
        if not isinstance(x, Expression) and not isinstance(y, Expression):
            return plain(x, y)
        graph = graph_of((x, y))
        return graph.binary(op, graph.lift(x), graph.lift(y))

    return np.frompyfunc(apply, 2, 1)


def _select(condition, x, y):
    if not any(isinstance(value, Expression) for value in (condition, x, y)):
        return x if condition else y
    return graph_of((condition, x, y)).select(condition, x, y)


_minimum, _maximum, _atan2 = _binary("min", min), _binary("max", max), _binary("atan2", np.arctan2)
_where = np.frompyfunc(_select, 3, 1)
