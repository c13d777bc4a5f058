"""Pages that are made of the package and of its measurements: plans, formats, benchmarks, glossary, changelog; notebooks.

Of the notebooks they have the texts, code and kept outputs as Markdown, with the pictures as files.

Figures on pages come from ``benchmarks/results`` alone: their tables are copied, and where a page quotes one, it is read
there.
"""

import base64
import json
import re
from collections.abc import Iterator
from functools import cache
from itertools import chain, starmap
from pathlib import Path
from typing import Any

from gauss.bench.markdown import table
from gauss.dynamics import plan
from gauss.dynamics.rules import Rule
from gauss.io.catalog import catalog, folder, linkages, networks, servos

PACKAGE = Path(__file__).parents[2]
INSIDE = PACKAGE / "cli" / "docs" / "originals"  # of an installed package; see pyproject.toml
LINK = re.compile(r"(?<!!)\[([^\]]+)\]\((?!https?://|#)([^)#]+)(?:#[^)]*)?\)")
INTRODUCTION = (
    "`gauss --help` lists the commands, `gauss COMMAND --help` their options. Wherever a scene is asked for, it is a file, "
    "the name of a [model](../models.md), or `robot:NAME`. Errors are one line, with the remedy, and end with code 2. "
    "`gauss --install-completion` lets the shell complete commands and options."
)
COLUMNS = ("", "driver", "dynamics", "applies to", "if", "then, where a check fails")  # of a rule
JOINED = re.compile(r" and (?=[A-Z])")  # of two conditions
TABLES = {
    "Motions, by `gauss.simulate`": plan.MOTIONS,
    "Batches, by `gauss.rollout`": plan.BATCHES,
    "Accelerations of a state, by `System.accelerations`": plan.ACCELERATIONS,
    "Functions of a state, by `System.function`": plan.FUNCTIONS,
    "Accelerations on a device, by `System.function(device=)`": plan.DEVICE_FUNCTIONS,
}


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
        "formats.md": _linked((folder() / "README.md").read_text(encoding="utf-8"), set()).replace(
            "# Models", "# File formats", 1
        ),
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
        parts += [f"## {kind}", _table(("name", "what it is"), ((f"`{name}`", line) for name, line in lines.items()))]
    return "\n\n".join(parts) + "\n"


def _table(titles, rows) -> str:
    return "\n".join(table(titles, rows))


def commands(group) -> str:
    """Page in Markdown.

    Parameters
    ----------
    group : click.Group
        All commands of the program.
    """
    return "\n\n".join(["# The command line", INTRODUCTION, *_described(group, "gauss")]) + "\n"


def _described(group, name: str) -> Iterator[str]:
    for key, command in group.commands.items():
        if hasattr(command, "commands"):
            yield from _described(command, f"{name} {key}")
        else:
            yield f"## `{name} {key}`"
            yield (command.help or "").strip()
            yield _table(("", ""), _rows(command.params))


def _rows(parameters) -> Iterator[tuple[str, str]]:
    for parameter in parameters:
        is_option = parameter.param_type_name == "option"
        shown = ", ".join([*parameter.opts, *parameter.secondary_opts]) if is_option else parameter.name.upper()
        yield f"`{shown}`", " ".join((parameter.help or "").replace("|", "/").split())


def plan_tables() -> str:
    """Tables in Markdown."""
    parts = ((f"### {title}", _table(COLUMNS, starmap(_row, enumerate(rules.rules, 1)))) for title, rules in TABLES.items())
    return "\n\n".join(chain.from_iterable(parts)) + "\n"


def _row(number: int, rule: Rule) -> tuple:
    conditions = "; ".join(_said(condition) for condition in rule.conditions) or "always"
    return number, rule.driver, rule.dynamics, _said(rule.when), conditions, rule.fallback or "–"


def _said(condition) -> str:
    """First sentences of the docstrings of a condition, or of two that are joined, as part of a sentence."""
    sentence = (condition.__doc__ or "").strip().partition("\n")[0].rstrip(".")
    parts = [part.removeprefix("Whether ") for part in JOINED.split(sentence)]
    return " and ".join(part[:1].lower() + part[1:] for part in parts) or "all"


def notebooks() -> list[Path]:
    """Notebooks that are shown, in the order of their names."""
    return sorted((folder() / "notebooks").glob("*.ipynb"))


@cache
def notebook_pages() -> tuple[dict[str, str], dict[str, bytes]]:
    """Pages and pictures by their names below the pages of the documentation."""
    pages, pictures = dict[str, str](), dict[str, bytes]()
    for path in notebooks():
        cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
        parts = []
        for number, cell in enumerate(cells):
            parts.append(_source(cell))
            for place, output in enumerate(cell.get("outputs", ())):
                name = f"{path.stem}_{number}_{place}.png"
                picture = output.get("data", {}).get("image/png")
                if picture is not None:
                    pictures[f"notebooks/{name}"] = base64.b64decode(picture)
                    parts.append(f"![What the cell draws]({name})")
                else:
                    parts.append(_shown(output))
        where = f"*This page is the notebook `models/notebooks/{path.name}`, as the tests run it.*"
        pages[f"notebooks/{path.stem}.md"] = "\n\n".join([parts[0], where, *parts[1:], ""])
    index = "\n".join(
        ["# Notebooks", "", "```{toctree}", ":maxdepth: 1", "", *(path.stem for path in notebooks()), "```", ""]
    )
    return pages | {"notebooks/index.md": index}, pictures


def _source(cell: dict[str, Any]) -> str:
    """Text of a cell, or its code in a fence without commands of the notebook."""
    text = "".join(cell["source"])
    if cell["cell_type"] == "markdown":
        return text
    lines = [line for line in text.splitlines() if not line.startswith("%")]
    return "\n".join(["```python", *lines, "```"])


def _shown(output: dict[str, Any]) -> str:
    """Formula of a result, or what was printed in a fence."""
    data = output.get("data", {})
    if "text/latex" in data:
        return "\n".join(["```{math}", "".join(data["text/latex"]).strip("$").removeprefix("\\displaystyle").strip(), "```"])
    text = "".join(output.get("text", data.get("text/plain", "")))
    return "\n".join(["```text", text.strip("\n"), "```"])
