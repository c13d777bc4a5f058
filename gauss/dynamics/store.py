"""What is made once and kept: machine code, plans, starts of one system."""

from collections.abc import Callable, Hashable
from threading import Lock, RLock
from typing import TypeVar

from gauss.tracing import growing

T = TypeVar("T")
Key = tuple[Callable, *tuple[Hashable, ...]]  # what makes a thing, and the content of what it makes it from


class Store:
    """Things by what made them."""

    def __init__(self):
        self._made: dict[Key, object] = {}
        self._being_made: dict[Key, RLock] = {}
        self._lock = Lock()

    def on_demand(self, key: Key, make: Callable[[], T]) -> T:
        """What is kept under a key, made when it is first asked for: by one thread, while others that ask for it wait.

        Parameters
        ----------
        key : tuple
            First the class or function that the thing comes from, then all that it depends on beside the system: what
            somebody chose by its content (:func:`gauss.tracing.content`), for a name may be given twice.
        make : callable
            () → the thing.
        """
        if key not in self._made:
            with self._lock:
                being_made = self._being_made.setdefault(key, RLock())
            with being_made:  # one for each key: what is made may ask for others on its way
                if key not in self._made:
                    with growing():
                        self._made[key] = make()
                    self._being_made.pop(key, None)
        return self._made[key]
