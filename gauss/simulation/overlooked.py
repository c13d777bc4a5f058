"""Warnings of motions in which a law may have switched unseen."""

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
        What was simulated.
    method : Integrator
        How.
    stacklevel : int
        How many calls up is whom to tell.

    Warns
    -----
    SwitchingWarning
        With the scene, how often, and what helps.
    """
    stats, name = trajectory.stats, trajectory.system.scene.name
    if stats.unseen and isinstance(method, Library):
        text = f"integrator {method.name!r} does not look for conditions on the motion in the laws of its loads"
        warnings.warn(f"{name!r}: {text}; use 'dop853', which does.", SwitchingWarning, stacklevel=stacklevel)
    elif stats.unseen and isinstance(method, FixedStep):
        text = f"in {stats.unseen} steps of {method.name!r} what a law says may have come and gone unseen"
        warnings.warn(f"{name!r}: {text}; shorten the step, or use 'dop853'.", SwitchingWarning, stacklevel=stacklevel)
    if stats.opaque:
        warn_of_opaque(name, stats.opaque, "step=", stacklevel + 1)


def warn_of_opaque(scene: str, laws: str, option: str, stacklevel: int = 3):
    """Warn of laws that cannot be traced and were evaluated at few points.

    Parameters
    ----------
    scene, laws : str
        Names of what moved, and of what has the laws.
    option : str
        The option that limits the step.
    stacklevel : int
        How many calls up is whom to tell.
    """
    text = f"the law of {laws} cannot be traced and was evaluated at few points of the motion"
    remedy = (
        f"what acts only for a short while may be missed: give breaks=[...] [s] or {option} [s], or write it with gauss.math"
    )
    warnings.warn(f"{scene!r}: {text}; {remedy}.", SwitchingWarning, stacklevel=stacklevel)


def warn_of_times(system: System, times: Timetable, stacklevel: int = 5):
    """Warn of what is known of laws of time, but not heeded.

    Warns
    -----
    SwitchingWarning
        With the scene, and how often a law switches.
    """
    for text in times.lacks:
        warnings.warn(f"{system.scene.name!r}: {text}", SwitchingWarning, stacklevel=stacklevel)


def warn_of_passages(system: System, unseen: np.ndarray, method: str, stacklevel: int = 4):
    """Warn where motions of a batch (batch,) with steps of one length may have passed conditions of laws unseen.

    Warns
    -----
    SwitchingWarning
        With the numbers of the motions.
    """
    which = np.flatnonzero(unseen > 0.0)
    if which.size:
        some = ", ".join(map(str, which[:8])) + (", …" if which.size > 8 else "")
        text = f"in motions {some} what a law says may have come and gone within a step of {method!r}"
        warnings.warn(
            f"{system.scene.name!r}: {text}; shorten the step, or use 'dop853'.", SwitchingWarning, stacklevel=stacklevel
        )
