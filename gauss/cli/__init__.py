"""Command line: each command parses arguments and calls a few functions; one file for each group of commands."""

import warnings

import typer

from gauss.cli import bench, docs, doctor, linkage, rotors, run, scenes, show, sweep
from gauss.errors import GaussError

app = typer.Typer(
    help="Dynamics of mechanisms by Gauss's principle of least constraint, cross-checked against Pinocchio.",
    no_args_is_help=True,
    rich_markup_mode="markdown",  # the default would swallow units in [brackets]
    add_completion=False,
    pretty_exceptions_enable=False,
)

for command in (
    run.run,
    sweep.sweep,
    show.show,
    scenes.check,
    scenes.explain,
    linkage.linkage,
    rotors.rotors,
    scenes.models,
    bench.chart,
    doctor.doctor,
    docs.docs,
):
    app.command()(command)
app.add_typer(bench.bench, name="bench")
app.add_typer(bench.problems, name="problems")


def main():
    """Entry point: errors and warnings of gauss are one line, not a traceback."""
    warnings.showwarning = lambda message, *_: typer.secho(f"warning: {message}", fg="yellow", err=True)
    try:
        app()
    except GaussError as error:
        typer.secho(f"error: {error}", fg="red", err=True)
        raise SystemExit(2) from None
