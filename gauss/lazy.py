"""Names of a package that are imported when they are first asked for (PEP 562).

The stub ``__init__.pyi`` of such a package holds its imports and ``__all__`` as a type checker reads them: one list for
both, after SPEC 1 of Scientific Python (``lazy_loader.attach_stub``).
"""

import re
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from importlib import import_module
from types import ModuleType
from typing import TypeVar

LOADED_AT = time.time_ns()  # time at which the sources of this process were as it has loaded them [ns]
IMPORT = re.compile(r"^ *from (\S+) import (?:\(([^)]*)\)|(.*))$", re.MULTILINE)
PUBLIC = re.compile(r"^__all__ = \[([^]]*)\]", re.MULTILINE)
Source = TypeVar("Source")
Value = TypeVar("Value")


class LazyPackage(ModuleType):
    """Package in which a function takes precedence over the module that has its name, e.g. ``gauss.backends.solve``."""

    def __setattr__(self, name: str, value):
        """Set an attribute; where the import system sets a module of a public name, set what the module defines."""
        if isinstance(value, ModuleType) and name in self.__all__ and value.__name__ == f"{self.__name__}.{name}":
            value = getattr(value, name, value)
        super().__setattr__(name, value)

    def __reduce__(self) -> tuple:
        """Import it: a function that is sent to another process with its globals names the package."""
        return import_module, (self.__name__,)


def attach(package: str, file: str) -> tuple[list[str], Callable, Callable]:
    """Values of ``__all__``, ``__getattr__`` and ``__dir__`` of a package, from the stub beside its ``__init__.py``.

    Parameters
    ----------
    package : str
        ``__name__`` of the package.
    file : str
        Its ``__file__``.
    """
    with open(f"{file.removesuffix('c')}i", encoding="utf-8") as stub:  # of .py and of .pyc
        text = stub.read()
    sources = {name: module for module, names in _imports(text) for name in names}
    public = re.findall(r'"(\w+)"', "".join(PUBLIC.findall(text)))

    def getattribute(name: str):
        if name not in sources:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        if sources[name] == package:
            return import_module(f"{package}.{name}")
        value = getattr(import_module(sources[name]), name)
        setattr(sys.modules[package], name, value)
        return value

    def names() -> list[str]:
        return sorted({*vars(sys.modules[package]), *sources})

    sys.modules[package].__class__ = LazyPackage
    return public, getattribute, names


class LazyTable(Mapping[str, Value]):
    """Table whose values are found, and the modules of which are imported, when they are first asked for.

    Parameters
    ----------
    sources : dict
        Source of each value, by name.
    find : function
        Value of a source.
    """

    def __init__(self, sources: dict[str, Source], find: Callable[[Source], Value]):
        self._sources, self._find = sources, find
        self._found: dict[str, Value] = {}

    def __getitem__(self, name: str) -> Value:
        if name not in self._found:
            self._found[name] = self._find(self._sources[name])
        return self._found[name]

    def __contains__(self, name: object) -> bool:
        return name in self._sources

    def __iter__(self) -> Iterator[str]:
        return iter(self._sources)

    def __len__(self) -> int:
        return len(self._sources)


def _imports(stub: str) -> list[tuple[str, list[str]]]:
    """Modules that a stub imports from, and the names it takes from each."""
    return [(module, re.findall(r"(\w+)(?: as \w+)?", several or one)) for module, several, one in IMPORT.findall(stub)]
