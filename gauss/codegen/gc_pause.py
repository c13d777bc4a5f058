"""While graphs and machine code are written down, hardly anything of them is garbage."""

import gc
from contextlib import contextmanager
from threading import Lock

SELDOM = 200_000  # new objects after which Python looks for garbage: a few thousand operations written down

_lock, _before = Lock(), []  # the threshold found by each that is at it: the first one found is the one to go back to


@contextmanager
def growing():
    """Let Python look for garbage seldom: it would go through all that has been written again and again."""
    with _lock:
        _before.append(gc.get_threshold())
        first, *others = _before[0]
        gc.set_threshold(max(first, SELDOM) if first else 0, *others)
    try:
        yield
    finally:
        with _lock:
            if len(_before) == 1:
                gc.set_threshold(*_before[0])
            _before.pop()
