"""Command ``gauss export``."""

from pathlib import Path
from typing import Annotated

import typer

import gauss
from gauss.cli.common import Read, Root, SceneName, load
from gauss.errors import FileError, did_you_mean

LANGUAGES = ("c", "casadi", "jax", "latex", "fmu")


def export(
    scene: SceneName,
    to: Annotated[str, typer.Option(help=f"Language: {', '.join(LANGUAGES)}.")] = "c",
    function: Annotated[
        list[str] | None,
        typer.Option(help="Function of a state, such as mass_matrix or jacobian:hand; may be repeated.", show_default=False),
    ] = None,
    output: Annotated[Path, typer.Option(help="Folder of the files.")] = Path("."),
    parameter: Annotated[
        list[str] | None,
        typer.Option(
            help="Number of the scene that stays a tunable parameter of an fmu, such as rod.mass; may be repeated.",
            show_default=False,
        ),
    ] = None,
    name: Annotated[str | None, typer.Option(help="Name of the files, and prefix of the functions in C.")] = None,
    root: Root = "fixed",
    read: Read = None,
):
    """Write the equations of motion of a scene as code of another language, or as formulas."""
    if to not in LANGUAGES:
        raise FileError(f"--to: no language {to!r}. {did_you_mean(to, LANGUAGES)}")
    found = load(scene, root, read)
    if not isinstance(found, gauss.Scene):
        raise FileError(f"{scene}: servos cannot be exported; name a scene.")
    from gauss.export import save_as

    for path in save_as(gauss.compile_scene(found), to, output, function or None, name, parameter or ()):
        typer.echo(f"written to {path}")
