import ast
import re
from functools import cache
from pathlib import Path

import pytest

PAGE = Path(__file__).parents[3] / "gauss/cli/docs/pages/concepts/design_checks.md"
TESTS = Path(__file__).parents[2]
LEAST_ROWS = 3  # independent answers for a part
PARTS = dict(re.findall(r"^## (.+?)\n(.+?)(?=^## |\Z)", PAGE.read_text(encoding="utf-8"), re.S | re.M))


def rows(part):
    """Cells of the rows of the table of a part."""
    lines = [line for line in PARTS[part].splitlines() if line.startswith("|")][2:]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]


@cache
def functions_in(path):
    tree = ast.parse((TESTS / path).read_text(encoding="utf-8"))
    return {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}


@pytest.mark.parametrize("part", PARTS)
def test_each_part_has_independent_answers_one_with_loops(part):
    found = rows(part)
    assert len(found) >= LEAST_ROWS and any("loop" in cells[0] for cells in found)


@pytest.mark.parametrize("named", [cells[-1].strip("`") for part in PARTS for cells in rows(part)])
def test_the_tests_that_are_named_exist(named):
    path, _, name = named.partition("::")
    assert name in functions_in(path)
