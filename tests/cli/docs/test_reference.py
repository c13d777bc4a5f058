"""The reference has every public name once, and examples of those that one types."""

from importlib import import_module

import pytest

import gauss
from gauss.cli.docs import generated, reference
from gauss.cli.docs.groups import GROUPS
from gauss.cli.docs.uses import names_in, uses
from gauss.dynamics.plan import MOTIONS
from tests.cli.docs.test_doctests import EXAMPLES

ABSENT = (
    "torch_",
    "jax_",
)  # functions of libraries that the pages cannot count on: an example of the docstring stands for them

GROUPED = [name for group in GROUPS for name in group.names]
PACKAGES = (
    "gauss",
    "gauss.math",
    "gauss.linkages",
    "gauss.rotors",
    "gauss.servo",
    "gauss.view",
    "gauss.view.viewer",
    "gauss.export",
    "gauss.gym",
)


def test_every_public_name_is_in_one_group():
    assert len(GROUPED) == len(set(GROUPED))
    things = {id(reference.thing_of(name)) for name in GROUPED}
    for package in PACKAGES:
        module = import_module(package)
        missing = [name for name in module.__all__ if id(getattr(module, name)) not in things]
        assert missing == [], package


def test_every_name_of_gauss_is_used_by_a_page_or_an_example():
    used = uses()
    typed = [name for name in gauss.__all__ if not name.startswith(ABSENT)]
    assert [name for name in typed if f"gauss.{name}" not in used] == []


@pytest.mark.slow
def test_every_public_name_has_an_example():
    used = uses()
    assert [name for name in GROUPED if name not in used and name not in EXAMPLES] == []


def test_names_are_found_in_code():
    code = "import gauss\nfrom gauss.rotors import Dry\nfrom gauss import servo\n"
    code += "gauss.simulate(x)\nservo.Motor('m', 'q')\nDry(3.0)"
    assert {"gauss.simulate", "gauss.Trajectory", "gauss.rotors.Dry", "gauss.servo.Motor"} <= names_in(code)


def test_pages_of_the_reference_name_what_they_document():
    pages = reference.pages()
    for name in GROUPED:
        assert f":: {name}" in pages[f"reference/names/{name}.rst"], name


def test_the_table_of_plans_has_a_row_for_every_rule():
    tables = generated.plan_tables()
    for number, rule in enumerate(MOTIONS.rules, 1):
        assert f"| {number} | {rule.driver} | {rule.dynamics} | " in tables
