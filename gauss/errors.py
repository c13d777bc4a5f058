"""Exceptions and warnings of gauss, one tree: a message names the object, the expectation, what exists and the remedy."""

import os
import sys
from collections.abc import Iterable
from contextlib import contextmanager
from functools import cache
from pickle import PicklingError
from typing import TYPE_CHECKING

from gauss.versions import absent_packages

if TYPE_CHECKING:
    import numpy as np

PACKAGE = os.path.dirname(os.path.abspath(__file__)) + os.sep


class GaussError(Exception):
    """Base of every error that gauss raises on purpose."""


class SceneError(GaussError, ValueError):
    """A scene is impossible, incomplete or contradictory."""


class FileError(GaussError, ValueError):
    """A file cannot be read or written in its format."""


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
        Residual of each constraint that is not met, in words, the largest first.
    """

    def __init__(self, message, state=None, violations=None):
        super().__init__(message)
        self.state = state
        self.violations = {} if violations is None else violations


class ArgumentError(GaussError, TypeError):
    """A function was called with an argument of a wrong type."""


class BackendError(GaussError, ValueError):
    """A backend does not exist, is not installed, or does not take this problem."""


class DeviceError(GaussError, RuntimeError):
    """A device does not exist, its driver is missing, or it cannot run a function."""


class SimulationError(GaussError, RuntimeError):
    """A simulation cannot go on; ``trajectory`` holds what was computed so far.

    Parameters
    ----------
    message : str
        What happened and what to do.
    trajectory : Trajectory, optional
        The motion until the failure.
    """

    def __init__(self, message, trajectory=None):
        super().__init__(message)
        self.trajectory = trajectory


class LinkageError(GaussError, ValueError):
    """A linkage does not decompose into a crank and Assur groups, or does not close at some crank angle."""


class UnpicklableError(GaussError, PicklingError):
    """A scene has a law that pickle cannot take."""


class MissingPackageError(GaussError, ImportError):
    """A package that comes with gauss, or with an extra of it, is not installed."""


class NearSingularWarning(UserWarning):
    """A group of links is near a singular position, where its reactions are unbounded."""


class NonUniqueReactionWarning(UserWarning):
    """Redundant constraints: reactions are not unique, the motion is."""


class NotImportedWarning(UserWarning):
    """A file has entries that were not read."""


class UnphysicalInertiaWarning(UserWarning):
    """A file has inertias that no body can have, which were taken as given."""


class StartWarning(UserWarning):
    """A joint starts beyond its limits, at an angle that was probably meant in degrees, or not where the scene puts it."""


class InconsistentConstraintsWarning(UserWarning):
    """Redundant constraints are inconsistent by no more than typed digits."""


class RecordedMotionWarning(UserWarning):
    """Coordinates of a recorded motion do not meet the loop constraints."""


class BalanceWarning(UserWarning):
    """The energy balance of a motion does not close: its integration is inaccurate."""


class DivergenceWarning(UserWarning):
    """Some motions of a batch do not reach the end: they diverged, or cannot continue."""


class SwitchingWarning(UserWarning):
    """A law may have switched between two evaluations without effect on the motion."""


class LimitWarning(UserWarning):
    """An optimal motion is beyond a limit between the points at which it is asked for."""


class TimeDependenceWarning(UserWarning):
    """Laws depend on time, but the result holds for one time only, which was not named."""


class SlowRouteWarning(UserWarning):
    """An element of the scene bars a motion from machine code, which makes it a hundred times slower."""


class CacheWarning(UserWarning):
    """The cache of machine code is not used: others can write to it."""


class PainleveWarning(UserWarning):
    """Rigid bodies with Coulomb friction have no accelerations, or several (Painlevé): the motion is one of many."""


class ContactLawWarning(UserWarning):
    """Steps with contacts did not meet the laws of contact and friction to the tolerance."""


def did_you_mean(name: str, existing: Iterable[str]) -> str:
    """Sentence that helps with an unknown name: the nearest one, then all that exist."""
    from difflib import get_close_matches  # few runs need it

    existing = sorted(set(existing))
    near = get_close_matches(str(name), existing, n=1)
    hint = f"Did you mean {near[0]!r}? " if near else ""
    shown = ", ".join(existing[:20]) + (f", … ({len(existing)} in all)" if len(existing) > 20 else "")
    return f"{hint}Known: {shown or 'none yet'}."


def listed(names: Iterable, most: int = 8) -> str:
    """Names for a message: the first ones, and the number of the others."""
    found = list(map(str, names))
    more = f" and {len(found) - most} more" if len(found) > most else ""
    return ", ".join(found[:most]) + more


DISTRIBUTIONS = {  # of imports
    "git": "GitPython",
    "imageio_ffmpeg": "imageio-ffmpeg",
    "pinocchio": "pin",
    "pxr": "usd-core",
    "robot_descriptions": "robot-descriptions",
    "sksundae": "scikit-sundae",
    "yaml": "pyyaml",
}


@contextmanager
def extra(name: str = ""):
    """Imports of packages that come with an extra of gauss, or with gauss itself, for a ``with`` statement.

    Raises
    ------
    MissingPackageError
        If one of them is not installed; the message says how to get it, and what else of the extra is absent.
    """
    try:
        yield
    except ModuleNotFoundError as error:
        package = (error.name or "").partition(".")[0]
        distribution = DISTRIBUTIONS.get(package, package)
        alike = distribution.replace("_", "-")  # as metadata may spell it
        others = [other for other in (absent_packages(name) if name else []) if other.replace("_", "-") != alike]
        remedy = f"pip install {' '.join([distribution, *others])}"
        source = f"extra {name!r}" if name else "part of the default installation, needed for this alone"
        raise MissingPackageError(f"{package} is not installed: {remedy} ({source}).", name=package) from error


@contextmanager
def writing(path):
    """Writing of a file or folder, for a ``with`` statement; FileError with the reason if it cannot be written."""
    try:
        yield
    except OSError as error:
        raise FileError(f"{path}: cannot be written: {error.strerror}.") from error


@cache
def _errstate() -> type:
    import numpy as np  # messages of the command line need none of it

    return np.errstate


def judged_later() -> "np.errstate":
    """Context without numpy's warnings of overflow and 0/0.

    These are found by certificates, step control and checks for finite numbers, which name the cause.
    """
    return _errstate()(over="ignore", divide="ignore", invalid="ignore")


SOURCES = {  # of the arguments of functions
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
    """Refuse an argument of a wrong type.

    ArgumentError if it is none of these types; the message names the argument and the source of a right one.
    """
    if isinstance(value, kinds):
        return
    names = [kind.__name__ for kind in kinds]
    sources = "; ".join(f"{name}: {SOURCES[name]}" for name in names if name in SOURCES)
    given = f"{value!r} (str)" if isinstance(value, str) else f"a {type(value).__name__}"
    raise ArgumentError(f"{function}: expected a {' or '.join(names)}, got {given}.{f' {sources}.' if sources else ''}")
