"""Warnings of switching events that may be undetected: with fixed steps, other libraries, and opaque laws."""

import warnings

import numpy as np

from gauss.dynamics.laws.switching_times import Timetable
from gauss.errors import SwitchingWarning, user_level
from gauss.integrators import FixedStep, Integrator, Library
from gauss.simulation.trajectory import Trajectory
from gauss.system import System


def warn_of_switching(trajectory: Trajectory, method: Integrator):
    """Warn where a law may have switched between two evaluations.

    Parameters
    ----------
    trajectory : Trajectory
        Motion.
    method : Integrator
        Its integrator.

    Warns
    -----
    SwitchingWarning
        With the scene, the number of steps, and a remedy.
    """
    stats, name = trajectory.stats, trajectory.system.scene.name
    if stats.unseen and isinstance(method, Library):
        text = f"integrator {method.name!r} does not locate switching events of loads whose laws depend on the state"
        warnings.warn(f"{name!r}: {text}; use 'dop853', which does.", SwitchingWarning, stacklevel=user_level())
    elif stats.unseen and isinstance(method, FixedStep):
        text = f"in {stats.unseen} of the steps of {method.name!r} a law may have switched undetected"
        warnings.warn(f"{name!r}: {text}; shorten the step, or use 'dop853'.", SwitchingWarning, stacklevel=user_level())
    if stats.opaque:
        warn_of_opaque(name, stats.opaque, "step=")


def warn_of_opaque(scene: str, laws: str, option: str):
    """Warn of opaque laws that were evaluated at few points.

    Parameters
    ----------
    scene, laws : str
        Names of the scene, and of the loads with opaque laws.
    option : str
        Option that limits the step.
    """
    text = f"the law of {laws} cannot be traced and was evaluated at few points of the motion"
    remedy = f"a short pulse may be missed: give breaks=[...] [s] or {option} [s], or write it with gauss.math"
    warnings.warn(f"{scene!r}: {text}; {remedy}.", SwitchingWarning, stacklevel=user_level())


def warn_of_times(system: System, times: Timetable):
    """Warn of features of laws of time that steps do not resolve.

    Warns
    -----
    SwitchingWarning
        With the scene, and the number of features.
    """
    for text in times.limitations:
        warnings.warn(f"{system.scene.name!r}: {text}", SwitchingWarning, stacklevel=user_level())


def warn_of_passages(system: System, unseen: np.ndarray, method: str):
    """Warn where motions of a fixed-step batch (batch,) may hold undetected switching events.

    Warns
    -----
    SwitchingWarning
        With the numbers of the motions.
    """
    which = np.flatnonzero(unseen > 0.0)
    if which.size:
        some = ", ".join(map(str, which[:8])) + (", …" if which.size > 8 else "")
        text = f"in motions {some} a law may have switched undetected within a step of {method!r}"
        warnings.warn(
            f"{system.scene.name!r}: {text}; shorten the step, or use 'dop853'.", SwitchingWarning, stacklevel=user_level()
        )
