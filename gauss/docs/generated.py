"""Pages that are made of the package and of its measurements: the table of plans, formats, benchmarks, glossary, changelog.

Figures on pages come from ``benchmarks/results`` alone: their tables are copied, and where a page quotes one, it is read
there.
"""

import re
from pathlib import Path

from gauss.docs.command_line import commands
from gauss.docs.plans import plan_tables
from gauss.io.catalog import catalog, folder, linkages, networks, servos

PACKAGE = Path(__file__).parents[1]
INSIDE = PACKAGE / "docs" / "originals"  # of an installed package; see pyproject.toml
LINK = re.compile(r"(?<!!)\[([^\]]+)\]\((?!https?://|#)([^)#]+)(?:#[^)]*)?\)")


def original(name: str) -> Path:
    """A file of the repository that goes with an installed package, too."""
    return (INSIDE if INSIDE.is_dir() else PACKAGE.parent) / name


def copies() -> dict[str, Path]:
    """Files that are copied as they are, by their names below the pages: charts of the benchmarks."""
    results = original("benchmarks/results")
    return {f"benchmarks/results/{path.name}": path for path in sorted(results.iterdir()) if path.suffix in (".png", ".svg")}


def texts(program) -> dict[str, str]:
    """Pages by their names; of the command line, those of a program (click.Group)."""
    pages = {
        "concepts/plan_tables.txt": plan_tables(),
        "glossary.md": (PACKAGE / "glossary.md").read_text(encoding="utf-8"),
        "changelog.md": original("CHANGELOG.md").read_text(encoding="utf-8"),
        "formats.md": _linked((folder() / "README.md").read_text(encoding="utf-8"), set()),
        "models.md": _models(),
        "guides/command_line.md": commands(program),
    }
    return pages | _benchmarks()


def _benchmarks() -> dict[str, str]:
    """The tables of the benchmarks, each a page, and the page that lists them."""
    tables = {path.name: path.read_text(encoding="utf-8") for path in sorted(original("benchmarks/results").glob("*.md"))}
    names = {f"results/{name}" for name in tables}
    overview = _linked(original("benchmarks/README.md").read_text(encoding="utf-8"), names)
    toctree = "\n".join(
        ["", "```{toctree}", ":maxdepth: 1", ":hidden:", "", *(f"results/{name[:-3]}" for name in tables), "```", ""]
    )
    charts = {name.removeprefix("benchmarks/results/") for name in copies()}
    pages = {f"benchmarks/results/{name}": _linked(text, {*tables, *charts}) for name, text in tables.items()}
    return pages | {"benchmarks/index.md": overview + toctree}


def _linked(text: str, known: set[str]) -> str:
    """Text without links to files that are no pages: their names stay."""
    return LINK.sub(lambda match: match[0] if match[2] in known else match[1], text)


def _models() -> str:
    """Tables of the scenes, linkages and networks that come with the package."""
    kinds = {"Scenes": catalog(), "Scenes with servos": servos(), "Linkages": linkages(), "Rotor networks": networks()}
    introduction = (
        "What `gauss models` lists: `gauss.load(NAME)`, `gauss run NAME`. Their files are the best examples of the "
        "[format](formats.md)."
    )
    parts = ["# Models", introduction]
    for kind, lines in kinds.items():
        parts += [
            f"## {kind}",
            "\n".join(
                ["| name | what it is |", "|---|---|", *(f"| `{name}` | {_cell(line)} |" for name, line in lines.items())]
            ),
        ]
    return "\n\n".join(parts) + "\n"


def _cell(text: str) -> str:
    return text.replace("|", "\\|")
