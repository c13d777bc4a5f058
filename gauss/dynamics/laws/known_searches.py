"""Searches of opaque laws for jumps: while a law, the interval and the start are the same, one is not repeated.

A law is the same if its code, what it closes over, its attributes, defaults and globals have the content of before
(:func:`gauss.codegen.content_digest`), and its values at a few times are those of before. A law whose content is not
known, such as one that calls a function of another library, is searched for every motion.
"""

from collections.abc import Callable, Hashable
from typing import NamedTuple

import numpy as np

from gauss.codegen import content_digest
from gauss.dynamics.laws.switching_times import APART, Timetable
from gauss.system import State

COMPARED = 16  # times of a known search at which a law is called again: enough to tell one that is random
MOST_SIDES = 64  # switching times on both sides of which it is called, too
MOST_PARTS = 4_000  # of the content of a law: to compare more takes as long as the search

Values = Callable[[np.ndarray], np.ndarray]  # times (k,) → values (k, n) of a law


class Search(NamedTuple):
    """Result of a search."""

    key: Hashable  # law, interval and start
    times: np.ndarray  # (k,) times of comparison [s]
    values: np.ndarray  # (k, n) values of the law there
    found: Timetable  # what was found


class KnownSearch:
    """Last search of one law.

    ``takes_motion``: whether the law takes the motion: its values then depend on the start.
    """

    def __init__(self, takes_motion: bool):
        self.takes_motion = takes_motion
        self.last: Search | None = None  # replaced as a whole: threads may share it

    def key(self, law: Callable, start: State, *others: Hashable) -> Hashable | None:
        """Key of a search by content; None if the content of the law is unknown, or large.

        ``*others``: what else the search depends on.
        """
        content = content_digest(law, most=MOST_PARTS, in_process=True)
        return content and (content, (start.q.tobytes(), start.v.tobytes()) if self.takes_motion else None, others)

    def found(
        self, key: Hashable | None, values: Values, ends: tuple[float, float], search: Callable[[], Timetable]
    ) -> Timetable:
        """What a search finds, or has found for the same law.

        ``key``: a :meth:`key`. ``values``: values (k, n) of the law at times (k,) [s]. ``ends``: begin and end of the
        interval [s]. ``search``: () → what is found.
        """
        last = self.last
        if key is None:
            return search()
        if last is not None and last.key == key and np.array_equal(values(last.times), last.values, equal_nan=True):
            return last.found
        found = search()
        times = _compared(found.switches, *ends)
        self.last = Search(key, times, values(times), found)
        return found


def _compared(switches: np.ndarray, begin: float, end: float) -> np.ndarray:
    """Times at which values tell a law, on both sides of its switching times, too."""
    apart = APART * max(abs(begin), abs(end))
    sides = [switches[:MOST_SIDES] + side for side in (-apart, apart)]
    return np.clip(np.concatenate([np.linspace(begin, end, COMPARED), *sides]), begin, end)
