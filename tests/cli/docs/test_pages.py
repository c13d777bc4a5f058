"""Pages of the documentation: their code runs, their links lead somewhere, the README is short and shows what they show."""

import re
from pathlib import Path

import pytest

from gauss.cli.docs import generated
from gauss.cli.docs.uses import PAGES, snippets

ROOT = Path(__file__).parents[3]
FILES = sorted(PAGES.rglob("*.md"))
WITH_CODE = [page for page in FILES if snippets(page)]
LINK = re.compile(r"\]\((?!https?://)([^)#\s]*)(?:#[^)]*)?\)|^:link: (\S+)|^```\{image\} (\S+)", re.MULTILINE)
MADE = ("gallery/index.rst", "reference/index.rst", "benchmarks/index.md")  # when the pages are built
ROWS, LINES = 20, 150  # tasks of the table of tasks; lines that the README may have
PICTURE = 500_000  # bytes that the moving picture may have


def _known() -> set[str]:
    """Pages and files that are there once the pages are built."""
    files = {str(path.relative_to(PAGES)) for path in PAGES.rglob("*") if path.is_file()}
    tables = {f"benchmarks/results/{path.name}" for path in generated.original("benchmarks/results").glob("*.md")}
    examples = generated.folder() / "examples"
    gallery = {f"gallery/{path.relative_to(examples).with_suffix('.rst')}" for path in examples.rglob("*.py")}
    of_package = {"glossary.md", "changelog.md", "formats.md", "models.md", "guides/command_line.md", "reference/laws.rst"}
    books, _ = generated.notebook_pages()
    return files | tables | gallery | of_package | {*books, *MADE, *generated.copies(), "reference/gauss.integrators.rst"}


KNOWN = _known()


def _targets(page: Path) -> list[str]:
    found = [next(filter(None, match), "") for match in LINK.findall(page.read_text(encoding="utf-8"))]
    return [target for target in found if target]


@pytest.mark.parametrize("page", FILES, ids=lambda page: str(page.relative_to(PAGES)))
def test_links_lead_to_pages(page):
    for target in _targets(page):
        path = str((page.parent / target).resolve().relative_to(PAGES.resolve()))
        assert path in KNOWN or f"{path}.md" in KNOWN or f"{path}.rst" in KNOWN, target


@pytest.mark.disk  # only the folder is another one
@pytest.mark.slow
@pytest.mark.parametrize("page", WITH_CODE, ids=lambda page: str(page.relative_to(PAGES)))
@pytest.mark.filterwarnings("ignore::gauss.errors.SlowRouteWarning")
def test_code_of_pages_runs(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    scope: dict = {"__name__": page.stem}
    for number, code in enumerate(snippets(page)):
        exec(compile(code, f"{page.name}[{number}]", "exec"), scope)


def test_the_table_of_tasks_leads_from_each_to_a_page():
    rows = re.findall(r"^\| (\d+) \| [^|]+ \| (.+) \|$", (PAGES / "tasks.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert [int(number) for number, _ in rows] == list(range(1, ROWS + 1))
    assert all("](" in pages for _, pages in rows)


def test_readme_is_short_and_its_links_lead_to_files():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert len(text.splitlines()) <= LINES
    for target in re.findall(r"\]\((?!https?://)([^)#]+)", text):
        assert (ROOT / target).exists(), target
    assert (PAGES / "pictures" / "walker.gif").stat().st_size <= PICTURE
