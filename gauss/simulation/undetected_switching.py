"""Switching that no event locates: where opaque laws switch within a step, and warnings where switching may be undetected.

The defect y' − f(t, y) of the dense output of an accepted step is small wherever the equations of motion are smooth
(Enright, *A new error-control for initial value solvers*, Appl. Math. Comput. 31, 1989): a large one shows that an opaque
law has switched within the step.
"""

import warnings
from collections.abc import Iterable, Sequence

import numpy as np

from gauss.dynamics.laws.switching_times import Timetable
from gauss.errors import SwitchingWarning, listed, user_level
from gauss.integrators import FixedStep, Integrator, Library
from gauss.simulation.trajectory import Trajectory
from gauss.system import System

PLACES = (0.187, 0.431, 0.569, 0.813)  # of the samples, relative to the step
SHIFTS = -1e-4, 0.0, 1e-4  # of the samples of a difference for y', relative to the step
LARGEST_DEFECT = 1e5  # over the tolerance
REJECTED_SHARE = 0.5  # of a step with a larger defect that is tried next
RESOLVED_STEP = 1e-6  # relative to the duration: the defect of shorter steps is not sampled
SPARSE_STEP = 0.01  # relative to the duration: longer steps with opaque laws may miss short features

Sample = tuple[Sequence[float], Sequence[np.ndarray] | np.ndarray, np.ndarray]  # times and rates, and accelerations


def defect_times(begin: float, h: float) -> np.ndarray:
    """Times (12,) at which :func:`defect_is_large` asks for dense output [s]."""
    return np.array([begin + (place + shift) * h for place in PLACES for shift in SHIFTS])


def defect_is_large(samples: Iterable[Sample], h: float, allowed: np.ndarray) -> bool:
    """Whether the defect of v' at a place in a step of length h [s] exceeds LARGEST_DEFECT times the tolerance (n_v,).

    Samples give, for each place, the :func:`defect_times` there, the rates of the dense output at these, and the
    accelerations at the middle one by the equations of motion; later places are not asked for after a large defect.
    """
    for (before, _, after), (v, _, v_after), accelerations in samples:
        if (h * np.abs((v_after - v) / (after - before) - accelerations) > LARGEST_DEFECT * allowed).any():
            return True
    return False


def warn_of_switching(trajectory: Trajectory, method: Integrator):
    """Warn where a law may have switched between two evaluations, with the number of steps and a remedy."""
    stats, name = trajectory.stats, trajectory.system.scene.name
    if stats.unseen and isinstance(method, Library):
        text = f"integrator {method.name!r} does not locate switching events of loads whose laws depend on the state"
        warnings.warn(f"{name!r}: {text}; use 'dop853', which does.", SwitchingWarning, stacklevel=user_level())
    elif stats.unseen and isinstance(method, FixedStep):
        warn_of_undetected(name, f"in {stats.unseen} of the steps of {method.name!r}")
    if stats.opaque:
        warn_of_opaque(name, stats.opaque, "step=")


def warn_of_undetected(scene: str, where: str):
    """Warn of laws that may have switched undetected within fixed steps of a scene, ``where`` in words."""
    remedy = "shorten the step, or use 'dop853'"
    warnings.warn(
        f"{scene!r}: {where} a law may have switched, peaked or oscillated undetected; {remedy}.",
        SwitchingWarning,
        stacklevel=user_level(),
    )


def warn_of_opaque(scene: str, laws: str, option: str):
    """Warn of opaque laws, by the names of their loads, that were evaluated at few points; the option limits the step."""
    text = f"the law of {laws} cannot be traced and was evaluated at few points of the motion"
    remedy = f"a short pulse may be missed: give breaks=[...] [s] or {option} [s], or write it with gauss.math"
    warnings.warn(f"{scene!r}: {text}; {remedy}.", SwitchingWarning, stacklevel=user_level())


def warn_of_times(system: System, times: Timetable):
    """Warn of features of laws of time that steps do not resolve."""
    for text in times.limitations:
        warnings.warn(f"{system.scene.name!r}: {text}", SwitchingWarning, stacklevel=user_level())


def warn_of_passages(system: System, unseen: np.ndarray, method: str):
    """Warn of the motions of a fixed-step batch (batch,) that may hold undetected switching events."""
    which = np.flatnonzero(unseen > 0.0)
    if which.size:
        warn_of_undetected(system.scene.name, f"in motions {listed(which)}, within a step of {method!r},")
