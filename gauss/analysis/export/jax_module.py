"""JAX functions of a system: a Python module of ``jax.numpy`` alone, for ``jit``, ``vmap`` and ``grad``.

One statement for each operation of the graph, on numbers: XLA compiles them to few kernels, ``vmap`` makes each a vector.
"""

from collections.abc import Callable, Iterator, Sequence
from math import isfinite, isnan, prod

from gauss.analysis.export.exported_function import ExportedFunction, exported_functions
from gauss.codegen import LOOKUPS, Column, Expression, Function
from gauss.errors import extra
from gauss.scene import Scene
from gauss.system import System
from gauss.versions import VERSION

OPERATIONS = {
    "add": "{} + {}",
    "sub": "{} - {}",
    "mul": "{} * {}",
    "div": "{} / {}",
    "neg": "-{}",
    "less": "{} < {}",
    "less_equal": "{} <= {}",
    "atan2": "jnp.arctan2({}, {})",
    "min": "jnp.minimum({}, {})",
    "max": "jnp.maximum({}, {})",
    "row": "jnp.searchsorted({1}, {0}) + jnp.isnan({0})",  # NaN has a row behind the others
    "entry": "{1}.at[{0}].get(mode='fill', fill_value=jnp.nan)",
    "select": "jnp.where({} != 0, {}, {})",
} | {op: f"jnp.{op}({{}})" for op in ("sqrt", "sin", "cos", "exp", "log", "floor")}


def to_jax(system: System | Scene, name: str = "forward_dynamics") -> Callable:
    """Function of a system as a function of JAX: ``jit``, ``vmap``, ``grad`` and ``jacfwd`` apply to it.

    Parameters
    ----------
    system : System or Scene
        The system.
    name : str
        Function, see :func:`gauss.export.exported_functions`.

    Returns
    -------
    callable
        f(q, v, …, t=0.0) of arrays (n,) of JAX; several results are a tuple. Results are as precise as the arrays: for
        doubles set ``jax.config.update("jax_enable_x64", True)``.

    Raises
    ------
    MissingPackageError
        If JAX is not installed.
    ArgumentError
        If there is no such function.
    SimulationError
        If the scene has elements that no smooth function describes, by their names.

    Examples
    --------
    >>> import gauss
    >>> from gauss.export import to_jax
    >>> inertia = to_jax(gauss.load("double_pendulum"), "mass_matrix")
    >>> inertia([0.1, 0.2]).shape
    (2, 2)
    """
    with extra("jax"):
        import jax  # noqa: F401  (the module that is written needs it)
    functions = exported_functions(system, (name,))
    names: dict = {}
    exec(compile("\n".join(_module(functions)), f"<{name}>", "exec"), names)  # noqa: S102  (of our own text)
    return names[functions[0].identifier]


def jax_source(system: System | Scene, names: Sequence[str] | str | None = None) -> str:
    """Text of a Python module with functions of a system, which needs JAX alone; see :func:`to_jax`.

    Parameters
    ----------
    system : System or Scene
        The system.
    names : sequence of str, optional
        Functions, see :func:`gauss.export.exported_functions`.

    Raises
    ------
    ArgumentError
        If there is no such function.
    SimulationError
        If the scene has elements that no smooth function describes, by their names.

    Examples
    --------
    >>> import gauss
    >>> from gauss.export import jax_source
    >>> source = jax_source(gauss.load("pendulum"), "mass_matrix")
    >>> 'def mass_matrix' in source
    True
    """
    return "\n".join(_module(exported_functions(system, names)))


def _module(functions: list[ExportedFunction]) -> Iterator[str]:
    yield f'"""Functions of a mechanism, written by gauss {VERSION}."""\n'
    yield "import jax.numpy as jnp\n"
    for function in functions:
        yield from _definition(function)


def _definition(exported: ExportedFunction) -> Iterator[str]:
    given = [name if shape else f"{name}=0.0" for name, shape in exported.inputs.items()]
    yield f"\ndef {exported.identifier}({', '.join(given)}):"
    yield f"    {_summary(exported)!r}"  # names of frames may have quotes and backslashes
    parts = [f"jnp.reshape(jnp.asarray({name}), ({prod(shape)},))" for name, shape in exported.inputs.items()]
    yield f"    x = jnp.concatenate([{', '.join(parts)}])"
    yield from (f"    {line}" for line in _statements(exported.function))
    place, results = 0, []
    for shape in exported.outputs.values():
        results.append(f"y[{place}:{place + prod(shape)}].reshape({shape})")
        place += prod(shape)
    yield f"    return {', '.join(results)}"


def _summary(exported: ExportedFunction) -> str:
    given = ", ".join(f"{name} {shape}" for name, shape in exported.inputs.items())
    found = ", ".join(f"{name} {shape}" for name, shape in exported.outputs.items())
    return f"{exported.name}: {given} → {found}."


def _statements(function: Function) -> Iterator[str]:
    """One statement for each operation; x holds the arguments, y the outputs."""
    values = {symbol.index: f"x[{k}]" for k, symbol in enumerate(function.inputs)}
    columns: dict[Column, str] = {}
    for node in function.nodes:
        if node.is_constant:
            values[node.index] = _number(node.value)
        elif node.op != "symbol":
            values[node.index] = f"v{node.index}"
            operands = [values[x.index] for x in node.operands]
            if node.op in LOOKUPS and node.value not in columns:
                columns[node.value] = f"c{len(columns)}"
                yield f"{columns[node.value]} = jnp.array([{', '.join(map(_number, node.value.numbers))}], dtype=x.dtype)"
            yield f"v{node.index} = {OPERATIONS[node.op].format(*operands, columns.get(node.value))}"
    found = [values[x.index] if isinstance(x, Expression) else _number(float(x)) for x in function.outputs]
    yield f"y = jnp.array([{', '.join(found)}], dtype=x.dtype)"


def _number(value: float) -> str:
    """Literal of a number; negative ones in parentheses."""
    found = f"{abs(float(value))!r}" if isfinite(value) else f"jnp.{'nan' if isnan(value) else 'inf'}"
    return f"(-{found})" if value < 0.0 else found
