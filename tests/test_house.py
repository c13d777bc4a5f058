"""The house itself: one name for one thing, short functions, public names with docstrings, tests in the rooms of gauss.

The cyclomatic complexity of a function is 1 + the number of its decisions (McCabe, IEEE Trans. Software Eng. 2, 1976).
"""

import ast
import inspect
import warnings
from collections import Counter
from functools import cache
from importlib import import_module
from itertools import chain
from pathlib import Path

import pytest
from numpydoc.docscrape import NumpyDocString

import gauss

ROOT = Path(gauss.__file__).parent
TESTS = Path(__file__).parent
PACKAGES = sorted(path.parent.name for path in ROOT.glob("*/__init__.py"))
DECISIONS = (ast.If, ast.IfExp, ast.For, ast.While, ast.Assert, ast.ExceptHandler, ast.comprehension, ast.match_case)
DEFINITIONS = (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)
COMPLEXITY_LIMIT = 12


@cache
def trees() -> dict[str, ast.Module]:
    """Syntax trees of all files of gauss, by their paths."""
    files = sorted(ROOT.rglob("*.py"))
    return {str(path.relative_to(ROOT)): ast.parse(path.read_text(encoding="utf-8")) for path in files}


def nodes(kind):
    """All nodes of a kind, with the paths of their files."""
    return [(path, node) for path, tree in trees().items() for node in ast.walk(tree) if isinstance(node, kind)]


def own(node: ast.AST):
    """Nodes inside a function, without those of the functions and classes that it defines."""
    for child in ast.iter_child_nodes(node):
        if not isinstance(child, DEFINITIONS):
            yield child
            yield from own(child)


def decisions(node: ast.AST) -> int:
    """Decisions that one node makes; the branch ``else`` of a loop or of ``try`` is one, too."""
    further = {ast.BoolOp: "values", ast.comprehension: "ifs", ast.For: "orelse", ast.While: "orelse", ast.Try: "orelse"}
    several = len(getattr(node, further[type(node)])) if type(node) in further else 0
    if isinstance(node, ast.BoolOp):
        return several - 1
    return isinstance(node, DECISIONS) + (several if isinstance(node, ast.comprehension) else several > 0)


def complexity(function: ast.FunctionDef) -> int:
    """Cyclomatic complexity of a function, without those that it defines."""
    body = ast.Module([line for line in function.body if not isinstance(line, DEFINITIONS)], [])
    return 1 + sum(map(decisions, own(body)))


def assigned(tree: ast.Module) -> list[str]:
    """Names that a file assigns outside of functions and classes."""
    lines = [line for line in tree.body if isinstance(line, ast.Assign | ast.AnnAssign)]
    targets = chain.from_iterable(line.targets if isinstance(line, ast.Assign) else [line.target] for line in lines)
    return [name.id for target in targets for name in ast.walk(target) if isinstance(name, ast.Name)]


def test_the_count_of_decisions():
    source = "def f(x):\n  if x and (x or 1):\n    return [a for a in x if a]\n  def g(): return 1 if x else 2\n  return 1"
    outer = ast.parse(source).body[0]
    assert (complexity(outer), complexity(outer.body[1])) == (6, 2)


def test_no_two_classes_share_a_name():
    counts = Counter(node.name for _, node in nodes(ast.ClassDef))
    shared = {name for name, count in counts.items() if count > 1}
    assert {f"{path}: {node.name}" for path, node in nodes(ast.ClassDef) if node.name in shared} == set()


@pytest.mark.parametrize("name", ["ROUNDING", "RANK", "LARGEST", "NOTHING"])
def test_a_bound_has_one_definition(name):
    assert len([path for path, tree in trees().items() if name in assigned(tree)]) <= 1


def test_no_function_makes_many_decisions():
    found = [(complexity(node), f"{path}:{node.lineno} {node.name}") for path, node in nodes(ast.FunctionDef)]
    assert [function for function in found if function[0] > COMPLEXITY_LIMIT] == []


def page(thing) -> NumpyDocString:
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # unknown sections, sections that are there twice
        return NumpyDocString(inspect.getdoc(thing) or "")


@pytest.mark.parametrize("package", ["gauss", *(f"gauss.{name}" for name in PACKAGES)])
def test_public_names_have_pages(package):
    module = import_module(package)
    things = {name: getattr(module, name) for name in getattr(module, "__all__", ())}
    ours = {name: thing for name, thing in things.items() if inspect.isfunction(thing) or inspect.isclass(thing)}
    assert page(module)["Summary"]
    assert [name for name, thing in ours.items() if not page(thing)["Summary"]] == []


def test_tests_stand_in_the_rooms_of_gauss():
    folders = {path.parent.name for path in TESTS.glob("*/__init__.py")}
    assert folders == {*PACKAGES, "support", "validation"}
