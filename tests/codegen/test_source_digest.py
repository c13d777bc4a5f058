"""What outer packages hold enters no key of code but where something of theirs does, and inner ones use nothing of them."""

import re
import tomllib
from functools import partial
from importlib import import_module
from pathlib import Path

import pytest

from gauss.codegen import content_digest
from gauss.codegen.source_digest import FOLDER, INNER, is_outer, reaches_outer
from gauss.io.catalog import shipped
from gauss.scene import Scene
from gauss.simulation import simulate

NAMED = re.compile(r"[\"']gauss\.(\w+)")  # a module, as of those that are imported when they are first needed
FIGURES = {("simulation/trajectory.py", "view")}  # of a trajectory: they make no machine code
OUTER = {path.stem for path in FOLDER.iterdir() if path.suffix in ("", ".py")} - INNER
digests = import_module("gauss.codegen.content_digest")


def test_inner_packages_are_those_that_import_no_outer_one():
    contracts = tomllib.loads((FOLDER.parent / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
    layers = next(contract["layers"] for contract in contracts if contract["name"] == "arrows point down")
    inwards = layers[layers.index("simulation") :]
    assert {name.strip() for layer in inwards for name in layer.split("|")} == INNER


def test_inner_sources_name_no_outer_module():
    """The import contract knows no module that is imported by its name."""
    sources = {path.relative_to(FOLDER): path.read_text("utf-8") for path in FOLDER.rglob("*.py")}
    inner = {path: text for path, text in sources.items() if path.parts[0].partition(".")[0] in INNER}
    named = {(path.as_posix(), name) for path, text in inner.items() for name in NAMED.findall(text) if name in OUTER}
    assert named <= FIGURES and len(sources) > len(inner) > len(INNER)


def closing(thing):
    return lambda: thing


@pytest.mark.parametrize("thing, outer", [(shipped, True), (Path, False), (simulate, False), (Scene, False), (INNER, False)])
def test_sources_of_outer_packages_are_in_the_content_of_their_things_alone(thing, outer, monkeypatch):
    found = []
    for content in (b"one", b"another"):
        monkeypatch.setattr(digests, "source_digest", lambda outer, content=content: content if outer else None)
        found += [content_digest((thing, 1.0)), content_digest(frozenset({thing}) if thing is not INNER else {1.0})]
    known = None not in found
    assert known == (thing is not Path) and (not known or (found[:2] != found[2:]) == outer)
    monkeypatch.setattr(digests, "source_digest", lambda outer: None)
    assert content_digest(thing) is None or not outer


@pytest.mark.parametrize("function", [shipped, partial(shipped), closing(shipped), partial(simulate, shipped), Path.exists])
def test_what_a_maker_closes_over_is_looked_at(function):
    def make():
        return function, make

    assert reaches_outer(make) == (function is not Path.exists)
    assert not reaches_outer(lambda: simulate)


@pytest.mark.parametrize("name, outer", [("gauss.io.load", True), ("gauss", True), ("gauss.math", False), ("numpy", False)])
def test_modules_have_their_side(name, outer):
    assert is_outer(name) == outer
