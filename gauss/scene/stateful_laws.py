"""Stateful laws, such as integrating controllers: detection of their state, and its preservation over extra calls.

The state of a law is in its attributes, those of the object of a method and of objects in its closure, its defaults and its
closure, and in lists and dicts there. Calls that are no part of the motion, such as tracing, restore it.
"""

from collections.abc import Iterator
from contextlib import contextmanager

LIBRARIES = ("builtins", "gauss", "numpy", "scipy")  # whose objects keep no state of a law


class PreservedState:
    """Copy of the state of a law; ``changed`` says whether calls had changed the state when it was restored."""

    def __init__(self, law):
        laws = _called(law)
        owners = [owner for one in laws for owner in (*_owners(one), *_held(one))]
        self.cells = [(cell, _content(cell)) for one in laws for cell in getattr(one, "__closure__", None) or ()]
        values = [value for owner in owners for value in owner.values()] + [content for _, content in self.cells]
        containers = _containers(values + [value for one in laws for value in _defaults(one)])
        self.containers = [(one, one.copy()) for one in (*owners, *containers)]
        self.changed = False

    def differs(self) -> bool:
        """Whether the state is another one now."""
        same = all(_same(one, before) for one, before in self.containers)
        return not same or any(_content(cell) is not before for cell, before in self.cells)

    def restore(self):
        """Restore the state of the law."""
        for one, before in self.containers:
            if _same(one, before):
                continue
            self.changed = True
            one.clear()
            one.update(before) if isinstance(one, dict) else one.extend(before)
        for cell, before in self.cells:
            if _content(cell) is not before:
                self.changed, cell.cell_contents = True, before


@contextmanager
def preserved(law) -> Iterator[PreservedState]:
    """Context that restores the state of a law; its value is whether there was a change."""
    kept = PreservedState(law)
    try:
        yield kept
    finally:
        kept.restore()


def _called(law) -> list:
    """A law, and the callables in its closure."""
    found: list = []
    waiting = [law]
    while waiting:
        one = waiting.pop()
        if callable(one) and not any(one is other for other in found):
            found.append(one)
            waiting += [_content(cell) for cell in getattr(one, "__closure__", None) or ()]
    return found


def _owners(law) -> list[dict]:
    """Attributes of a law, and of the object of a method."""
    found = [getattr(one, "__dict__", None) for one in (law, getattr(law, "__self__", None))]
    return [attributes for attributes in found if isinstance(attributes, dict)]


def _held(law) -> list[dict]:
    """Attributes of objects of the user in the closure of a law."""
    found = [_content(cell) for cell in getattr(law, "__closure__", None) or ()]
    own = [one for one in found if not isinstance(one, type) and type(one).__module__.partition(".")[0] not in LIBRARIES]
    return [one.__dict__ for one in own if isinstance(getattr(one, "__dict__", None), dict)]


def _containers(values: list) -> list:
    return [value for value in values if type(value) in (list, dict)]


def _defaults(law) -> list:
    return [*(getattr(law, "__defaults__", None) or ()), *(getattr(law, "__kwdefaults__", None) or {}).values()]


def _content(cell):
    try:
        return cell.cell_contents
    except ValueError:  # an empty cell
        return None


def _same(one, other) -> bool:
    """Whether a list or dict holds the same objects as its copy."""
    if len(one) != len(other):
        return False
    if isinstance(one, dict):
        return all(name in other and other[name] is value for name, value in one.items())
    return all(a is b for a, b in zip(one, other, strict=True))
