"""Laws that keep something from one call for the next, as a controller does that integrates: they are no functions of time.

What a law keeps is looked for in its attributes, those of the object of a method, its defaults and its closure, and in lists
and dicts there. Calls that are no part of the motion, such as those that trace a law, leave it as it was.
"""

from collections.abc import Iterator
from contextlib import contextmanager


class PreservedState:
    """What a law keeps, copied; ``changed`` tells whether calls have changed it.

    Parameters
    ----------
    law : callable
        The law.
    """

    def __init__(self, law):
        laws = _called(law)
        owners = [_attributes(one) for law in laws for one in (law, getattr(law, "__self__", None))]
        owners = [owner for owner in owners if isinstance(owner, dict)]
        self.cells = [(cell, _content(cell)) for law in laws for cell in getattr(law, "__closure__", None) or ()]
        values = [value for owner in owners for value in owner.values()] + [content for _, content in self.cells]
        for law in laws:
            values += [*(getattr(law, "__defaults__", None) or ()), *(getattr(law, "__kwdefaults__", None) or {}).values()]
        containers = [value for value in values if type(value) in (list, dict)]
        self.containers = [(one, one.copy()) for one in (*owners, *containers)]
        self.changed = False

    def restore(self):
        """Give the law back what it kept."""
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
    """Leave a law as it was; what the context gives tells whether there was anything to restore."""
    kept = PreservedState(law)
    try:
        yield kept
    finally:
        kept.restore()


def _called(law) -> list:
    """A law, and what it may call: the functions and objects in its closure."""
    found, waiting = [], [law]
    while waiting:
        one = waiting.pop()
        if callable(one) and not any(one is other for other in found):
            found.append(one)
            waiting += [_content(cell) for cell in getattr(one, "__closure__", None) or ()]
    return found


def _attributes(owner):
    return getattr(owner, "__dict__", None)


def _content(cell):
    try:
        return cell.cell_contents
    except ValueError:  # it is still empty
        return None


def _same(one, other) -> bool:
    """Whether a list or dict holds the very same things as its copy."""
    if len(one) != len(other):
        return False
    if isinstance(one, dict):
        return all(name in other and other[name] is value for name, value in one.items())
    return all(a is b for a, b in zip(one, other, strict=True))
