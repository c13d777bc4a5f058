"""Command ``gauss linkage``."""

from pathlib import Path
from typing import Annotated

import typer

import gauss
from gauss.cli.common import INTERRUPTED, as_far_as_it_came, view


def linkage(
    file: Annotated[
        str,
        typer.Argument(
            help="A linkage file (.toml), or the name of a shipped linkage (see `gauss models`).", show_default=False
        ),
    ],
    steps: Annotated[int, typer.Option(help="Number of steps of a turn of the crank.", min=2)] = 360,
    speed: Annotated[float | None, typer.Option(help="Speed of the crank [rad/s]; that of the file when not given.")] = None,
    csv: Annotated[Path | None, typer.Option(help="Write torque, reactions and motion at every crank angle (.csv).")] = None,
    plot: Annotated[
        Path | None, typer.Option(help="Draw the mechanism, torque, reactions and bearing forces (.png, .svg, .pdf).")
    ] = None,
    animation: Annotated[
        Path | None, typer.Option(help="Draw the turning mechanism (.gif, or .mp4 where ffmpeg is installed).")
    ] = None,
    fluctuation: Annotated[
        float | None, typer.Option(help="Size the flywheel for this fluctuation of speed, (ω_max − ω_min) / ω.")
    ] = None,
    run: Annotated[
        float | None, typer.Option(help="Run the linkage under its own motor from rest, for so long [s].")
    ] = None,
):
    """Analyse a planar linkage by its Assur groups: torque, reactions, work, quality of motion."""
    from gauss.linkages import report, table  # other commands need no linkages

    mechanism = gauss.load_linkage(file)
    if speed is not None:
        mechanism.set_speed(speed)
    cycle = mechanism.cycle(mechanism.sweep(steps))
    typer.echo(report(mechanism, cycle))
    if fluctuation is not None:
        wheel = mechanism.flywheel(fluctuation)
        typer.echo(f"  flywheel       {wheel.inertia:.6g} kg m² for δ = {fluctuation:g}; ΔE = {wheel.excess_energy:.6g} J")
    if csv is not None:
        typer.echo(f"table written to {gauss.io.write_csv(table(cycle), csv)}")
    for path, draw in ((plot, "plot_linkage"), (animation, "animate_linkage")):
        if path is not None:
            getattr(view(), draw)(cycle, path)
            typer.echo(f"{'figure' if path is plot else 'animation'} written to {path}")
    if run is not None:
        motion, interrupted = as_far_as_it_came(lambda: mechanism.run(run))
        typer.echo(f"run: {motion}")
        if interrupted:
            raise typer.Exit(INTERRUPTED)
