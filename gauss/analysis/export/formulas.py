"""Formulas of a small scene in its own symbols: expressions of SymPy, and a document of LaTeX.

    M(q) q̈ + h(q, q̇) = τ + Jᵀ λ,    c(q) = 0

M and h are those of the spanning tree, h with gravity and the loads of the scene; c and J are the loop constraints, without
which λ is absent. They are traced from the mechanics, M and h with symbols for numbers
(:mod:`gauss.analysis.export.symbolic_system`).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from gauss.analysis.export.exported_function import ExportedFunction, evaluated, exported_functions
from gauss.analysis.export.symbolic_system import has_symbols, in_symbols
from gauss.arguments import name_list
from gauss.codegen import Column
from gauss.dynamics.scene_compilation import system_of
from gauss.errors import SimulationError, extra, require
from gauss.scene import Scene
from gauss.system import System

MOST_OPERATIONS = 3_000  # of a formula: simplification of more takes minutes, and nobody reads it
MOST_SIMPLIFIED = 150  # operations of an expression in which sums of angles are sought
FRACTION_ROUNDOFF = 4e-16  # of a coefficient, relative to it or to 1: two roundings
LARGEST_DENOMINATOR = 1_000  # of numbers that are shown as fractions, if they are these to round-off
PREFIXES = {"q": "q", "v": "dq", "acceleration": "ddq", "load": "tau", "u": "u"}
ACCENTS = {"v": r"\dot q", "acceleration": r"\ddot q", "load": r"\tau"}


@dataclass(frozen=True)
class Formulas:
    """Function of a state in symbols.

    Parameters
    ----------
    arguments : dict
        Symbols of each argument, a list; one symbol for the time.
    results : dict
        Each result, a ``sympy.Matrix``, or an expression.
    values : dict
        Value of each symbol that stands for a number of the scene.
    latex_names : dict
        LaTeX of symbols whose names alone do not give it.

    Examples
    --------
    >>> import gauss
    >>> from gauss.export import to_sympy
    >>> found = to_sympy(gauss.load("pendulum"), "mass_matrix")
    >>> found.results
    {'result': Matrix([[J_rod_z + c_rod_x**2*m_rod]])}
    """

    arguments: dict[str, Any]
    results: dict[str, Any]
    values: dict[Any, float]
    latex_names: dict[Any, str]


def to_sympy(system: System | Scene, name: str = "inverse_dynamics", simplify: bool = True) -> Formulas:
    """Function of a small scene as expressions of SymPy, in symbols of its own.

    Parameters
    ----------
    system : System or Scene
        The system.
    name : str
        Function, see :func:`gauss.export.exported_functions`.
    simplify : bool
        Whether expressions are simplified, which takes seconds.

    Returns
    -------
    Formulas
        Arguments, results, and the values of the symbols for masses "m_rod", moments of inertia "J_rod_x", centres of mass
        "c_rod_x", lengths "l_rod_x", gravity "g" and constants of loads, in terms of the spanning tree. Functions of frames
        and loops, and forces of loads on bodies, keep numbers.

    Raises
    ------
    MissingPackageError
        If SymPy is not installed.
    ArgumentError
        If there is no such function.
    SimulationError
        If the scene has elements that no smooth function describes, by their names; or if the formulas are too long.

    Examples
    --------
    >>> import gauss
    >>> from gauss.export import to_sympy
    >>> list(to_sympy(gauss.load("pendulum"), "mass_matrix").results)
    ['result']
    """
    with extra("symbolic"):
        import sympy
    require(name, (str,), "to_sympy: name")
    system = system_of(system, "export")
    if has_symbols(system, name):
        exported, values = in_symbols(system, name)
    else:
        (exported,), values = exported_functions(system, (name,)), {}
    if len(exported.function.nodes) > MOST_OPERATIONS:
        raise SimulationError(
            f"scene {system.scene.name!r}: the formulas of {name} have {len(exported.function.nodes)} operations, more than "
            f"{MOST_OPERATIONS}; export it as code."
        )
    return _formulas(sympy, system, exported, values, simplify)


def _formulas(sympy, system: System, exported: ExportedFunction, values: dict[str, float], simplify: bool) -> Formulas:
    arguments, latex_names = _arguments(sympy, system, exported)
    flat = [symbol for own in arguments.values() for symbol in (own if isinstance(own, list) else [own])]
    parameters = [sympy.Symbol(symbol.value, real=True) for symbol in exported.function.inputs[len(flat) :]]
    outputs = _evaluated(sympy, exported, [*flat, *parameters])
    shorter: Callable = (lambda x: _simplified(sympy, x)) if simplify else (lambda x: x)
    parts = exported.split([shorter(x) for x in outputs], exported.outputs)
    results = {name: part.item() if not part.shape else sympy.Matrix(part) for name, part in parts.items()}
    named = {symbol: values[symbol.name] for symbol in parameters}
    return Formulas(arguments, results, named, latex_names)


def _simplified(sympy, x):
    """Expanded expression; with theorems of sums of angles where it is short."""
    found = _with_fractions(sympy, sympy.expand(x))
    if sympy.count_ops(found) > MOST_SIMPLIFIED:
        return found
    return _with_fractions(sympy, sympy.trigsimp(found))  # which turns fractions beside floats into floats


def _with_fractions(sympy, x):
    """Expression with fractions in the place of the floats that are these."""
    return x.xreplace({number: _number(sympy, float(number)) for number in x.atoms(sympy.Float)})


def _arguments(sympy, system: System, exported: ExportedFunction) -> tuple[dict, dict]:
    """Symbols of the arguments, and LaTeX of those that have accents."""
    arguments: dict[str, Any] = {}
    latex: dict[Any, str] = {}
    for name, shape in exported.inputs.items():
        if not shape:
            arguments[name] = sympy.Symbol(name, real=True)
            continue
        labels = _labels(system, name, *shape)
        arguments[name] = [sympy.Symbol(f"{PREFIXES[name]}_{label}", real=True) for label in labels]
        if name in ACCENTS:
            texts = (rf"{ACCENTS[name]}_{{\mathrm{{{label.replace('_', ' ')}}}}}" for label in labels)
            latex |= dict(zip(arguments[name], texts, strict=True))
    return arguments, latex


def _labels(system: System, name: str, size: int) -> list[str]:
    """Names of the entries of an argument."""
    if name == "u":
        return list(system.scene.inputs)
    if name != "q" or system.is_flat:
        return [label.replace(".", " ") for label in system.coordinates]
    return [
        f"{joint.name}{k}" if joint.pair.n_q > 1 else joint.name for joint in system.joints for k in range(joint.pair.n_q)
    ]


def _evaluated(sympy, exported: ExportedFunction, given: list) -> list:
    """Outputs of the graph for symbols of SymPy."""
    operations: dict[str, Callable] = {
        "add": lambda x, y: x + y,
        "sub": lambda x, y: x - y,
        "mul": lambda x, y: x * y,
        "div": lambda x, y: x / y,
        "neg": lambda x: -x,
        "less": lambda x, y: sympy.Piecewise((1, x < y), (0, True)),
        "less_equal": lambda x, y: sympy.Piecewise((1, x <= y), (0, True)),
        "select": lambda condition, x, y: sympy.Piecewise((x, sympy.Ne(condition, 0)), (y, True)),
        "min": sympy.Min,
        "max": sympy.Max,
    } | {op: getattr(sympy, op) for op in ("sqrt", "sin", "cos", "exp", "log", "floor", "atan2")}
    number = partial(_number, sympy)
    return evaluated(exported.function, given, operations, number, partial(_entry, sympy))


def _entry(sympy, column: Column, x, breaks: Column):
    """Number of a column in the row of x."""
    numbers = [_number(sympy, float(number)) for number in column.numbers]
    below = [x <= _number(sympy, float(one)) for one in breaks.numbers]
    return sympy.Piecewise(*zip(numbers, [*below, True], strict=True))


def _number(sympy, value: float):
    """Fraction if the number is one of small denominator, else a float."""
    if not np.isfinite(value):
        return sympy.nan if np.isnan(value) else sympy.oo if value > 0.0 else -sympy.oo
    fraction = sympy.Rational(value).limit_denominator(LARGEST_DENOMINATOR)
    return fraction if abs(float(fraction) - value) <= FRACTION_ROUNDOFF * max(abs(value), 1.0) else sympy.Float(value)


def latex_document(system: System | Scene, names: Sequence[str] | str | None = None) -> str:
    """Document of LaTeX with the equations of motion of a small scene, and the values of its symbols.

    Parameters
    ----------
    system : System or Scene
        The system.
    names : sequence of str, optional
        Functions to be shown instead, see :func:`gauss.export.exported_functions`.

    Raises
    ------
    MissingPackageError
        If SymPy is not installed.
    ArgumentError
        If there is no such function.
    SimulationError
        As of :func:`to_sympy`.

    Examples
    --------
    >>> import gauss
    >>> from gauss.export import latex_document
    >>> text = latex_document(gauss.load("pendulum"), "mass_matrix")
    >>> "documentclass" in text.splitlines()[0]
    True
    """
    with extra("symbolic"):
        import sympy
    system = system_of(system, "export")
    shown: list[str] = []
    values: dict[Any, float] = {}
    for name in _wanted(system, names):
        found = to_sympy(system, name)
        still = [] if names is not None else [(symbol, 0) for symbol in found.arguments.get("acceleration", ())]
        for result, formula in found.results.items():
            formula = formula.subs(still)
            used = formula.free_symbols
            values |= {symbol: value for symbol, value in found.values.items() if symbol in used}
            left = SIGNS.get((name, result), rf"\mathrm{{{_plain(f'{name} {result}')}}}")
            shown.append(rf"\[ {left} = {sympy.latex(formula, symbol_names=found.latex_names)} \]")
    table = ", ".join(rf"\({sympy.latex(symbol)} = {value:.12g}\)" for symbol, value in values.items())
    lines = [*([] if names is not None else [_balance(system)]), *shown, *([f"Values: {table}."] if table else [])]
    return "\n".join([*START, rf"\section*{{{_plain(system.scene.name)}}}", *lines, r"\end{document}", ""])


def _balance(system: System) -> str:
    """Equation of motion."""
    return (
        r"\[ M \ddot q + h = \tau + J^{\mathsf T} \lambda, \quad c = 0 \]"
        if system.has_closures
        else r"\[ M \ddot q + h = \tau \]"
    )


START = r"\documentclass{article}", r"\usepackage{amsmath}", r"\begin{document}"
SIGNS = {
    ("mass_matrix", "result"): "M",
    ("inverse_dynamics", "load"): "h",
    ("loop_constraints", "residual"): "c",
    ("loop_constraints", "jacobian"): "J",
    ("loop_constraints", "bias"): r"\gamma",
}


def _wanted(system: System, names) -> tuple[str, ...]:
    """Names of the functions; those of the equations of motion when none are given."""
    if names:
        return name_list(names, "export", "names of functions")
    return ("mass_matrix", "inverse_dynamics", *(("loop_constraints",) if system.has_closures else ()))


def _plain(text: str) -> str:
    """Text without characters that LaTeX reads as commands."""
    return "".join(letter if letter.isalnum() or letter in " -+.,()" else " " for letter in text)
