"""Command ``gauss rotors``."""

import warnings
from pathlib import Path
from typing import Annotated

import typer

import gauss
from gauss.cli.common import INTERRUPTED, as_far_as_it_came, check_files, equally_spaced, view


def rotors(
    file: Annotated[
        str,
        typer.Argument(help="A rotor file (.toml) or the name of a shipped network, e.g. gear_runup.", show_default=False),
    ],
    duration: Annotated[float, typer.Option(help="How long to simulate [s].")] = 5.0,
    samples: Annotated[int, typer.Option(help="Number of equally spaced samples.", min=2)] = 501,
    rtol: Annotated[float, typer.Option(help="Relative local error of angles and speeds.")] = 1e-9,
    atol: Annotated[
        float | None,
        typer.Option(
            help="Absolute local error [rad, rad/s]; if not given, 1e-9 rad and 1e-11 of the largest start or no-load speed."
        ),
    ] = None,
    method: Annotated[str, typer.Option(help="auto, dop853 (explicit) or radau (implicit, for stiff slips).")] = "auto",
    steady: Annotated[bool, typer.Option("--steady", help="Find all steady operating points at the end.")] = False,
    modes: Annotated[
        bool, typer.Option("--modes", help="List torsional eigenfrequencies and modes in the state at the end.")
    ] = False,
    explain: Annotated[
        bool, typer.Option("--explain", help="Print the reduced equations of the network, in symbols.")
    ] = False,
    plot: Annotated[Path | None, typer.Option(help="Draw speeds, slips, torques and losses to this file.")] = None,
    network: Annotated[Path | None, typer.Option(help="Draw the network to this file (.png, .svg, .pdf).")] = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "--csv", help="Write the motion to this file (.csv, .json, .npz, .nc, .h5, .zarr)."),
    ] = None,
):
    """Simulate a network of rotors: shafts, gears, friction drives, springs and clutches."""
    from gauss import rotors as package  # other commands need no rotors

    given = gauss.load_rotors(file)
    check_files("rotormotion", output, plot, network)
    if explain:
        typer.echo(package.explain(given) + "\n")
    if network is not None:
        view().draw_network(given, network)
        typer.echo(f"drawing written to {network}")
    with warnings.catch_warnings(record=True) as issued:
        warnings.simplefilter("always", package.BeltSlipWarning)
        times = equally_spaced(duration, samples)
        motion, interrupted = as_far_as_it_came(
            lambda: package.simulate(given, duration, times=times, rtol=rtol, atol=atol, method=method)
        )
    for warning in issued:
        typer.secho(f"warning: {warning.message}", fg="yellow", err=True)
    typer.echo(package.report(motion))
    if steady and not interrupted:
        typer.echo(package.steady_table(package.operating_points(given, duration), duration))
    if modes and not interrupted:
        typer.echo(package.mode_table(package.eigenmodes(given, motion)))
    if plot is not None:
        view().plot_rotors(motion, plot)
        typer.echo(f"figure written to {plot}")
    if output is not None:
        typer.echo(f"motion written to {gauss.save(motion, output)}")
    if interrupted:
        raise typer.Exit(INTERRUPTED)
