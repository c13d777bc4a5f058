"""Rare garbage collection while code is traced: graphs hold no garbage, and each full collection would scan them all."""

import gc
from contextlib import contextmanager
from threading import Lock

GC_THRESHOLD = 200_000  # allocations between collections: a few thousand traced operations

_lock = Lock()
_before: list[tuple[int, ...]] = []  # threshold at each entry; the first one is restored at the end


@contextmanager
def gc_pause():
    """Raise the threshold of the garbage collector within this context, in all threads.

    If a collection is due at its end, only what was allocated within is looked at: the next allocation would begin one of
    all generations, which scans all that was imported and takes as long as a short motion.
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
                    gc.collect(0)
                gc.set_threshold(*_before[0])
            _before.pop()
