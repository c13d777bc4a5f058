"""Commands ``gauss check``, ``gauss explain``, ``gauss export`` and ``gauss models``."""

from importlib import import_module
from pathlib import Path
from typing import Annotated

import typer

import gauss
from gauss.cli.common import Backend, Read, Root, SceneName, Seed, conclude, load
from gauss.errors import FileError, did_you_mean

LANGUAGES = ("c", "casadi", "jax", "latex", "fmu")


def check(
    scene: SceneName,
    states: Annotated[int, typer.Option(help="Number of random states.")] = 20,
    seed: Seed = 0,
    tolerance: Annotated[float, typer.Option(help="Largest relative difference that passes.")] = 1e-10,
    backend: Backend = "auto",
    root: Root = "fixed",
    read: Read = None,
):
    """Compare accelerations, reactions and energies with Pinocchio on random states; exit code 1 when they differ."""
    found = load(scene, root, read)
    scene_alone = found if isinstance(found, gauss.Scene) else found.system
    conclude(gauss.crosscheck(scene_alone, states, seed=seed, tolerance=tolerance, backend=backend))


def explain(scene: SceneName, root: Root = "fixed", read: Read = None):
    """Describe a scene: elements, mobility, reductions and plan, cost, and a recommended method."""
    found = load(scene, root, read)
    if isinstance(found, gauss.Scene):
        system = gauss.compile_scene(found)
        typer.echo(system.explain())
        if system.n_v:  # else there is no method to choose
            typer.echo(f"\n{gauss.advise(system)}")
    else:
        typer.echo(import_module("gauss.servo").explain(found))


def models():
    """List the scenes, servos, linkages and rotor networks that come with gauss."""
    found = gauss.catalog() | gauss.io.servos()
    for command, of_command in (("linkage", gauss.io.linkages()), ("rotors", gauss.io.networks())):
        found |= {f"{command} {name}": text for name, text in of_command.items()}
    width = max(len(name) for name in found)
    for name, description in found.items():
        typer.echo(f"{name:{width}}  {description}")


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
