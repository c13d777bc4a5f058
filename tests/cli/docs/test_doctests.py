"""Examples of docstrings run, and say what they say."""

import doctest
import warnings
from importlib import import_module

import pytest

from gauss.cli.docs import reference
from gauss.cli.docs.groups import GROUPS

pytestmark = [pytest.mark.slow, pytest.mark.disk]  # of what enters machine code nothing is replaced

NEEDS = {"gauss.gym": "gymnasium", "gauss.view": "viser", "gauss.export.to_sympy": "sympy", "gauss.export.Formulas": "sympy"}
NEEDS |= {"gauss.export.latex_document": "sympy", "gauss.export.to_casadi": "casadi", "gauss.export.to_jax": "jax"}
NEEDS |= {"gauss.jax_": "jax", "gauss.torch_": "torch"}
FINDER = doctest.DocTestFinder(recurse=True)


def _examples() -> dict[str, list[doctest.DocTest]]:
    """Examples of public names, and of their methods, by name."""
    names = dict.fromkeys(name for group in GROUPS for name in group.names)
    own = {
        name: thing
        for name in names
        if (getattr(thing := reference.thing_of(name), "__module__", "") or "").startswith("gauss")
    }
    found = {name: FINDER.find(thing, name, module=import_module(thing.__module__)) for name, thing in own.items()}
    return {name: tests for name, tests in found.items() if any(test.examples for test in tests)}


EXAMPLES = _examples()


@pytest.mark.parametrize("name", EXAMPLES)
def test_examples_of_docstrings(name, tmp_path, monkeypatch):
    for start, package in NEEDS.items():
        if name.startswith(start):
            pytest.importorskip(package)
    monkeypatch.chdir(tmp_path)
    runner, said = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS), []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        for test in EXAMPLES[name]:
            test.globs = {"__name__": "example"}  # as one who types them, without the names of the module
            runner.run(test, out=said.append)
    assert runner.failures == 0, "".join(said)
