"""Command ``gauss doctor``."""

import typer


def doctor():
    """Look at the installation: processor, machine code, its cache, solvers, packages; exit code 1 if gauss cannot run."""
    from gauss.doctor import examine  # other commands need none of it

    findings = examine()
    for finding in findings:
        mark = "!" if not finding.works else "-" if finding.remedy else "✓"
        typer.echo(f"{mark} {finding.name:13} {finding.text}")
        if finding.remedy:
            typer.echo(f"  {'':13} → {finding.remedy}")
    if not all(finding.works for finding in findings):
        raise typer.Exit(1)
