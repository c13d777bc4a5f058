"""Every public name says what it takes, returns and raises."""

import inspect
import re
import warnings
from importlib import import_module

import pytest
from numpydoc.docscrape import NumpyDocString

from gauss.cli.docs.groups import ROOMS

PUBLIC = (
    "gauss",
    "gauss.math",
    "gauss.linkages",
    "gauss.rotors",
    "gauss.servo",
    "gauss.simulation.sweeps",
    "gauss.view",
    "gauss.view.viewer",
)
RETURNS = re.compile(r"^ +return \S", re.M)
RAISES = re.compile(r"^ +(raise \w|require\()", re.M)


def _things(modules) -> dict:
    """Functions and classes by their full names."""
    found = {f"{module}.{name}": getattr(import_module(module), name) for module in modules for name in _all(module)}
    return {name: thing for name, thing in found.items() if inspect.isfunction(thing) or inspect.isclass(thing)}


def _all(module: str):
    return getattr(import_module(module), "__all__", ())


THINGS = _things(PUBLIC)


def _documented(doc: NumpyDocString, *sections) -> set[str]:
    entries = [entry for section in sections for entry in doc[section]]
    return {name.strip().lstrip("*") for entry in entries for name in entry.name.split(",")}


def _doc(thing) -> NumpyDocString:
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # unknown sections, sections that are there twice
        return NumpyDocString(inspect.getdoc(thing) or "")


def _taken(thing) -> set[str]:
    """Names of the arguments of a function, or of what makes an object."""
    if inspect.isclass(thing) and issubclass(thing, Exception) and "__init__" not in vars(thing):
        return set()  # what any exception takes
    return set(inspect.signature(thing).parameters)


@pytest.mark.parametrize("thing", THINGS.values(), ids=THINGS)
def test_every_parameter_is_documented_and_nothing_else(thing):
    # a class may leave what it has from a base to the page of the base
    is_class = inspect.isclass(thing)
    owners = [base for base in inspect.getmro(thing) if base.__module__.startswith("gauss")] if is_class else [thing]
    docs, taken = [_doc(owner) for owner in owners], _taken(thing)
    sections = ("Parameters", "Attributes") if is_class else ("Parameters",)
    known = set().union(*(_documented(doc, *sections) for doc in docs))
    assert taken - known == set()
    assert _documented(docs[0], "Parameters") - taken == set()


@pytest.mark.parametrize("thing", THINGS.values(), ids=THINGS)
def test_what_is_returned_and_raised_is_documented(thing):
    if not inspect.isfunction(thing):
        return
    doc, source = _doc(thing), inspect.getsource(thing)
    assert doc["Returns"] or not RETURNS.search(source)
    assert doc["Raises"] or not RAISES.search(source)


def test_every_public_name_has_a_summary():
    for module in map(import_module, (*PUBLIC, *ROOMS)):
        assert (module.__doc__ or "").strip(), module.__name__
    for name, thing in _things((*PUBLIC, *ROOMS)).items():
        assert (thing.__doc__ or "").strip(), name
