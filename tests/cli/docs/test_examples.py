"""Scripts of the gallery: short, they run, and what they say of accuracy holds."""

import ast
import re
import runpy
import sys
import warnings
from pathlib import Path

import pytest

from gauss.cli.docs.gallery import SECTIONS
from gauss.cli.docs.uses import examples
from gauss.io.catalog import folder
from gauss.versions import version_of
from tests.support.extras import others

SCRIPTS = examples()
LINES, ISSUE_LINES = 60, 15  # of a script; of the code of a script about an issue
OPTIONAL = {  # what a text needs
    "gym": "gymnasium",
    "optimal_motion": "casadi",
    "robot:": "example-robot-data",
    "sweep(": "xarray",
}
LONG = ("control/mppi.py", "arms/panda.py")  # run by other tests, or take more than two seconds


def _code(script: Path) -> list[str]:
    """Lines without the docstring and without empty ones."""
    text = script.read_text(encoding="utf-8")
    return [
        line for line in text[ast.parse(text).body[0].end_col_offset + text.index('"""', 3) :].splitlines() if line.strip()
    ]


def test_there_are_thirty_and_ten():
    issues = [script for script in SCRIPTS if script.parent.name == "issues"]
    assert len(issues) == 10 and len(SCRIPTS) - len(issues) >= 30
    assert {script.parent.name for script in SCRIPTS} == set(SECTIONS)


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: str(path.relative_to(folder() / "examples")))
def test_scripts_are_short_and_have_a_title(script):
    text = script.read_text(encoding="utf-8")
    assert len(text.splitlines()) <= LINES
    title, line, *_ = (ast.get_docstring(ast.parse(text)) or "").splitlines()
    assert re.fullmatch("=+", line) and len(line) == len(title)
    if script.parent.name == "issues":
        assert "https://github.com/" in text and len(_code(script)) <= ISSUE_LINES + 1
    else:
        assert "figure" in text


@pytest.mark.disk  # packages that are hidden enter no machine code
@pytest.mark.slow
@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: str(path.relative_to(folder() / "examples")))
def test_scripts_run_with_the_extra_of_the_documentation(script, capsys, monkeypatch):
    name = str(script.relative_to(folder() / "examples"))
    if name in LONG:
        pytest.skip("long")
    text = script.read_text(encoding="utf-8")
    for needed in {package for word, package in OPTIONAL.items() if word in text}:
        if version_of(needed) is None:
            pytest.skip(f"{needed} is not installed")
    for module in others("docs"):
        monkeypatch.setitem(sys.modules, module, None)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # redundant rows leave reactions open, and say so
        runpy.run_path(str(script), run_name="__main__")
    assert capsys.readouterr().out
