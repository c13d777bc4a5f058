"""Command ``gauss sweep``."""

import time
from collections import Counter
from importlib import import_module
from pathlib import Path
from typing import Annotated

import typer

import gauss
from gauss.cli.common import INTERRUPTED, Atol, Read, Root, SceneName, check_files, load, tolerances
from gauss.errors import FileError, extra
from gauss.simulation import INTEGRATORS

SHOWN = 5  # reasons of failures that are printed


def sweep(
    scene: SceneName,
    vary: Annotated[
        list[str],
        typer.Option(
            help="What is varied: NAME=FROM:TO:COUNT or NAME=VALUE,VALUE,…, e.g. crank.mass=0.5:2:50, rod.com.x=0.1,0.2, "
            "A.position, A.rate (at the start), spring.stiffness, gravity.z; may be repeated."
        ),
    ],
    duration: Annotated[float, typer.Option(help="How long to simulate [s].")] = 2.0,
    together: Annotated[
        bool, typer.Option("--together", help="Vary all parameters together, value by value, instead of every combination.")
    ] = False,
    samples: Annotated[int, typer.Option(help="Number of equally spaced samples.", min=2)] = 101,
    integrator: Annotated[str, typer.Option(help=f"One of {', '.join(INTEGRATORS)}.")] = "dop853",
    step: Annotated[float | None, typer.Option(help="Step of a fixed-step method, largest step of others [s].")] = None,
    rtol: Annotated[float, typer.Option(help="Relative local error of coordinates and rates.")] = 1e-9,
    atol: Atol = None,
    workers: Annotated[int | None, typer.Option(help="Processes of this machine that share the work.", min=1)] = None,
    dask: Annotated[str | None, typer.Option(help="Address of the scheduler of a Dask cluster that does the work.")] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            help="Write the result to this folder (.zarr) as it is made, go on if it is there; or at the end as .nc or .h5, "
            "or a table with a row for each member (.csv, .json, .npz)."
        ),
    ] = None,
    root: Root = "fixed",
    read: Read = None,
):
    """Simulate a scene with many values of its masses, lengths, starts, …, and report their outcomes."""
    check_files("dataset", output)
    found = load(scene, root, read)
    if not isinstance(found, gauss.Scene):
        raise FileError(f"{scene}: servos are not simulated in sweeps; sweep the scene without them.")
    began, client = time.perf_counter(), None if dask is None else _client(dask)
    settings = {"integrator": integrator, "step": step, "rtol": rtol, "atol": tolerances(atol)}
    sweeps = import_module("gauss.simulation.sweeps")  # it takes long to import
    values = sweeps.ranges(vary)
    grows = output is not None and output.suffix.lower() == ".zarr"
    chosen = {"together": together, "samples": samples, "workers": client or workers, "path": output if grows else None}
    interrupted = False
    try:
        dataset = sweeps.sweep(found, values, duration, **settings, **chosen)
    except KeyboardInterrupt as error:
        dataset, interrupted = getattr(error, "dataset", None), True
        goes_on = f"; the same command goes on from {output}" if grows else ""
        typer.secho(f"interrupted{goes_on}.", fg="yellow", err=True)
    finally:
        if client is not None:
            client.close()
    if dataset is not None:
        _report(dataset, time.perf_counter() - began)
    _write(dataset, output, grows)
    if interrupted:
        raise typer.Exit(INTERRUPTED)


def _write(dataset, output: Path | None, is_there: bool):
    """Write a sweep where asked for, unless it has been written as it was made."""
    if output is None or dataset is None:
        return
    if not is_there:
        gauss.save(dataset, output)
    typer.echo(f"sweep written to {output}")


def _client(address: str):
    with extra("cluster"):
        from distributed import Client
    try:
        return Client(address)
    except (OSError, ValueError) as error:
        raise FileError(f"--dask: no scheduler at {address!r}: {error}.") from error


def _report(dataset, took: float):
    status = dataset.status.values.ravel()
    done = int((status == 1).sum())
    typer.echo(f"{dataset.attrs['title']}: {status.size} members over {dataset.attrs['varied']}")
    typer.echo(f"  {'done':12} {done} of {status.size}, in {took:.3g} s")
    reasons = Counter(map(str, dataset.reason.values.ravel()[status == 2]))
    for reason, count in sorted(reasons.items())[:SHOWN]:
        typer.echo(f"  {'failed':12} {count}: {reason}")
    if len(reasons) > SHOWN:
        typer.echo(f"  {'failed':12} … and {len(reasons) - SHOWN} other reasons")
    for letter, axis in (("q", "coordinate"), ("v", "rate")):
        ends = dataset[letter].isel(time=-1)
        for name, unit in zip(dataset[axis].values, dataset[f"{axis}_unit"].values, strict=True):
            values = ends.sel({axis: name})
            typer.echo(f"  {letter} {name} at the end: {float(values.min()):.6g} … {float(values.max()):.6g} {unit}")
