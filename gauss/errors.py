"""One tree of exceptions: a message names the thing, what was expected, what exists and what to do."""

import os
import sys
from collections.abc import Iterable
from contextlib import contextmanager
from difflib import get_close_matches
from pickle import PicklingError

import numpy as np

PACKAGE = os.path.dirname(os.path.abspath(__file__)) + os.sep


class GaussError(Exception):
    """Base of every error that gauss raises on purpose."""


class SceneError(GaussError, ValueError):
    """The scene says something impossible, incomplete or contradictory."""


class FileError(GaussError, ValueError):
    """A file cannot be read or written as what it claims to be."""


class StateError(GaussError, ValueError):
    """A state or load does not fit the system, or cannot be made consistent."""


class AssemblyError(StateError):
    """No state meets the constraints from here.

    Parameters
    ----------
    message : str
        Which constraints, by how much, and what to do.
    state : State
        The closest state that was found.
    violations : dict
        What each constraint that is not met is off by, in words, the worst first.
    """

    def __init__(self, message, state=None, violations=None):
        super().__init__(message)
        self.state = state
        self.violations = {} if violations is None else violations


class ArgumentError(GaussError, TypeError):
    """A function was called with another kind of thing than it takes."""


class BackendError(GaussError, ValueError):
    """A backend does not exist, is not installed, or does not take this problem."""


class SimulationError(GaussError, RuntimeError):
    """A simulation cannot go on; ``trajectory`` holds what was computed so far.

    Parameters
    ----------
    message : str
        What happened and what to do.
    trajectory : Trajectory, optional
        The motion up to the failure.
    """

    def __init__(self, message, trajectory=None):
        super().__init__(message)
        self.trajectory = trajectory


class LinkageError(GaussError, ValueError):
    """A linkage does not decompose into a crank and Assur groups, or does not close at some crank angle."""


class UnpicklableError(GaussError, PicklingError):
    """A scene holds a law that pickle cannot take."""


class MissingPackageError(GaussError, ImportError):
    """A package that comes with an extra of gauss is not installed."""


class NearSingularWarning(UserWarning):
    """A group of links is close to a singular position, where its reactions grow beyond all bounds."""


class NonUniqueReactionWarning(UserWarning):
    """Redundant constraints: a reaction is one of many that give the same motion."""


class NotImportedWarning(UserWarning):
    """A file holds what was not read."""


class StartWarning(UserWarning):
    """A joint starts where it cannot be, or where nobody starts who has not meant degrees."""


class InconsistentConstraintsWarning(UserWarning):
    """Redundant constraints contradict each other by no more than the noise of typed digits."""


class BalanceWarning(UserWarning):
    """The energy balance of a motion does not close: its integration is not to be trusted."""


class SwitchingWarning(UserWarning):
    """A law may have switched between two evaluations, and nothing of it shows in the motion."""


class CacheWarning(UserWarning):
    """The cache of machine code is not used, for others could have written to it."""


class PainleveWarning(UserWarning):
    """Rigid bodies with Coulomb friction have no accelerations, or several: what follows is one of many motions."""


def did_you_mean(name: str, existing: Iterable[str]) -> str:
    """Sentence that helps with an unknown name: the nearest one, then all that exist."""
    existing = sorted(set(existing))
    near = get_close_matches(str(name), existing, n=1)
    hint = f"Did you mean {near[0]!r}? " if near else ""
    shown = ", ".join(existing[:20]) + (f", … ({len(existing)} in all)" if len(existing) > 20 else "")
    return f"{hint}Known: {shown or 'none yet'}."


DISTRIBUTIONS = {"imageio_ffmpeg": "imageio-ffmpeg", "pinocchio": "pin", "sksundae": "scikit-sundae"}  # of imports


@contextmanager
def extra(name: str):
    """Imports of packages that come with an extra of gauss, for a ``with`` statement.

    Raises
    ------
    MissingPackageError
        If one of them is not installed; the message says how to get it.
    """
    try:
        yield
    except ModuleNotFoundError as error:
        package = error.name.partition(".")[0]
        remedy = f"pip install {DISTRIBUTIONS.get(package, package)}"
        raise MissingPackageError(f"{package} is not installed: {remedy} (extra {name!r}).", name=package) from error


def judged_later() -> np.errstate:
    """Arithmetic, in a ``with`` statement, whose numbers are looked at as a whole when it ends.

    Overflow and 0/0 on the way are found by certificates, step control and checks for finite numbers, which name the cause;
    numpy's own warnings would only stand before that.
    """
    return np.errstate(over="ignore", divide="ignore", invalid="ignore")


SOURCES = {  # where the things that functions take come from
    "Scene": "gauss.load(name) or gauss.Scene(name) makes one",
    "System": "gauss.compile_scene(scene) makes one",
    "State": "system.initial_state() or system.state(q, v) makes one",
    "Compulsion": "gauss.assemble(system, state) makes one",
    "Trajectory": "gauss.simulate(scene, duration) returns one",
}


def user_level() -> int:
    """Stack level of the first caller outside of this package, for :func:`warnings.warn`."""
    frame, level = sys._getframe(1), 1
    while frame.f_back is not None and frame.f_code.co_filename.startswith(PACKAGE):
        frame, level = frame.f_back, level + 1
    return level


def require(value, kinds: tuple[type, ...], function: str):
    """Refuse a thing of another kind.

    Raises
    ------
    ArgumentError
        If it is none of these kinds; the message says what was given, and where what is needed comes from.
    """
    if isinstance(value, kinds):
        return
    names = [kind.__name__ for kind in kinds]
    sources = "; ".join(f"{name}: {SOURCES[name]}" for name in names if name in SOURCES)
    given = f"{value!r} (str)" if isinstance(value, str) else f"a {type(value).__name__}"
    raise ArgumentError(f"{function}: expected a {' or '.join(names)}, got {given}.{f' {sources}.' if sources else ''}")
