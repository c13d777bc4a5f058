"""Commands ``gauss doctor`` and ``gauss docs``."""

from pathlib import Path
from typing import Annotated

import typer


def doctor(
    cache: Annotated[
        bool, typer.Option("--cache", help="Report the cache of machine code only: folder, numbers, sizes.")
    ] = False,
    empty: Annotated[bool, typer.Option("--empty", help="With --cache: remove its files first.")] = False,
):
    """Look at the installation: processor, machine code, its cache, solvers, packages; exit code 1 if gauss cannot run."""
    from gauss.doctor import examine, examine_cache  # other commands need none of it

    if empty and not cache:
        raise typer.BadParameter("--empty goes with --cache.")
    findings = examine_cache(empty) if cache else examine()
    for finding in findings:
        mark = "!" if not finding.works else "-" if finding.remedy else "✓"
        typer.echo(f"{mark} {finding.name:13} {finding.text}")
        if finding.remedy:
            typer.echo(f"  {'':13} → {finding.remedy}")
    if not all(finding.works for finding in findings):
        raise typer.Exit(1)


def docs(
    context: typer.Context,
    output: Annotated[Path, typer.Option(help="Folder for the pages.")] = Path("gauss-docs"),
    gallery: Annotated[bool, typer.Option(help="Run and draw the examples of the gallery.")] = True,
    strict: Annotated[bool, typer.Option("--strict", help="Take warnings for errors.")] = False,
):
    """Write the documentation as web pages: guides, gallery, reference of all public names, benchmarks."""
    from gauss.cli.docs.build import build  # imports what no other command needs

    typer.echo(f"documentation written to {build(output, context.find_root().command, gallery, strict)}")
