"""The house itself: one name for one thing, short functions, public names with docstrings, tests in the rooms of gauss.

The cyclomatic complexity of a function is 1 + the number of its decisions (McCabe, IEEE Trans. Software Eng. 2, 1976).
"""

import ast
import inspect
import re
import warnings
from collections import Counter, defaultdict
from functools import cache
from importlib import import_module
from itertools import chain
from pathlib import Path

import pytest
from numpydoc.docscrape import NumpyDocString

import gauss
from gauss.codegen import gc_pause

ROOT = Path(gauss.__file__).parent
TESTS = Path(__file__).parent
PACKAGES = sorted(path.parent.name for path in ROOT.glob("*/__init__.py"))
SHORT_NAMES = sorted(path.stem for path in ROOT.glob("*.pyi") if path.stem != "__init__")  # of what stands inside a room
# Retired words of names, and what the field says.
RETIRED_WORDS = {
    **dict.fromkeys(("fade", "fades", "faded", "fading"), "near rank-deficient, near-singular"),
    **dict.fromkeys(("settle", "settles", "settled", "settling"), "project; solve the contact problem; active set found"),
    **dict.fromkeys(("grip", "grips"), "set-valued element"),
    **dict.fromkeys(("holder", "holders"), "mode selector"),
    **dict.fromkeys(("flank", "flanks"), "backlash side"),
    **dict.fromkeys(("lacking", "lacks", "unbalanced"), "residual"),
    **dict.fromkeys(("linkwise", "looped", "meetings"), "call graph, shared joints"),
    **dict.fromkeys(("paying", "patient", "patience"), "tiered compilation, compile_threshold"),
    **dict.fromkeys(("crowd", "streamed"), "batch, adaptive batch with lane refill"),
    **dict.fromkeys(("judge", "audible", "insistence"), "step-size controller, verdict, status"),
    "careful": "refined",
    "expanded": "Taylor step",
    "outlook": "advise, recommendation",
    "passage": "joint kinematics; singularity avoidance",
    "plays": "backlashes",
    "remembers": "method state",
    "rubs": "tangential directions",
    "skewed": "non-ideal",
    "swept": "tree recursion",
    "told": "contact mode",
}
# Retired names as a whole: their words have other uses.
RETIRED_NAMES = {
    **dict.fromkeys(("Bare", "pushes", "ways"), "ideal counterpart, joint factors, direction of power flow"),
    **dict.fromkeys(("Block", "Cells", "Form", "Place"), "operand, call recorder, specialisation, slot"),
    **dict.fromkeys(("Corrected", "Guarded", "Otherwise", "Repeat"), "refined, checked switch, first accepted, fixed point"),
    **dict.fromkeys(("Pull", "Tie", "tie"), "Baumgarte feedback, coupling constraint"),
    **dict.fromkeys(("QUIET", "TRUST", "MET", "OPEN", "DEAD", "LIVE", "NOTHING", "HUGE"), "the quantity that is bounded"),
    **dict.fromkeys(("Staying", "pressed", "touched"), "unilateral, active set"),
    "Part": "subsystem",
    "changing": "nonsmooth elements",
    "closing": "loop constraints, loop joints",
    "closure_gap": "constraint residual",
    "holding": "mode selection",
}
PLAIN_ENGLISH = {"told", "plays", "lacks", "expanded", "swept"}  # in texts
PAGES = ("README.md", "CONTRIBUTING.md", "models/README.md", "benchmarks/README.md")
FORMER_TEXTS = {"outlook", "--patience"}  # former public names, and a former option
FORMER = "FormerAttribute"  # gives a former name, with a DeprecationWarning
DECISIONS = (ast.If, ast.IfExp, ast.For, ast.While, ast.Assert, ast.ExceptHandler, ast.comprehension, ast.match_case)
DEFINITIONS = (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)
COMPLEXITY_LIMIT = 12
NEEDED = {"gauss.gym": "gymnasium"}  # packages without which a room is not there


@cache
def trees() -> dict[str, ast.Module]:
    """Syntax trees of all files of gauss, by their paths."""
    files = sorted(ROOT.rglob("*.py"))
    with gc_pause():  # the collector would look again and again at all nodes
        return {str(path.relative_to(ROOT)): ast.parse(path.read_text(encoding="utf-8")) for path in files}


