"""The house itself: public names with pages of numpydoc's form, tests in the rooms of gauss."""

import inspect
import warnings
from importlib import import_module
from pathlib import Path

import pytest
from numpydoc.docscrape import NumpyDocString

import gauss

ROOT = Path(gauss.__file__).parent
TESTS = Path(__file__).parent
PACKAGES = sorted(path.parent.name for path in ROOT.glob("*/__init__.py"))


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
