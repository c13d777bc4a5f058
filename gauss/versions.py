"""Versions of this package and of those it works with.

The import is ``gauss``; the distribution has another name, for ``gauss`` on the package index is a project of somebody else.
"""

import re
from warnings import warn

VERSION = "0.2.2"
REMOVAL = "0.3.0"  # in which the former names of this version go: they work for one minor version
DISTRIBUTION = "gauss-dynamics"
REQUIREMENT = re.compile(r"[\w.-]+")  # name of the distribution in a line of requirements


def version_of(package: str) -> str | None:
    """Version of an installed distribution, or of this package as it was imported; None where there is none."""
    from importlib.metadata import PackageNotFoundError, version  # takes long to import

    try:
        return VERSION if package == "gauss" else version(package)
    except PackageNotFoundError:
        return None


def absent_packages(extra: str) -> list[str]:
    """Distributions of an extra of this package that are not installed; none where it runs uninstalled itself."""
    from importlib.metadata import PackageNotFoundError, requires

    try:
        wanted = requires(DISTRIBUTION) or []
    except PackageNotFoundError:
        return []
    names = [REQUIREMENT.match(line) for line in wanted if re.search(rf"""extra == ['"]{extra}['"]""", line)]
    return [name[0] for name in names if name and version_of(name[0]) is None]


def warn_of_former_name(former: str, current: str, stacklevel: int = 2) -> None:
    """Say what a former name is called now, and when it goes, by a DeprecationWarning.

    ``stacklevel``: as of ``warnings.warn``, counted from the caller.
    """
    text = f"{former} is called {current} now; the former name goes in version {REMOVAL}."
    warn(text, DeprecationWarning, stacklevel=stacklevel + 1)


def current_name(module: str, renamed: dict[str, str], name: str) -> str:
    """Today's name of what a module is asked for by a former one, with a DeprecationWarning.

    AttributeError if it is no former name.
    """
    if name not in renamed:
        raise AttributeError(f"module {module!r} has no attribute {name!r}")
    warn_of_former_name(f"{module}.{name}", f"{module}.{renamed[name]}", stacklevel=3)
    return renamed[name]


class FormerAttribute:
    """Former name of an attribute: its value, by its name of today, with a DeprecationWarning."""

    def __init__(self, current: str):
        self.current = current

    def __set_name__(self, owner: type, name: str):
        """Keep the former name."""
        self.former = f"{owner.__name__}.{name}"

    def __get__(self, instance, owner: type):
        """Value of the attribute by its name of today."""
        if instance is None:
            return self
        warn_of_former_name(self.former, f"{owner.__name__}.{self.current}")
        return getattr(instance, self.current)
