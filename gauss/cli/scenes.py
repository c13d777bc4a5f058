"""Commands ``gauss check``, ``gauss explain`` and ``gauss models``."""

from importlib import import_module
from typing import Annotated

import typer

import gauss
from gauss.cli.common import Backend, Read, Root, SceneName, Seed, conclude, load


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
