"""A QP solver with a problem in the form that it takes: nothing but its call is under the clock."""

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from typing import Any

from gauss.backends.programme import Outcome
from gauss.bench import clocks


@dataclass(frozen=True)
class Ready:
    """A QP solver with a problem in the form that it takes."""

    call: Callable[[], Any]  # set-up and solve from nothing; what the clock runs
    # read: ``read(found)`` turns what the call returned into an :class:`gauss.backends.programme.Outcome`
    read: Callable[[Any], Outcome]
    # library: ``library(found)`` returns the times of set-up, solve, and both [s] that the library itself reports; nan where
    # it reports none
    library: Callable[[Any], clocks.Times] = lambda found: clocks.UNKNOWN
    around: AbstractContextManager = nullcontext()  # what holds while the solver is called
