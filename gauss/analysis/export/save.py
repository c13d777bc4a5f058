"""Files of functions of a system in other languages; one writer for each language."""

from collections.abc import Callable, Sequence
from pathlib import Path

from gauss.analysis.export.exported_function import exported_functions, folder_of, identifier
from gauss.errors import ArgumentError, did_you_mean, require, writing
from gauss.scene import Scene
from gauss.system import System


def save_as(
    system: System | Scene,
    language: str,
    folder=".",
    names: Sequence[str] | str | None = None,
    name: str | None = None,
    parameters: Sequence[str] | str = (),
) -> list[Path]:
    """Write functions of a system as code of another language.

    Parameters
    ----------
    system : System or Scene
        The system.
    language : str
        "c": a header and a source; "casadi": one file for each function, for ``casadi.Function.load``; "jax": a Python
        module; "latex": a document with the equations of motion in symbols; "fmu": a unit of FMI 3, see :func:`to_fmu`.
    folder : str or Path
        Folder of the files; it is made if it does not exist.
    names : sequence of str, optional
        Functions, see :func:`gauss.export.exported_functions`.
    name : str, optional
        Name of the files; that of the scene when not given.
    parameters : sequence of str
        Numbers of the scene that stay open as tunable parameters of a unit of FMI 3, see :func:`to_fmu`.

    Returns
    -------
    list of Path
        Files that were written.

    Raises
    ------
    ArgumentError
        If there is no such language or function, or the language has no tunable parameters.
    FileError
        If the folder cannot be written to.
    MissingPackageError
        If the language needs a package that is not installed.
    SimulationError
        If the scene has elements that no smooth function describes, by their names.

    Examples
    --------
    >>> import tempfile
    >>> import gauss
    >>> from gauss.export import save_as
    >>> [path.name for path in save_as(gauss.load("pendulum"), "c", tempfile.mkdtemp(), ["mass_matrix"])]
    ['pendulum.h', 'pendulum.c']
    """
    require(system, (System, Scene), "export")
    if not isinstance(language, str) or language not in WRITERS:
        raise ArgumentError(f"export: no language {language!r}. {did_you_mean(str(language), WRITERS)}")
    scene = system if isinstance(system, Scene) else system.scene
    own = identifier(scene.name if name is None else name)
    if parameters:
        return [_unit(system, language, folder_of(folder), names, own, parameters)]
    return WRITERS[language](system, folder_of(folder), names, own)


def _save_c(system, folder: Path, names, name: str) -> list[Path]:
    from gauss.analysis.export.c_files import to_c

    return list(to_c(system, names, name).save(folder))


def _save_casadi(system, folder: Path, names, name: str) -> list[Path]:
    from gauss.analysis.export.casadi_function import casadi_function

    paths = []
    for exported in exported_functions(system, names):
        paths.append(folder / f"{name}_{exported.identifier}.casadi")
        casadi_function(exported).save(str(paths[-1]))
    return paths


def _save_text(make: Callable[..., str], suffix: str) -> Callable:
    def save(system, folder: Path, names, name: str) -> list[Path]:
        path, text = folder / f"{name}{suffix}", make(system, names)
        with writing(path):
            path.write_text(text, encoding="utf-8")
        return [path]

    return save


def _jax(system, names) -> str:
    from gauss.analysis.export.jax_module import jax_source

    return jax_source(system, names)


def _latex(system, names) -> str:
    from gauss.analysis.export.formulas import latex_document

    return latex_document(system, names)


def _save_fmu(system, folder: Path, names, name: str) -> list[Path]:
    return [_unit(system, "fmu", folder, names, name, ())]


def _unit(system, language: str, folder: Path, names, name: str, parameters: Sequence[str] | str) -> Path:
    from gauss.analysis.export.fmu.unit import to_fmu

    if language != "fmu":
        raise ArgumentError(f"export: {language!r} has no tunable parameters; 'fmu' has, or leave parameters out.")
    if names is not None:
        raise ArgumentError("export: a unit of FMI has no functions to choose; its outputs are those of the scene.")
    return to_fmu(system, folder, name, parameters)


WRITERS: dict[str, Callable] = {
    "c": _save_c,
    "casadi": _save_casadi,
    "jax": _save_text(_jax, ".py"),
    "latex": _save_text(_latex, ".tex"),
    "fmu": _save_fmu,
}
