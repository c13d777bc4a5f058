"""A functional mock-up unit: sources, compiled by the compiler of the system, and their description, in one archive.

Functional Mock-up Interface Specification 3.0 (Modelica Association, 2022).
"""

import platform
import shutil
import subprocess
import tempfile
import zipfile
from collections.abc import Iterator, Sequence
from hashlib import sha256
from pathlib import Path

from gauss.analysis.export.c_files import CCode, c_code
from gauss.analysis.export.exported_function import ExportedFunction, folder_of, identifier
from gauss.analysis.export.fmu.model_description import build_description, model_description, variables
from gauss.analysis.export.fmu.unit_functions import unit_functions
from gauss.analysis.export.fmu.unit_parameters import UnitParameters
from gauss.dynamics.scene_compilation import system_of
from gauss.errors import ArgumentError, MissingPackageError, SimulationError
from gauss.scene import Scene
from gauss.system import State, System

MACHINES = {"x86_64": "x86_64", "amd64": "x86_64", "arm64": "aarch64", "aarch64": "aarch64"}
SYSTEMS = {"linux": ("linux", ".so"), "darwin": ("darwin", ".dylib")}
FLAGS = ("-std=c99", "-O3", "-fPIC", "-shared", "-fvisibility=hidden")


def to_fmu(system: System | Scene, folder=".", name: str | None = None, parameters: Sequence[str] = ()) -> Path:
    """Write a functional mock-up unit of FMI 3, for model exchange and for co-simulation.

    Parameters
    ----------
    system : System or Scene
        The system. Its inputs and outputs are those of the unit; where the scene has no outputs, all coordinates and rates
        are outputs. Start values can be changed, also of states of one's own; derivatives are not numbers (NaN) from a start
        in which a loop that cannot move has another pose than in the scene.
    folder : str or Path
        Folder of the file.
    name : str, optional
        Name of the file; that of the scene when not given.
    parameters : sequence of str
        Numbers of the scene that are tunable parameters of the unit, as "rod.mass", "spring.stiffness", "B.at[0]" or
        "gravity.y", a few of them: the numbers of the equations are found as polynomials of all.

    Returns
    -------
    Path
        The file, with its sources and a library for this machine.

    Raises
    ------
    ArgumentError
        If there are no units for this machine, or the numbers of the equations are no polynomials of a parameter.
    MissingPackageError
        If there is no C compiler.
    SceneError
        If a parameter is no number of the scene.
    SimulationError
        If the scene has elements that no smooth function describes, by their names, or the compiler fails.

    Examples
    --------
    >>> import gauss
    >>> from gauss import export
    >>> export.to_fmu(gauss.load("pendulum"), "/tmp").name  # doctest: +SKIP
    'pendulum.fmu'
    """
    system = system_of(system, "export")
    own = identifier(system.scene.name if name is None else name)
    tuned = UnitParameters(system, parameters)
    functions, start = unit_functions(tuned), system.initial_state()
    code = c_code("model", system.scene, functions)
    kinds = variables(system, start, tuned.values)
    sources = {"unit.c": Path(__file__).with_name("unit.c").read_text(encoding="utf-8"), "model.c": code.source}
    token = sha256("".join([*sources.values(), *map(str, sum(kinds.values(), []))]).encode()).hexdigest()
    sources["model.h"] = _header(code, functions, start, tuned, token)
    texts = {f"sources/{key}": text for key, text in sources.items()}
    texts["sources/buildDescription.xml"] = build_description(own, ["unit.c", "model.c"])
    texts["modelDescription.xml"] = model_description(system, own, token, kinds)
    path = folder_of(folder) / f"{own}.fmu"
    with tempfile.TemporaryDirectory() as place, zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for key, text in texts.items():
            archive.writestr(key, text)
        machine, suffix = _machine()
        archive.write(_compiled(sources, Path(place), own + suffix), f"binaries/{machine}/{own}{suffix}")
    return path


def _machine() -> tuple[str, str]:
    """Folder of the library of this machine, as "x86_64-linux", and its suffix."""
    architecture, kind = MACHINES.get(platform.machine().lower()), SYSTEMS.get(platform.system().lower())
    if architecture is None or kind is None:
        raise ArgumentError(f"to_fmu: no units for {platform.machine()} and {platform.system()}; use Linux or macOS.")
    return f"{architecture}-{kind[0]}", kind[1]


def _compiled(sources: dict[str, str], folder: Path, name: str) -> Path:
    """Library of some sources."""
    compiler = shutil.which("cc")
    if compiler is None:
        raise MissingPackageError("to_fmu needs a C compiler, 'cc', which is not installed.")
    for key, text in sources.items():
        (folder / key).write_text(text, encoding="utf-8")
    files = [str(folder / key) for key in sources if key.endswith(".c")]
    done = subprocess.run([compiler, *FLAGS, *files, "-o", str(folder / name), "-lm"], capture_output=True, text=True)
    if done.returncode:
        raise SimulationError(f"to_fmu: the compiler failed: {done.stderr.strip()[:1000]}")
    return folder / name


def _header(code: CCode, functions: list[ExportedFunction], start: State, tuned: UnitParameters, token: str) -> str:
    """Header of the model, with what the unit calls."""
    return code.header + "\n" + "\n".join(_interface(functions, start, tuned, token)) + "\n"


def _interface(functions: list[ExportedFunction], start: State, tuned: UnitParameters, token: str) -> Iterator[str]:
    rates, _ = functions
    n_q, n_x, n_u, n_y = start.q.size, start.q.size + start.v.size, rates.inputs["u"][0], rates.outputs["output"][0]
    yield "#ifndef UNIT_INTERFACE\n#define UNIT_INTERFACE"
    yield f"#define UNIT_STATES {n_x}\n#define UNIT_INPUTS {n_u}\n#define UNIT_OUTPUTS {n_y}"
    yield f'static const char unit_token[] = "{token}";'
    yield f"static const double unit_start[] = {{{', '.join(repr(float(x)) for x in [*start.q, *start.v])}}};"
    given = [*[0.0] * (n_u - len(tuned.values)), *tuned.values.values()]
    yield f"static const double unit_given[] = {{{', '.join(map(repr, given)) or '0.0'}}};"
    yield "static inline void unit_rates(double t, const double *x, const double *u, double *rate, double *y)"
    yield f"{{\n    model_rates(x, x + {n_q}, u, t, rate, y);\n}}"
    yield "static inline void unit_project(double t, const double *x, const double *u, double *result)"
    yield f"{{\n    model_project(x, x + {n_q}, u, t, result);\n}}"
    yield "#endif"
