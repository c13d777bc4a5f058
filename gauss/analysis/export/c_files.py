"""C99 files of functions of a system: a header and a source without dependencies, for one state and for batches."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import prod
from pathlib import Path

from gauss.analysis.export.c_code import PRELUDE, CBody
from gauss.analysis.export.exported_function import ExportedFunction, exported_functions, identifier
from gauss.errors import require, writing
from gauss.scene import Scene
from gauss.system import System
from gauss.versions import VERSION


@dataclass(frozen=True)
class CCode:
    """Functions of a system in C99.

    Parameters
    ----------
    name : str
        Prefix of all names, and name of the files.
    header, source : str
        Texts of the files.

    Examples
    --------
    >>> import gauss
    >>> from gauss.export import to_c
    >>> code = to_c(gauss.load("pendulum"), ["mass_matrix"])
    >>> code.name, 'mass_matrix' in code.header
    ('pendulum', True)
    """

    name: str
    header: str
    source: str

    def save(self, folder) -> tuple[Path, Path]:
        """Write header and source to a folder, and return their paths.

        Raises
        ------
        FileError
            If the folder cannot be written to.
        """
        folder = Path(folder)
        paths = folder / f"{self.name}.h", folder / f"{self.name}.c"
        with writing(folder):
            folder.mkdir(parents=True, exist_ok=True)
            for path, text in zip(paths, (self.header, self.source), strict=True):
                path.write_text(text, encoding="utf-8")
        return paths


def to_c(system: System | Scene, names: Sequence[str] | str | None = None, name: str | None = None) -> CCode:
    """Functions of a system in C99, without dependencies beyond the mathematics of the standard library.

    Parameters
    ----------
    system : System or Scene
        The system.
    names : sequence of str, optional
        Functions, see :func:`gauss.export.exported_functions`.
    name : str, optional
        Prefix of the names, and name of the files; that of the scene when not given.

    Returns
    -------
    CCode
        Header and source. Of each function there is one for a state, and one, with ``_batch`` after its name, for n states
        in rows. Arguments and results must not overlap; matrices are stored row by row.

    Raises
    ------
    ArgumentError
        If there is no such function, or two of them have the same name as code.
    SimulationError
        If the scene has elements that no smooth function describes, by their names.

    Examples
    --------
    >>> import gauss
    >>> from gauss import export
    >>> code = export.to_c(gauss.load("pendulum"), "mass_matrix")
    >>> "void pendulum_mass_matrix(const double q[1], double t, double result[1]);" in code.header
    True
    """
    require(system, (System, Scene), "export")
    scene = system if isinstance(system, Scene) else system.scene
    return c_code(identifier(scene.name if name is None else name), scene, exported_functions(system, names))


def c_code(prefix: str, scene: Scene, functions: list[ExportedFunction]) -> CCode:
    """Header and source of exported functions of a scene, with a prefix of their names."""
    return CCode(prefix, "\n".join(_header(prefix, scene, functions)), "\n".join(_source(prefix, functions)))


def _header(prefix: str, scene: Scene, functions: list[ExportedFunction]) -> Iterator[str]:
    guard = f"{prefix.upper()}_H"
    joints = [joint for joint in scene.joints.values() if joint.pair.n_q]
    title = f"Scene {_remark(repr(scene.name))}, written by gauss {VERSION}"
    yield f"/* {title}. SI units, angles in rad, unit quaternions (w, x, y, z)."
    yield f"   q, v: coordinates and rates of {_remark(', '.join(joint.name for joint in joints))}, in this order."
    yield "   load: generalised forces added to those of the scene; u: inputs; t: time. Matrices are stored row by row."
    yield "   _batch: n states, one after the other in every array. Arguments and results must not overlap. */"
    yield f'#ifndef {guard}\n#define {guard}\n\n#include <stddef.h>\n\n#ifdef __cplusplus\nextern "C" {{\n#endif\n'
    if scene.inputs:
        yield f"/* u: {_remark(', '.join(scene.inputs))} */"
    for function in functions:
        yield f"{_signature(prefix, function)};"
        yield f"{_batch_signature(prefix, function)};\n"
    yield "#ifdef __cplusplus\n}\n#endif\n\n#endif\n"


def _remark(text: str) -> str:
    """Text that does not end a comment."""
    return text.replace("*/", "* /")


def _source(prefix: str, functions: list[ExportedFunction]) -> Iterator[str]:
    yield f'/* Written by gauss {VERSION}. */\n#include "{prefix}.h"\n\n#include <math.h>\n'
    yield PRELUDE
    for function in functions:
        yield _signature(prefix, function)
        yield "{"
        yield from (f"    {line}" for line in _unused(function))
        yield from (f"    {line}" for line in CBody(function).statements())
        yield "}\n"
        yield _batch_signature(prefix, function)
        yield "{"
        given = [_row(name, shape) for name, shape in (function.inputs | function.outputs).items()]
        yield "    for (size_t i = 0; i < n; ++i)"
        yield f"        {prefix}_{function.identifier}({', '.join(given)});"
        yield "}\n"


def _signature(prefix: str, function: ExportedFunction) -> str:
    given = [f"const double {name}{_size(shape)}" if shape else f"double {name}" for name, shape in function.inputs.items()]
    given += [f"double {name}{_size(shape)}" for name, shape in function.outputs.items()]
    return f"void {prefix}_{function.identifier}({', '.join(given)})"


def _size(shape: tuple[int, ...]) -> str:
    """Size of an array as an argument; none of an empty one, which C does not know."""
    return f"[{prod(shape) or ''}]"


def _batch_signature(prefix: str, function: ExportedFunction) -> str:
    given = [f"const double *{name}" for name in function.inputs] + [f"double *{name}" for name in function.outputs]
    return f"void {prefix}_{function.identifier}_batch(size_t n, {', '.join(given)})"


def _row(name: str, shape: tuple[int, ...]) -> str:
    """Argument of the state i of a batch."""
    return f"{name} + i * {prod(shape)}" if shape else f"{name}[i]"


def _unused(function: ExportedFunction) -> Iterator[str]:
    """Statements that keep compilers from warning of unused arguments."""
    used = {node.value for node in function.function.nodes if node.op == "symbol"}
    flat = iter(symbol.value for symbol in function.function.inputs)
    for name, shape in function.inputs.items():
        values = [next(flat) for _ in range(prod(shape))]
        if used.isdisjoint(values):
            yield f"(void){name};"
    yield from (f"(void){name};" for name, shape in function.outputs.items() if not prod(shape))
