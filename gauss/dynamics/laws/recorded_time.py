"""Whether an opaque law reads the time: it is called with a number that records its uses.

A law that does not read the time at a state has one value there at all times.
"""

from collections.abc import Callable
from sys import getrefcount

from gauss.dynamics.kinematics import FOUND, Kinematics
from gauss.scene.stateful_laws import preserved
from gauss.system import State

BARE = {"__new__", "__getattribute__"}  # methods of a float that say nothing of its value


class RecordedTime:
    """Time that behaves as the number it is, and records whether it was read.

    Attributes: ``is_read``: whether its value, its text or its type was asked for.
    """

    __slots__ = "is_read", "value"

    def __init__(self, t: float):
        self.value, self.is_read = t, False

    @property  # type: ignore[misc]  # asked for by isinstance
    def __class__(self) -> type:
        self.is_read = True
        return float

    def __getattr__(self, name: str):
        self.is_read = True
        return getattr(self.value, name)


def _recorded(name: str) -> Callable:
    """Method of a float that records its call."""

    def method(self: RecordedTime, *arguments):
        self.is_read = True
        return getattr(self.value, name)(*arguments)

    return method


for _name, _method in vars(float).items():
    if callable(_method) and _name not in BARE:
        setattr(RecordedTime, _name, _recorded(_name))


def reads_time(law: Callable, motion: Kinematics) -> tuple[bool, bool]:
    """Whether a law reads its first argument, and the time of its second one, at a state.

    A law that keeps one of them, or returns it, or raises an exception, reads it.

    ``law``: of (t, motion).
    """
    own, of_motion = RecordedTime(motion.state.t), RecordedTime(motion.state.t)
    given = KinematicsAtTime(motion, of_motion)
    of_motion.is_read = False  # a checker of types may have asked for it
    first, second = _reads(law, (own, given), (own, of_motion))
    return first, second


def reads_first(law: Callable, t: float, *others) -> bool:
    """Whether a law of (t, ...) reads its first argument at a time [s] and other arguments; see :func:`reads_time`."""
    own = RecordedTime(t)
    return _reads(law, (own, *others), (own,))[0]


def _reads(law: Callable, given: tuple, recorded: tuple[RecordedTime, ...]) -> list[bool]:
    unread = list(map(getrefcount, recorded))
    try:
        with preserved(law):
            value = law(*given)  # it may be the time itself
            read = list(map(getrefcount, recorded))
            del value
    except Exception:  # whatever it does with the time
        return [True] * len(recorded)
    return [t.is_read or after > before for t, after, before in zip(recorded, read, unread, strict=True)]


class KinematicsAtTime(Kinematics):
    """Kinematics of the same coordinates and rates at another time: poses are those of the other one."""

    def __init__(self, motion: Kinematics, t):
        self.system, self.state, self._other = motion.system, State(t, motion.state.q, motion.state.v), motion

    def __getattr__(self, name: str):
        if name not in FOUND:
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
        return getattr(self._other, name)
