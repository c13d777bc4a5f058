"""Pages of the notebooks: their texts, code and kept outputs as Markdown, with the pictures as files."""

import base64
import json
from functools import cache
from pathlib import Path
from typing import Any

from gauss.io.catalog import folder


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
