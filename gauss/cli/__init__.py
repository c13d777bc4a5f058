"""Command line: each command parses arguments and calls a few functions; one file for each group of commands."""

import os
import re
import sys
import warnings
from errno import EDQUOT, EFBIG, ENOSPC
from typing import Annotated

import typer

from gauss.cli import bench, doctor, linkage, rotors, run, scenes, show, sweep
from gauss.cli.common import group
from gauss.errors import GaussError
from gauss.versions import VERSION

# arguments of functions that are named in errors, with a text or what follows, and are options here
ARGUMENT = re.compile(r"\b(integrator|step|rtol|atol|backend|stabilisation)=(?:'(\w+)'| ?)")
FULL = (ENOSPC, EDQUOT, EFBIG)  # the disk, the quota, or the file is full

app = group(pretty_exceptions_enable=False)

for command in (
    run.run,
    sweep.sweep,
    show.show,
    scenes.check,
    scenes.explain,
    scenes.export,
    linkage.linkage,
    rotors.rotors,
    scenes.models,
    bench.chart,
    doctor.doctor,
    doctor.docs,
):
    app.command()(command)
app.add_typer(bench.bench, name="bench")
app.add_typer(bench.problems, name="problems")


def as_options(message: str) -> str:
    """Message of an error with arguments as options of the command line: ``step=1e-3`` is ``--step 1e-3``."""
    return ARGUMENT.sub(lambda found: f"--{found[1]} {found[2] or ''}", message)


def _say_version(asked: bool):
    if asked:
        typer.echo(f"gauss {VERSION}")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", help="Show the version, and end.", callback=_say_version, is_eager=True)
    ] = False,
):
    """Dynamics of mechanisms by Gauss's principle of least constraint, cross-checked against Pinocchio."""


def main():
    """Entry point: errors and warnings of gauss are one line, not a traceback."""
    warnings.showwarning = lambda message, *_: typer.secho(f"warning: {message}", fg="yellow", err=True)
    try:
        app()
    except GaussError as error:
        typer.secho(f"error: {as_options(str(error))}", fg="red", err=True)
        raise SystemExit(2) from None
    except OSError as error:
        if error.errno not in FULL:
            raise
        typer.secho(f"error: the output cannot be written: {error.strerror}.", fg="red", err=True)
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # what is left of it is written at the end
        raise SystemExit(2) from None
