"""Ctrl-C: a KeyboardInterrupt has the attribute that its caller reads, and libraries of compiled code do not swallow it."""

import signal
import threading
from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar

T = TypeVar("T", bound=Callable)


def interruption_keeps(attribute: str) -> Callable[[T], T]:
    """Decorator: a KeyboardInterrupt of the function has an attribute, None where nothing was made yet.

    Parameters
    ----------
    attribute : str
        Its name, as "trajectory".
    """

    def decorated(function: Any) -> Any:
        @wraps(function)
        def call(*arguments, **named):
            try:
                return function(*arguments, **named)
            except KeyboardInterrupt as error:
                vars(error).setdefault(attribute, None)
                raise

        return call

    return decorated


class Interruptible:
    """Context of a call of a library that may take Ctrl-C for a failure of its own: it is raised when the context ends.

    The handler of Python alone is replaced, in the main thread, where signals are handled.

    Examples
    --------
    >>> with Interruptible():
    ...     answer = solver(x)
    """

    def __init__(self):
        self.interruption: KeyboardInterrupt | None = None
        self.is_replaced = False

    def __enter__(self):
        main = threading.current_thread() is threading.main_thread()
        self.is_replaced = main and signal.getsignal(signal.SIGINT) is signal.default_int_handler
        if self.is_replaced:
            signal.signal(signal.SIGINT, self._pressed)
        return self

    def __exit__(self, kind, *_):
        if self.is_replaced:
            signal.signal(signal.SIGINT, signal.default_int_handler)
        if self.interruption is not None and kind is not KeyboardInterrupt:
            raise self.interruption from None

    def _pressed(self, number: int, frame):
        self.interruption = KeyboardInterrupt()
        raise self.interruption
