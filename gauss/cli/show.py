"""Command ``gauss show``."""

from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

import typer

import gauss
from gauss.cli.common import Read, Root, load, started
from gauss.errors import FileError

Shown = Annotated[
    str,
    typer.Argument(
        help="A scene, as for `gauss run`, which is simulated; or a motion that `gauss run --output` wrote as .nc, .h5 or "
        ".zarr.",
        show_default=False,
    ),
]


def show(
    scene: Shown,
    duration: Annotated[
        float, typer.Option(help="How long a scene is simulated [s]; 0: it is posed by sliders.", min=0.0)
    ] = 5.0,
    start: Annotated[list[str] | None, typer.Option(help="Where a joint starts, NAME=VALUE; may be repeated.")] = None,
    speed: Annotated[list[str] | None, typer.Option(help="How fast it starts, NAME=VALUE; may be repeated.")] = None,
    integrator: Annotated[str, typer.Option(help="Integrator of a scene, as of `gauss run`.")] = "dop853",
    step: Annotated[float | None, typer.Option(help="Step of a fixed-step method, largest step of others [s].")] = None,
    root: Root = "fixed",
    read: Read = None,
    reactions: Annotated[
        list[str] | None, typer.Option(help="Joint whose reaction is drawn as an arrow, or all; may be repeated.")
    ] = None,
    html: Annotated[Path | None, typer.Option(help="Write one file that plays in any browser (.html), and end.")] = None,
    film: Annotated[
        Path | None, typer.Option("--video", "--gif", help="Write a film (.gif; .mp4 with imageio-ffmpeg), and end.")
    ] = None,
    trace: Annotated[
        list[str] | None, typer.Option(help="Body or frame that leaves a trace; may be repeated. Tips when not given.")
    ] = None,
    beside: Annotated[
        Path | None,
        typer.Option(help="Second motion (.nc, .h5, .zarr, of `gauss run`), played beside the first."),
    ] = None,
    dark: Annotated[bool, typer.Option("--dark", help="Begin with the dark ground.")] = False,
    port: Annotated[int, typer.Option(help="Port of the viewer.", min=1, max=65535)] = 8080,
    browser: Annotated[bool, typer.Option("--browser", help="Open a browser.")] = False,
):
    """Show a scene or motion in the browser; the viewer can be reached from this machine only."""
    _refuse_for_films(film if html is None else None, beside, dark)
    if Path(scene).suffix.lower() in import_module("gauss.io.load").RESULTS:
        thing, visuals = _saved(scene)
    else:
        found = load(scene, root, read)
        found = found if isinstance(found, gauss.Scene) else found.system.scene
        visuals = import_module("gauss.io.visuals").read_visuals(scene, root)
        found = started(found, start, speed)
        thing = gauss.simulate(found, duration, integrator=integrator, step=step) if duration > 0 else found
    viewer = import_module("gauss.view.viewer")  # its library takes long to import
    look: dict[str, Any] = {"visuals": visuals, "joints": _joints(thing, reactions), "traces": trace}
    second, others = (None, []) if beside is None else _saved(str(beside))
    both = look | {"beside": second, "beside_visuals": others, "dark": dark}
    if html is not None:
        typer.echo(f"viewer written to {viewer.export_html(thing, html, **both)}")
    if film is not None:
        typer.echo(f"film written to {viewer.export_film(thing, film, **look)}")
    if html is not None or film is not None:
        return
    running = viewer.show(thing, port=port, browser=browser, **both)
    typer.echo(f"{running.url} (Ctrl+C ends it)")
    running.wait()


def _refuse_for_films(film: Path | None, beside: Path | None, dark: bool):
    """Refuse options that mean nothing for a film alone."""
    if film is not None and (beside is not None or dark):
        raise FileError(
            f"{film}: a film shows one motion on the light ground; --beside and --dark are for the viewer and --html."
        )


def _saved(path: str) -> tuple:
    """Motion of a file, and its meshes."""
    motion = gauss.load_motion(path)
    return motion, _kept(path, motion.system.scene)


def _kept(path: str, scene: "gauss.Scene") -> list:
    """Meshes kept with a motion; of a file without them those of its robot."""
    if not scene.source:
        return []
    visuals = import_module("gauss.io.visuals")  # imports Pinocchio
    return visuals.saved_visuals(path) or visuals.visuals_of(scene)


def _joints(thing, reactions) -> list[str]:
    if not reactions:
        return []
    if not isinstance(thing, gauss.Trajectory):
        raise FileError("--reactions: a scene that is not simulated has none; give a --duration.")
    return [joint.name for joint in thing.system.joints] if reactions == ["all"] else list(reactions)
