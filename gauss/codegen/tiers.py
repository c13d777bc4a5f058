"""Tiers of machine code: quick code at once, optimised code when a background thread has made it.

A run (a motion, a batch) keeps one tier: optimised code that is offered while it is in progress is taken by the runs that
begin later. Each run and each offer has a number of one sequence; a run takes an offer with a smaller number than its own.
Calls outside runs take an offer at once. When no run with a smaller number is in progress, the functions of the quick code
are replaced, and choosing costs nothing from then on.

Environment variable: ``GAUSS_TIER`` is ``auto`` (default), ``optimised`` (compiled before the first call) or ``quick``
(never optimised).
"""

import os
import weakref
from collections.abc import Callable
from contextlib import ContextDecorator
from contextvars import ContextVar, Token
from itertools import count
from threading import Lock
from typing import TYPE_CHECKING, Protocol

from gauss.errors import ArgumentError, did_you_mean

if TYPE_CHECKING:
    import llvmlite.binding as llvm

AUTO, QUICK, OPTIMISED = "auto", "quick", "optimised"
TIERS = AUTO, QUICK, OPTIMISED
VARIABLE = "GAUSS_TIER"

_sequence = count(1)
_lock = Lock()
_running: set["Run"] = set()  # runs in progress
_offered: list["MachineCode"] = []  # codes with an offer that some run in progress does not take
_current: ContextVar["Run | None"] = ContextVar("current run", default=None)


def wanted() -> str:
    """Tier of code that is made now: that of the run in progress, else that of the environment.

    ArgumentError if the environment names another tier.
    """
    run = _current.get()
    return run.tier if run is not None and run.tier != AUTO else checked(os.environ.get(VARIABLE) or AUTO, VARIABLE)


def checked(tier: str, what: str) -> str:
    """The tier, if it is one.

    Raises
    ------
    ArgumentError
        If it is none.
    """
    if tier not in TIERS:
        raise ArgumentError(f"{what}: no tier {tier!r}. {did_you_mean(tier, TIERS)}")
    return tier


class Run(ContextDecorator):
    """Context of a run, in which no code changes its tier; inside another run it is part of that.

    Parameters
    ----------
    tier : str
        Tier of the code that is made in it; "auto" means that of the environment.
    shown : bool
        Whether its progress may be shown.

    Attributes
    ----------
    number : int
        Its number in the sequence of runs and offers.
    is_quick : bool
        Whether quick code ran in it.
    """

    def __init__(self, tier: str = AUTO, shown: bool = True):
        self.tier, self.shown, self.number, self.is_quick = tier, shown, 0, False
        self._token: Token | None = None

    def _recreate_cm(self) -> "Run":
        return Run(self.tier, self.shown)  # a decorated function makes one run for each call

    def __enter__(self) -> "Run":
        outer = _current.get()
        if outer is not None:
            return outer
        _running.add(self)
        self.number = next(_sequence)  # after that: an offer that has not seen this run has a smaller number
        self._token = _current.set(self)
        return self

    @staticmethod
    def current() -> "Run | None":
        """Run in progress, if there is one."""
        return _current.get()

    @property
    def ran(self) -> str:
        """Tier of the slowest code so far."""
        return QUICK if self.is_quick else OPTIMISED

    def __exit__(self, *_):
        if self._token is not None:
            _current.reset(self._token)
            _running.discard(self)
            if _offered:
                _connect_offered()


def _connect_offered():
    """Let users take the offers that all runs in progress take."""
    with _lock:
        oldest = min([run.number for run in list(_running)], default=next(_sequence))
        for code in [code for code in _offered if code.offer < oldest]:
            _offered.remove(code)
            code.connect_users()


class CodeUser(Protocol):
    """Object with addresses of functions."""

    def connect(self, engine: "llvm.ExecutionEngine") -> None:
        """Use optimised code from now on."""


class MachineCode:
    """Machine code of one module; its lifetime is that of this object.

    Parameters
    ----------
    key : str
        Name of its object code in :mod:`gauss.codegen.object_cache`.
    engine : llvmlite.binding.ExecutionEngine
        Owner of the code.
    tier : str
        "quick" or "optimised".
    source : (bytes, int), optional
        Module of quick code, compressed, and how to optimise it.

    Attributes
    ----------
    tier : str
        "optimised" once optimised code is there.
    offer : int
        Number of the offer of optimised code; 0 without one.
    """

    def __init__(self, key: str, engine: "llvm.ExecutionEngine", tier: str, source: tuple[bytes, int] | None = None):
        self.key, self.tier, self.source, self.offer = key, tier, source, 0
        self._engines = [engine]  # the quick one stays: calls in progress may be in it
        self._users: weakref.WeakSet[CodeUser] = weakref.WeakSet()
        self.is_last = tier == OPTIMISED  # whether users are connected to the last engine

    def address(self, name: str) -> int:
        """Address of a function, in the newest code."""
        return self._engines[-1].get_function_address(name)

    def first_address(self, name: str) -> int:
        """Address of a function, in the code that came first."""
        return self._engines[0].get_function_address(name)

    def entry(self, name: str, signature: Callable) -> "EntryPoint":
        """Function of this code; ``signature`` is a function type of ctypes."""
        found = EntryPoint(self, name, signature)
        self.add_user(found)
        return found

    def add_user(self, user: CodeUser):
        """Connect a user to optimised code, now or once runs take it."""
        with _lock:
            self._users.add(user)
            if self.is_last:
                user.connect(self._engines[-1])

    def offer_optimised(self, engine: "llvm.ExecutionEngine"):
        """Offer optimised code to later runs, and to calls outside runs."""
        with _lock:
            self._engines.append(engine)
            self.tier, self.source, self.offer = OPTIMISED, None, next(_sequence)
            if _running:
                _offered.append(self)
            else:
                self.connect_users()

    def connect_users(self):
        """Let all users take the newest code, under the lock."""
        self.is_last = True
        for user in self._users:
            user.connect(self._engines[-1])


class EntryPoint:
    """Function of machine code, called through ctypes.

    Parameters
    ----------
    code : MachineCode
        The code, kept alive.
    name : str
        Name of the function.
    signature : callable
        Function type of ctypes.
    """

    def __init__(self, code: MachineCode, name: str, signature: Callable):
        self.code, self._name, self._signature = code, name, signature
        self._first = signature(code.first_address(name))

    def call(self, *args):
        """Call the function, in the tier of the run in progress."""
        run, offer = _current.get(), self.code.offer
        if offer and (run is None or run.number > offer):
            return self._signature(self.code.address(self._name))(*args)
        if run is not None:
            run.is_quick = True
        return self._first(*args)

    def address(self) -> int:
        """Address of the function in the tier of the run in progress."""
        run, offer = _current.get(), self.code.offer
        if self.code.is_last or (offer and (run is None or run.number > offer)):
            return self.code.address(self._name)
        if run is not None:
            run.is_quick = True
        return self.code.first_address(self._name)

    def connect(self, engine: "llvm.ExecutionEngine"):
        """Call the function of optimised code directly from now on."""
        address = engine.get_function_address(self._name)
        self.call = self._signature(address)  # type: ignore[method-assign]  # no choice is left: one call less


def reset_after_fork():
    """Forget the runs of threads that a fork leaves behind."""
    global _lock
    _lock = Lock()
    run = _current.get()
    _running.intersection_update(() if run is None else (run,))
