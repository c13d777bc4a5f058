"""One version in the package, the changelog and the citation; former names that say when they go."""

import re
import warnings
from pathlib import Path

import pytest

import gauss
from gauss import linkages, rotors, servo
from gauss.versions import REMOVAL, VERSION

ROOT = Path(gauss.__file__).parent.parent
SECTION = re.compile(r"^## \[(\d+\.\d+\.\d+)\] - (\d{4}-\d{2}-\d{2})$", re.MULTILINE)
FORMER = [(module, name) for module in (gauss, linkages, rotors, servo) for name in module.RENAMED]


def numbers(version: str) -> tuple[int, ...]:
    """Parts of a version, to be compared."""
    return tuple(int(part) for part in version.split("."))


def test_the_newest_section_is_this_version():
    sections = SECTION.findall((ROOT / "CHANGELOG.md").read_text(encoding="utf-8"))
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert sections[0] == (VERSION, re.findall(r"^date-released: (.*)$", citation, re.MULTILINE)[0])
    assert re.findall(r"^version: (.*)$", citation, re.MULTILINE) == [VERSION] == [gauss.__version__]
    assert sections == sorted(sections, key=lambda section: numbers(section[0]), reverse=True)


def test_former_names_are_gone_in_the_version_that_they_name():
    assert numbers(VERSION) < numbers(REMOVAL)


@pytest.mark.parametrize(("module", "name"), FORMER, ids=[f"{module.__name__}.{name}" for module, name in FORMER])
def test_former_names_work_and_name_that_version(module, name):
    with pytest.warns(DeprecationWarning, match=re.escape(REMOVAL)) as caught:
        value = getattr(module, name)
    assert [Path(one.filename) for one in caught] == [Path(__file__)]  # the caller's line, not one of gauss
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert value is getattr(module, module.RENAMED[name])