@cache
def by_kind() -> dict[str, dict[type, list]]:
    """Nodes of each file by their kind: all are walked through once."""
    found: dict[str, dict[type, list]] = {}
    for path, tree in trees().items():
        kinds = found[path] = defaultdict(list)
        for node in ast.walk(tree):
            kinds[type(node)].append(node)
    return found


def nodes(kind):
    """All nodes of a kind, with the paths of their files."""
    return [(path, node) for path, kinds in by_kind().items() for node in kinds[kind]]


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


def defined(tree: ast.Module) -> set[str]:
    """Names that a file defines: classes, functions, parameters, attributes, constants and fields."""
    every = list(ast.walk(tree))
    found = {node.name for node in every if isinstance(node, DEFINITIONS)}
    found |= {node.arg for node in every if isinstance(node, ast.arg)}
    found |= {node.attr for node in every if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store)}
    classes = [node for node in every if isinstance(node, ast.ClassDef)]
    bodies = [tree.body, *(node.body for node in classes)]
    lines = [
        line for body in bodies for line in body if not (isinstance(line, ast.Assign) and FORMER in ast.dump(line.value))
    ]
    return found | set(assigned(ast.Module(lines, [])))


def retired(names: set[str]) -> list[str]:
    """Those names that are retired or contain a retired word."""
    words = {name: {word.lower() for word in re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])", name)} for name in names}
    return sorted(name for name in names if name in RETIRED_NAMES or words[name] & RETIRED_WORDS.keys())


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


def test_retired_words_are_found():
    source = (
        "class Told:\n  def gripped(self, rest_flank): self.holder = closing = 1\n  grips = FormerAttribute('set_valued')"
    )
    assert retired(defined(ast.parse(source))) == ["Told", "holder", "rest_flank"]
    assert set(RETIRED_NAMES).isdisjoint(RETIRED_WORDS)


def test_retired_words_are_gone():
    modules = {part.removesuffix(".py") for path in trees() for part in Path(path).parts}
    assert retired(modules) == []
    assert {path: names for path, tree in trees().items() if (names := retired(defined(tree)))} == {}


def test_texts_have_no_retired_words():
    found = {path: (ROOT.parent / path).read_text(encoding="utf-8") for path in PAGES}
    strings = [(path, node) for path, node in nodes(ast.Constant) if isinstance(node.value, str)]
    found |= {f"{path}:{node.lineno}": node.value for path, node in strings if node.value not in FORMER_TEXTS}
    words = {place: set(re.findall(r"\w+", text.lower())) & RETIRED_WORDS.keys() for place, text in found.items()}
    assert {place: said for place, those in words.items() if (said := those - PLAIN_ENGLISH)} == {}


def page(thing) -> NumpyDocString:
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # unknown sections, sections that are there twice
        return NumpyDocString(inspect.getdoc(thing) or "")


@pytest.mark.parametrize("package", ["gauss", *(f"gauss.{name}" for name in (*PACKAGES, *SHORT_NAMES))])
def test_public_names_have_pages(package):
    if package in NEEDED:
        pytest.importorskip(NEEDED[package])
    module = import_module(package)
    things = {name: getattr(module, name) for name in getattr(module, "__all__", ())}
    ours = {name: thing for name, thing in things.items() if inspect.isfunction(thing) or inspect.isclass(thing)}
    assert page(module)["Summary"]
    assert [name for name, thing in ours.items() if not page(thing)["Summary"]] == []


def test_tests_stand_in_the_rooms_of_gauss():
    folders = {path.parent.name for path in TESTS.glob("*/__init__.py")}
    assert folders == {*PACKAGES, "support", "validation"}


def test_the_table_of_rooms_is_whole():
    """Each room has its row, and each file that a page names is there."""
    text = (ROOT.parent / "CONTRIBUTING.md").read_text(encoding="utf-8")
    rooms = set(
        chain.from_iterable(re.findall(r"`(\w+)`", line.split("|")[1]) for line in text.splitlines() if line[:3] == "| `")
    )
    files = re.findall(r"`([\w/]+\.pyi?)`", text)
    assert set(PACKAGES) <= rooms
    assert files and [name for name in files if not any(ROOT.glob(f"**/{name}"))] == []
