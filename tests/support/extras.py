"""What an extra of gauss installs, as ``pyproject.toml`` says, and the packages of the other extras."""

import re
import tomllib
from importlib.metadata import PackageNotFoundError, packages_distributions, requires
from pathlib import Path

from gauss.versions import DISTRIBUTION

PROJECT = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text())["project"]
LINE = re.compile(r"([\w.-]+)(?:\[([\w,-]+)\])?")  # distribution and its extras in a line of requirements
Named = tuple[str, tuple[str, ...]]  # a distribution and some of its extras
OF_EXTRA = re.compile(r"""extra == ['"]([\w-]+)['"]""")


def others(extra: str) -> set[str]:
    """Modules of installed distributions that other extras name, and that do not come with this one."""
    named = {_named(line)[0] for key, lines in PROJECT["optional-dependencies"].items() if key != "dev" for line in lines}
    foreign = named - _closure(extra)
    return {
        module for module, owners in packages_distributions().items() if {_named(owner)[0] for owner in owners} <= foreign
    }


def _closure(extra: str) -> set[str]:
    """Distributions that come with an extra."""
    found: set[Named] = set()
    todo: list[Named] = [(DISTRIBUTION, (extra,))]
    while todo:
        entry = todo.pop()
        if entry not in found:
            found.add(entry)
            todo += [_named(line) for line in _lines(*entry)]
    return {name for name, _ in found}


def _named(line: str) -> Named:
    name, extras = LINE.findall(line)[0]
    return re.sub(r"[-_.]+", "-", name).lower(), tuple(extras.split(",")) if extras else ()


def _lines(name: str, extras: tuple[str, ...]) -> list[str]:
    """Requirements of a distribution with some extras; of gauss as its sources say."""
    if name == DISTRIBUTION:
        return PROJECT["dependencies"] + [line for extra in extras for line in PROJECT["optional-dependencies"][extra]]
    try:
        lines = requires(name) or []
    except PackageNotFoundError:  # of another platform
        return []
    wanted = ((line, OF_EXTRA.search(line)) for line in lines)
    return [line for line, key in wanted if key is None or key[1] in extras]
