"""Functions of a system as traced graphs without calls, with names and shapes of their arguments and results.

The mechanics is traced as for machine code of this process (:mod:`gauss.dynamics.state_functions`); the writers of C,
CasADi, JAX and SymPy read the graph, and know no mechanics.
"""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import prod
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from gauss.arguments import name_list
from gauss.codegen import Expression, Function, Graph, write
from gauss.codegen.python_wrapper import Shape
from gauss.dynamics.acceleration_derivatives import LoadedMechanism, acceleration_derivatives
from gauss.dynamics.inputs import input_loads
from gauss.dynamics.laws.traced_laws import Laws
from gauss.dynamics.plan import EXPORTS
from gauss.dynamics.rules import Question
from gauss.dynamics.scene_compilation import system_of
from gauss.dynamics.state_functions import traced_function
from gauss.dynamics.term_table import TERMS
from gauss.errors import ArgumentError, SimulationError, did_you_mean, writing
from gauss.scene import Scene
from gauss.system import System, refuse_changed

DEFAULTS = "forward_dynamics", "inverse_dynamics", "mass_matrix", "bias_forces", "acceleration_derivatives"
LOADED = {  # functions under loads and inputs: names and shapes of their results, digits or n_v
    "forward_dynamics": {"acceleration": "v"},
    "acceleration_derivatives": {"by_q": "vv", "by_v": "vv", "by_load": "vv"},
}
RESULTS = {  # names of the results of the other functions, "result" of one alone
    "forward_kinematics": ("rotation", "position"),
    "inverse_dynamics": ("load",),
    "inverse_dynamics_derivatives": ("by_q", "by_v"),
    "loop_constraints": ("residual", "jacobian", "bias"),
}


@dataclass(frozen=True, eq=False)
class ExportedFunction:
    """Function of a state of a system, as a graph without calls.

    Parameters
    ----------
    name : str
        Name of the function, as "jacobian:hand".
    function : Function
        Graph; its inputs and outputs are those of ``inputs`` and ``outputs``, flattened in their order.
    inputs, outputs : dict of str to tuple of int
        Shapes of the arguments and of the results; () is a number.

    Examples
    --------
    >>> import gauss
    >>> from gauss.export import exported_functions
    >>> found = exported_functions(gauss.load("double_pendulum"), "mass_matrix")[0]
    >>> found.name, found.inputs, found.outputs
    ('mass_matrix', {'q': (2,), 't': ()}, {'result': (2, 2)})
    """

    name: str
    function: Function
    inputs: dict[str, Shape]
    outputs: dict[str, Shape]

    @property
    def identifier(self) -> str:
        """Name as an identifier of C and Python."""
        return identifier(self.name)

    def split(self, values: Sequence, shapes: dict[str, Shape]) -> dict[str, np.ndarray]:
        """Entries of arguments or results by name, object arrays of their shapes."""
        ends = np.cumsum([prod(shape) for shape in shapes.values()])[:-1]
        parts = np.split(np.array([*values, None], dtype=object)[:-1], ends)
        return {name: part.reshape(shape) for part, (name, shape) in zip(parts, shapes.items(), strict=True)}


def exported_functions(system: System | Scene, names: Sequence[str] | str | None = None) -> list[ExportedFunction]:
    """Functions of a system to be written in another language.

    Parameters
    ----------
    system : System or Scene
        The system.
    names : sequence of str, optional
        Names of :meth:`gauss.System.function`, "forward_dynamics" included: ``DEFAULTS`` when not given, with
        "loop_constraints" where joints close loops.

    Returns
    -------
    list of ExportedFunction
        Each takes q, v, acceleration or load as it needs them, u if the scene has inputs on which it depends, and t. Loads
        are those of the scene as they are now. They check no argument: quaternions are to be of unit length, and near
        singular configurations results are as inaccurate as the configuration makes them. Accelerations and their
        derivatives are not numbers (NaN) where a loop that cannot move has another pose than in the scene.

    Raises
    ------
    ArgumentError
        If there is no such function, or two of them have the same name as code.
    SimulationError
        If the scene has elements that no smooth function describes, by their names.

    Examples
    --------
    >>> import gauss
    >>> from gauss.export import exported_functions
    >>> [each.name for each in exported_functions(gauss.load("double_pendulum"), ["mass_matrix", "bias_forces"])]
    ['mass_matrix', 'bias_forces']
    """
    system = system_of(system, "export")
    if names is None:
        names = (*DEFAULTS, "loop_constraints") if system.has_closures else DEFAULTS
    names = name_list(names, "export", "names of functions")
    if not system.n_v:
        raise SimulationError(f"scene {system.scene.name!r} cannot be exported: nothing in it can move.")
    refuse_changed(system)
    found = [_loaded(system, name) if name in LOADED else _of_state(system, name) for name in names]
    known = [function.identifier for function in found]
    if len(set(known)) < len(known):
        raise ArgumentError(f"export: functions have the same name as code: {', '.join(known)}.")
    return found


