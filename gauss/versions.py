"""Versions of this package and of those it works with.

The import is ``gauss``; the distribution has another name, for ``gauss`` on the package index is a project of somebody else.
"""

from warnings import warn

VERSION = "0.1.0"
DISTRIBUTION = "gauss-dynamics"


def version_of(package: str) -> str | None:
    """Version of an installed distribution, or of this package as it was imported; None where there is none."""
    from importlib.metadata import PackageNotFoundError, version  # takes long to import

    try:
        return VERSION if package == "gauss" else version(package)
    except PackageNotFoundError:
        return None


def current_name(module: str, renamed: dict[str, str], name: str) -> str:
    """Today's name of what is asked for by a former one, with a DeprecationWarning.

    Parameters
    ----------
    module : str
        Full name of the module that is asked.
    renamed : dict
        Former names, and those of today.
    name : str
        The name.

    Raises
    ------
    AttributeError
        If it is no former name.
    """
    if name not in renamed:
        raise AttributeError(f"module {module!r} has no attribute {name!r}")
    warn(f"{module}.{name} is called {module}.{renamed[name]} now.", DeprecationWarning, stacklevel=3)
    return renamed[name]


class FormerAttribute:
    """Former name of an attribute: its value, with a DeprecationWarning.

    Parameters
    ----------
    current : str
        Name of the attribute today.
    """

    def __init__(self, current: str):
        self.current = current

    def __set_name__(self, owner: type, name: str):
        """Keep the former name."""
        self.former = f"{owner.__name__}.{name}"

    def __get__(self, instance, owner: type):
        """Value of the attribute by its name of today."""
        if instance is None:
            return self
        warn(f"{self.former} is called {owner.__name__}.{self.current} now.", DeprecationWarning, stacklevel=2)
        return getattr(instance, self.current)
