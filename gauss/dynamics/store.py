"""Cache of one system: machine code, plans, initial states."""

from collections.abc import Callable, Hashable
from functools import partial
from threading import Lock, RLock
from typing import Any, TypeVar

from gauss.codegen import content_digest, from_disk, gc_pause, is_noted, note
from gauss.system import System

T = TypeVar("T")
Key = tuple[Callable, *tuple[Hashable, ...]]  # maker of the entry, and the content that it depends on


class Store:
    """Cache entries by maker and content."""

    def __init__(self):
        self._made: dict[Key, Any] = {}
        self._being_made: dict[Key, RLock] = {}
        self._lock = Lock()

    @property
    def is_empty(self) -> bool:
        """Whether nothing was made so far."""
        return not self._made

    def on_demand(self, key: Key, make: Callable[[], T]) -> T:
        """Entry of a key, made on first request by one thread; other threads that request it wait.

        Parameters
        ----------
        key : tuple
            First the class or function that makes the entry, then all that it depends on beside the system; objects of the
            user by content (:func:`gauss.codegen.content_key`), for two of them may share a name.
        make : callable
            () → the entry.
        """
        found = self._made.get(key, self)  # the key is hashed once; no entry is the store itself
        return self._make(key, make) if found is self else found

    def _make(self, key: Key, make: Callable[[], T]) -> T:
        with self._lock:
            being_made = self._being_made.setdefault(key, RLock())
        with being_made:  # a lock for each key: making one entry may request others
            if key not in self._made:
                with gc_pause():
                    self._made[key] = make()
                self._being_made.pop(key, None)
        return self._made[key]


def cached(system: System, key: Key, make: Callable[[], T]) -> T:
    """Entry of the cache of a system; made anew for a system without one.

    Parameters
    ----------
    system : System
        The system.
    key, make
        As of :meth:`Store.on_demand`.
    """
    return system.dynamics.on_demand(key, make) if isinstance(system.dynamics, Store) else make()


def is_first_use(system: System) -> bool:
    """Whether nothing was made for a system so far."""
    return not isinstance(system.dynamics, Store) or system.dynamics.is_empty


def cached_on_disk(system: System, key: Key, make: Callable[[], T], *beside) -> T:
    """Entry of the cache of a system that a new process reads from disk, by the content of the system and the key.

    Parameters
    ----------
    key, make
        As of :meth:`Store.on_demand`; see :func:`gauss.codegen.from_disk`.
    *beside
        What else the entry depends on, where the system is a part of another.
    """
    store = system.dynamics if isinstance(system.dynamics, Store) else Store()
    return store.on_demand(key, lambda: from_disk((system, *key, *beside), make, _digest(system)))


def is_noted_on_disk(system: System, key: Key, *beside) -> bool:
    """Whether a fact about a system was noted, by this process or another one; arguments as of :func:`cached_on_disk`."""
    return is_noted((system, *key, *beside), _digest(system))


def note_on_disk(system: System, key: Key, *beside):
    """Note a fact about a system; arguments as of :func:`cached_on_disk`."""
    note((system, *key, *beside), _digest(system))


def _digest(system: System) -> bytes | None:
    return cached(system, (content_digest,), partial(content_digest, system))
