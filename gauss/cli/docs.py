"""Command ``gauss docs``."""

from importlib import import_module
from pathlib import Path
from typing import Annotated

import typer

from gauss.errors import FileError, extra

MODULES = (
    "gauss",
    "gauss.math",
    "gauss.errors",
    "gauss.linkages",
    "gauss.rotors",
    "gauss.servo",
    "gauss.view",
    "gauss.view.viewer",
    "gauss.scene",
    "gauss.system",
    "gauss.backends",
    "gauss.dynamics",
    "gauss.integrators",
    "gauss.simulation",
    "gauss.simulation.sweeps",
    "gauss.analysis",
    "gauss.io",
    "gauss.rotations",
    "gauss.codegen",
    "gauss.codegen.kernels",
)


def docs(output: Annotated[Path, typer.Option(help="Folder for the pages.")] = Path("gauss-docs")):
    """Write the reference of all public names as web pages, from their docstrings; needs pdoc."""
    with extra("docs"):
        pdoc = import_module("pdoc")
    for module in map(import_module, MODULES):
        for name in getattr(module, "__all__", ()):  # pdoc looks at what is there already
            setattr(module, name, getattr(module, name))
    pdoc.render.configure(docformat="numpy")
    try:
        pdoc.pdoc(*MODULES, output_directory=output)
    except OSError as error:
        raise FileError(f"{output}: cannot be written: {error.strerror}.") from error
    typer.echo(f"reference written to {output / 'index.html'}")
