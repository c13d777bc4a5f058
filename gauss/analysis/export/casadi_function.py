"""CasADi functions of a system: the traced graph as scalar expressions ``SX``, which CasADi differentiates and compiles.

Andersson, Gillis, Horn, Rawlings and Diehl, CasADi: a software framework for nonlinear optimization and optimal control,
Mathematical Programming Computation 11 (2019). Such a function takes columns, and its matrices are matrices of CasADi.
"""

from collections.abc import Callable
from functools import partial

import numpy as np

from gauss.analysis.export.exported_function import ExportedFunction, evaluated, exported_functions
from gauss.codegen import Column
from gauss.errors import extra
from gauss.scene import Scene
from gauss.system import System


def to_casadi(system: System | Scene, name: str = "forward_dynamics"):
    """Function of a system as a ``casadi.Function``, with CasADi's derivatives.

    Parameters
    ----------
    system : System or Scene
        The system.
    name : str
        Function, see :func:`gauss.export.exported_functions`.

    Returns
    -------
    casadi.Function
        Its inputs and outputs have names: q, v, acceleration or load, u, t; acceleration, result and so on.
        ``function.save(path)`` writes it for CasADi in Python, C++ and MATLAB.

    Raises
    ------
    MissingPackageError
        If CasADi is not installed.
    ArgumentError
        If there is no such function.
    SimulationError
        If the scene has elements that no smooth function describes, by their names.

    Examples
    --------
    >>> import gauss
    >>> from gauss import export
    >>> export.to_casadi(gauss.load("pendulum"))
    Function(forward_dynamics:(q,v,load,t)->(acceleration) SXFunction)
    """
    (exported,) = exported_functions(system, (name,))
    return casadi_function(exported)


def casadi_function(exported: ExportedFunction):
    """Exported function as a ``casadi.Function``.

    Raises
    ------
    MissingPackageError
        If CasADi is not installed.
    """
    with extra("export"):
        import casadi
    arguments = {one: casadi.SX.sym(one, *shape) for one, shape in exported.inputs.items()}
    flat = [entry for own in arguments.values() for entry in casadi.vertsplit(own)]
    values = evaluated(exported.function, flat, _operations(casadi), casadi.SX, partial(_entry, casadi))
    results = [_shaped(casadi, part) for part in exported.split(values, exported.outputs).values()]
    return casadi.Function(exported.identifier, list(arguments.values()), results, list(arguments), list(exported.outputs))


def _operations(casadi) -> dict[str, Callable]:
    """Operations of the graph on expressions of CasADi."""
    return {
        "add": lambda x, y: x + y,
        "sub": lambda x, y: x - y,
        "mul": lambda x, y: x * y,
        "div": lambda x, y: x / y,
        "neg": lambda x: -x,
        "less": lambda x, y: x < y,
        "less_equal": lambda x, y: x <= y,
        "atan2": casadi.atan2,
        "min": lambda x, y: casadi.if_else(y < x, y, _unless_missing(casadi, x <= y, x)),
        "max": lambda x, y: casadi.if_else(x < y, y, _unless_missing(casadi, y <= x, x)),
        "select": casadi.if_else,
    } | {op: getattr(casadi, op) for op in ("sqrt", "sin", "cos", "exp", "log", "floor")}


def _entry(casadi, column: Column, x, breaks: Column):
    """Number of a column in the row of x, by a tree of selections: graphs of CasADi hold no arrays."""

    def among(first: int, last: int):
        """Number of the row, which is one from ``first`` to ``last``."""
        if first == last:
            return casadi.SX(float(column.numbers[first]))
        middle = (first + last) // 2
        return casadi.if_else(x <= float(breaks.numbers[middle]), among(first, middle), among(middle + 1, last))

    return _unless_missing(casadi, x <= np.inf, among(0, breaks.numbers.size))


def _unless_missing(casadi, is_number, value):
    """A value, or NaN where a comparison is false because a number is NaN."""
    return casadi.if_else(is_number, value, np.nan)


def _shaped(casadi, part: np.ndarray):
    """Column or matrix of entries."""
    rows = part.reshape(-1, 1) if part.ndim < 2 else part
    if not rows.size:
        return casadi.SX(*rows.shape)
    return casadi.vertcat(*(casadi.horzcat(*row) for row in rows))
