"""Command ``gauss linkage``."""

from pathlib import Path
from typing import Annotated

import typer

import gauss
from gauss.cli.common import INTERRUPTED, as_far_as_it_came, check_files, view
from gauss.errors import FileError, did_you_mean


def linkage(
    file: Annotated[
        str,
        typer.Argument(
            help="A linkage file (.toml), or the name of a shipped linkage (see `gauss models`).", show_default=False
        ),
    ],
    steps: Annotated[int, typer.Option(help="Number of steps of a turn of the crank.", min=2)] = 360,
    speed: Annotated[float | None, typer.Option(help="Speed of the crank [rad/s]; that of the file when not given.")] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "--csv",
            help="Write torque, reactions and motion at every crank angle; with --run the motion of the crank in time "
            "(.csv, .json, .npz, .nc, .h5, .zarr).",
        ),
    ] = None,
    plot: Annotated[
        Path | None,
        typer.Option(help="Draw the mechanism, torque, forces, transmission angles and coupler curves (.png, .svg, .pdf)."),
    ] = None,
    coupler: Annotated[
        list[str] | None,
        typer.Option(
            help="Point LINK=X,Y of a link [m] whose curve is drawn by --plot and written by --output; may be repeated."
        ),
    ] = None,
    animation: Annotated[
        Path | None, typer.Option(help="Draw the turning mechanism (.gif, or .mp4 where ffmpeg is installed).")
    ] = None,
    fluctuation: Annotated[
        float | None, typer.Option(help="Size the flywheel for this fluctuation of speed, (ω_max − ω_min) / ω.")
    ] = None,
    run: Annotated[
        float | None, typer.Option(help="Run the linkage from rest under its own motor for this time [s].")
    ] = None,
):
    """Analyse a planar linkage by its Assur groups: torque, reactions, work, quality of motion."""
    from gauss.linkages import coupler_curves, report, table  # other commands need no linkages

    check_files("cycle" if run is None else "crankrun", output, plot)
    mechanism = gauss.load_linkage(file)
    if speed is not None:
        mechanism.set_speed(speed)
    cycle = mechanism.cycle(mechanism.sweep(steps))
    points = _points(coupler, [link.name for link in cycle.chain.links])
    typer.echo(report(mechanism, cycle))
    if fluctuation is not None:
        wheel = mechanism.flywheel(fluctuation)
        typer.echo(f"  flywheel       {wheel.inertia:.6g} kg m² for δ = {fluctuation:g}; ΔE = {wheel.excess_energy:.6g} J")
    if output is not None and run is None:
        typer.echo(f"table written to {gauss.save(table(cycle) | coupler_curves(cycle, points), output)}")
    if plot is not None:
        view().plot_linkage(cycle, plot, points)
        typer.echo(f"figure written to {plot}")
    if animation is not None:
        typer.echo(f"animation written to {view().animate_linkage(cycle, animation)}")
    if run is not None:
        motion, interrupted = as_far_as_it_came(lambda: mechanism.run(run))
        typer.echo(f"run: {motion}")
        if output is not None:
            typer.echo(f"run written to {gauss.save(motion, output)}")
        if interrupted:
            raise typer.Exit(INTERRUPTED)


def _points(given: list[str] | None, links: list[str]) -> list[tuple[str, tuple[float, float]]]:
    """Links and points of ``--coupler``."""
    found = []
    for entry in given or ():
        link, _, place = entry.rpartition("=")
        try:
            x, y = (float(number) for number in place.split(","))
        except ValueError:
            raise FileError(f"--coupler {entry}: expected LINK=X,Y with two lengths [m], e.g. coupler=0.5,0.2.") from None
        if link not in links:
            raise FileError(f"--coupler {entry}: no link {link!r}. {did_you_mean(link, links)}")
        found.append((link, (x, y)))
    return found
