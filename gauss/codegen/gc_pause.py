"""Rare garbage collection while code is traced: graphs hold no garbage, and each full collection would scan them all."""

import gc
from contextlib import contextmanager
from threading import Lock

GC_THRESHOLD = 200_000  # allocations between collections: a few thousand traced operations
LEAST_FROZEN = 5_000  # young objects that are not looked at once: a collection of so many takes a millisecond

_lock = Lock()
_before: list[tuple[int, ...]] = []  # threshold at each entry; the first one is restored at the end
_large: list[int] = []  # allocations of the first pause with many


@contextmanager
def gc_pause():
    """Raise the threshold of the garbage collector within this context, in all threads.

    If a collection is due at its end, only what was allocated within is looked at: the next allocation would begin one of
    all generations, which scans all that was imported and takes as long as a short motion. After the first code of a
    process nothing is looked at: what was allocated joins the old objects, like the imports, until the next full collection.
    """
    with _lock:
        _before.append(gc.get_threshold())
        first, *others = _before[0]
        gc.set_threshold(max(first, GC_THRESHOLD) if first else 0, *others)
    try:
        yield
    finally:
        with _lock:
            if len(_before) == 1:
                if gc.isenabled() and 0 < _before[0][0] < gc.get_count()[0]:
                    _clear_youngest()
                gc.set_threshold(*_before[0])
            _before.pop()


def _clear_youngest():
    """Leave no young objects: those of the first code of a process grow old as they are, later ones are collected.

    Frozen objects of the caller would thaw: where there are any, all are collected.
    """
    count = gc.get_count()[0]
    if count < LEAST_FROZEN or _large or gc.get_freeze_count():
        gc.collect(0)
        return
    _large.append(count)
    gc.freeze()
    gc.unfreeze()
