"""Command ``gauss docs``."""

from pathlib import Path
from typing import Annotated

import typer


def docs(
    context: typer.Context,
    output: Annotated[Path, typer.Option(help="Folder for the pages.")] = Path("gauss-docs"),
    gallery: Annotated[bool, typer.Option(help="Run and draw the examples of the gallery.")] = True,
    strict: Annotated[bool, typer.Option("--strict", help="Take warnings for errors.")] = False,
):
    """Write the documentation as web pages: guides, gallery, reference of all public names, benchmarks."""
    from gauss.docs.build import build  # imports what no other command needs

    typer.echo(f"documentation written to {build(output, context.find_root().command, gallery, strict)}")
