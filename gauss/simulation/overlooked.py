"""Warnings of motions with switching events that may be undetected."""

import warnings

import numpy as np

from gauss.dynamics.timetable import Timetable
from gauss.errors import SwitchingWarning
from gauss.integrators import FixedStep, Integrator, Library
from gauss.simulation.trajectory import Trajectory
from gauss.system import System


def warn_of_switching(trajectory: Trajectory, method: Integrator, stacklevel: int = 3):
    """Warn where a law may have switched between two evaluations.

    Parameters
    ----------
    trajectory : Trajectory
        Motion.
    method : Integrator
        Its integrator.
    stacklevel : int
        As of :func:`warnings.warn`.

    Warns
    -----
    SwitchingWarning
        With the scene, the number of steps, and a remedy.
    """
    stats, name = trajectory.stats, trajectory.system.scene.name
    if stats.unseen and isinstance(method, Library):
        text = f"integrator {method.name!r} does not locate switching events of loads whose laws depend on the state"
        warnings.warn(f"{name!r}: {text}; use 'dop853', which does.", SwitchingWarning, stacklevel=stacklevel)
    elif stats.unseen and isinstance(method, FixedStep):
        text = f"{stats.unseen} steps of {method.name!r} may hold undetected switching events of a law"
        warnings.warn(f"{name!r}: {text}; shorten the step, or use 'dop853'.", SwitchingWarning, stacklevel=stacklevel)
    if stats.opaque:
        warn_of_opaque(name, stats.opaque, "step=", stacklevel + 1)


def warn_of_opaque(scene: str, laws: str, option: str, stacklevel: int = 3):
    """Warn of opaque laws that were evaluated at few points.

    Parameters
    ----------
    scene, laws : str
        Names of the scene, and of the loads with opaque laws.
    option : str
        Option that limits the step.
    stacklevel : int
        As of :func:`warnings.warn`.
    """
    text = f"the law of {laws} cannot be traced and was evaluated at few points of the motion"
    remedy = f"a short pulse may be missed: give breaks=[...] [s] or {option} [s], or write it with gauss.math"
    warnings.warn(f"{scene!r}: {text}; {remedy}.", SwitchingWarning, stacklevel=stacklevel)


def warn_of_times(system: System, times: Timetable, stacklevel: int = 5):
    """Warn of features of laws of time that steps do not resolve.

    Warns
    -----
    SwitchingWarning
        With the scene, and the number of features.
    """
    for text in times.lacks:
        warnings.warn(f"{system.scene.name!r}: {text}", SwitchingWarning, stacklevel=stacklevel)


def warn_of_passages(system: System, unseen: np.ndarray, method: str, stacklevel: int = 4):
    """Warn where motions of a fixed-step batch (batch,) may hold undetected switching events.

    Warns
    -----
    SwitchingWarning
        With the numbers of the motions.
    """
    which = np.flatnonzero(unseen > 0.0)
    if which.size:
        some = ", ".join(map(str, which[:8])) + (", …" if which.size > 8 else "")
        text = f"motions {some} may hold undetected switching events of a law within a step of {method!r}"
        warnings.warn(
            f"{system.scene.name!r}: {text}; shorten the step, or use 'dop853'.", SwitchingWarning, stacklevel=stacklevel
        )
