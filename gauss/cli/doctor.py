"""Command ``gauss doctor``."""

from typing import Annotated

import typer


def doctor(
    cache: Annotated[bool, typer.Option("--cache", help="The cache of machine code alone: folder, numbers, sizes.")] = False,
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
