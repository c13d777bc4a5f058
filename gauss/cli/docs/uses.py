"""Where public names are used: in snippets of the pages and in the examples, found in the syntax trees of their code."""

import ast
import re
from collections.abc import Iterator
from functools import cache
from importlib import import_module
from pathlib import Path

from gauss.cli.docs.groups import GROUPS, MADE_BY
from gauss.io.catalog import folder

PAGES = Path(__file__).parent / "pages"
SNIPPET = re.compile(r"^```python\n(.*?)^```$", re.MULTILINE | re.DOTALL)
PACKAGES = ("gauss", "gauss.linkages", "gauss.rotors", "gauss.servo", "gauss.view", "gauss.view.viewer", "gauss.scene")
MOST_PAGES = 8  # pages listed for one name


def snippets(page: Path) -> list[str]:
    """Code of a page, block by block."""
    return SNIPPET.findall(page.read_text(encoding="utf-8"))


def examples() -> list[Path]:
    """Scripts of the gallery."""
    return sorted((folder() / "examples").rglob("*.py"))


def uses() -> dict[str, list[tuple[str, str]]]:
    """Pages, with their titles, by the public names that their code uses."""
    found: dict[str, list[tuple[str, str]]] = {}
    for page, title, code in _sources():
        for name in names_in(code):
            pages = found.setdefault(name, [])
            if (page, title) not in pages and len(pages) < MOST_PAGES:
                pages.append((page, title))
    return found


def names_in(code: str) -> set[str]:
    """Public names that a piece of code uses, and those of the objects that it makes by methods."""
    nodes = list(ast.walk(ast.parse(code)))
    chains = {_dotted(node) for node in nodes if isinstance(node, ast.Attribute)}
    direct = _full(chains, {"gauss": "gauss"} | _imported(nodes))
    used = {_by_alias()[part] for chain in direct for part in _beginnings(chain) if part in _by_alias()}
    methods = {f".{chain.rpartition('.')[2]}" for chain in chains}
    return used | {name for name, maker in MADE_BY.items() if maker in used | methods}


def _full(chains: set[str], modules: dict[str, str]) -> set[str]:
    """Full names of dotted ones and of what is imported."""
    parts = [chain.partition(".") for chain in chains]
    return {f"{modules[first]}.{rest}" for first, _, rest in parts if first in modules} | set(modules.values())


def _imported(nodes: list[ast.AST]) -> dict[str, str]:
    """Full names of what is imported from gauss, by the names that it has then."""
    lines = [node for node in nodes if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("gauss")]
    return {alias.asname or alias.name: f"{line.module}.{alias.name}" for line in lines for alias in line.names}


def _beginnings(chain: str) -> Iterator[str]:
    """Dotted names that a dotted name begins with, and itself."""
    parts = chain.split(".")
    return (".".join(parts[:k]) for k in range(1, len(parts) + 1))


@cache
def _by_alias() -> dict[str, str]:
    """Public names by their full names in the packages that one types."""
    found: dict[str, str] = {}
    for name in (name for group in GROUPS for name in group.names):
        module, _, last = name.rpartition(".")
        thing = getattr(import_module(module), last)
        same = [package for package in PACKAGES if getattr(import_module(package), last, None) is thing]
        found |= {name: name} | {f"{package}.{last}": name for package in same}
    return found


def _dotted(node: ast.expr) -> str:
    parts = []
    while isinstance(node, ast.Attribute):
        parts.append(node.attr)
        node = node.value
    return ".".join([node.id if isinstance(node, ast.Name) else "", *reversed(parts)])


def _sources() -> Iterator[tuple[str, str, str]]:
    """Page, its title, and its code."""
    for page in sorted(PAGES.rglob("*.md")):
        title = page.read_text(encoding="utf-8").partition("\n")[0].removeprefix("# ")
        for code in snippets(page):
            yield str(page.relative_to(PAGES).with_suffix("")), title, code
    for script in examples():
        text = script.read_text(encoding="utf-8")
        title = (ast.get_docstring(ast.parse(text)) or script.stem).partition("\n")[0]
        yield f"gallery/{script.relative_to(folder() / 'examples').with_suffix('')}", title, text