def folder_of(folder) -> Path:
    """Folder of a path, made if it is not there.

    ArgumentError if it is no path.
    FileError if it cannot be made.
    """
    if not isinstance(folder, str | PathLike):
        raise ArgumentError(f"export: folder: expected a path, got {folder!r:.80}.")
    found = Path(folder)
    with writing(found):
        found.mkdir(parents=True, exist_ok=True)
    return found


def identifier(name: str) -> str:
    """Name with underscores for all that is neither letter nor digit; ArgumentError if it is no text."""
    if not isinstance(name, str):
        raise ArgumentError(f"export: name: expected a text, got {name!r:.80}.")
    found = re.sub(r"\W", "_", name, flags=re.ASCII)
    return f"_{found}" if not found or found[0].isdigit() else found


def _of_state(system: System, name: str) -> ExportedFunction:
    """Function of the table of terms."""
    own = name.partition(":")[0] if isinstance(name, str) else ""
    if own not in TERMS:
        raise ArgumentError(f"export: no function {name!r} of a state. {did_you_mean(str(name), (*TERMS, *LOADED))}")
    function, interface = traced_function(system, (name,))
    kept = function.outputs[: -len(interface.limits)]
    inputs: dict[str, Shape] = {one: (size,) for one, size in interface.vectors.items()}
    inputs[interface.number] = ()
    results = RESULTS.get(own, ("result",))
    outputs = dict(zip(results, interface.shapes, strict=True))
    return ExportedFunction(name, without_calls(Function(name, function.inputs, kept)), inputs, outputs)


def _loaded(system: System, name: str) -> ExportedFunction:
    """Function of the system under its loads and inputs."""
    laws, given = Laws(system), tuple(system.scene.inputs)
    EXPORTS.plan(Question(system, laws))
    loads = [*laws.traced, *input_loads(system)]

    def values(q, v, load, t):
        for one in given:  # in the order of the scene, whether the result depends on them or not
            t[0].graph.parameter(one)
        if name == "acceleration_derivatives":
            return acceleration_derivatives(system, loads, t[0], q, v, load)
        return LoadedMechanism(system, loads, t[0], q, v, load).accelerations()

    found = write(values, system.n_q, system.n_v, system.n_v, 1, name=name)
    state, (t, *u) = np.split(np.array(found.inputs, dtype=object), [-1 - len(given)])
    inputs: dict[str, Shape] = {"q": (system.n_q,), "v": (system.n_v,), "load": (system.n_v,)}
    inputs |= ({"u": (len(given),)} if given else {}) | {"t": ()}
    shapes = {result: (system.n_v,) * len(letters) for result, letters in LOADED[name].items()}
    return ExportedFunction(name, without_calls(Function(name, [*state, *u, t], found.outputs)), inputs, shapes)


def evaluated(
    function: Function, given: Sequence, operations: dict[str, Callable], number: Callable, entry: Callable
) -> list:
    """Outputs of a graph without calls in the arithmetic of another library.

    Parameters
    ----------
    given : sequence
        Symbols of that library for the inputs.
    operations : dict of str to callable
        Its operations, by those of the graph.
    number : callable
        Its constant of a number.
    entry : callable
        (column, x, breaks) → number of a column in the row of x among breaks.
    """
    values: dict[int, Any] = {symbol.index: value for symbol, value in zip(function.inputs, given, strict=True)}
    for node in function.nodes:
        if node.is_constant:
            values[node.index] = number(float(node.value))
        elif node.op == "row":
            values[node.index] = values[node.operands[0].index], node.value
        elif node.op == "entry":
            values[node.index] = entry(node.value, *values[node.operands[0].index])
        elif node.op != "symbol":
            values[node.index] = operations[node.op](*(values[x.index] for x in node.operands))
    return [values[x.index] if isinstance(x, Expression) else number(float(x)) for x in function.outputs]


def without_calls(function: Function) -> Function:
    """The same function with the operations of called functions in their places.

    SimulationError if it calls a function that is machine code and has no graph.
    """
    if not any(node.op == "call" for node in function.nodes):
        return function
    graph = Graph()
    inputs = [graph.symbol(symbol.value) for symbol in function.inputs]
    return Function(function.name, inputs, _copied(graph, function, inputs))


def _copied(graph: Graph, function: Function, given: list) -> list:
    """Outputs of a function in another graph."""
    if not isinstance(function, Function):
        raise SimulationError(f"{function.name!r} cannot be exported: it is machine code without a graph.")
    results: dict[int, list] = {}  # of calls
    values = {symbol.index: value for symbol, value in zip(function.inputs, given, strict=True)}
    for node in function.nodes:
        if node.op == "call":
            results[node.index] = _copied(graph, node.value, _passed(node.operands, values, results))
        elif node.op == "item":
            values[node.index] = results[node.operands[0].index][node.value]
        elif node.op != "symbol":
            values[node.index] = graph.copy(node, [values[x.index] for x in node.operands])
    return [values[x.index] if isinstance(x, Expression) else graph.constant(x) for x in function.outputs]


def _passed(operands, values: dict, results: dict) -> list:
    """Arguments of a call; the results of another call may stand for the first of them."""
    parts = [results[x.index] if x.op == "call" else [values[x.index]] for x in operands]
    return [entry for part in parts for entry in part]
