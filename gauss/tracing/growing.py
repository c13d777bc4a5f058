"""While graphs and machine code are written down, hardly anything of them is garbage."""

import gc
from contextlib import contextmanager

SELDOM = 200_000  # new objects after which Python looks for garbage: a few thousand operations written down


@contextmanager
def growing():
    """Let Python look for garbage seldom: it would go through all that has been written again and again."""
    before = gc.get_threshold()
    gc.set_threshold(max(before[0], SELDOM) if before[0] else 0, *before[1:])
    try:
        yield
    finally:
        gc.set_threshold(*before)
