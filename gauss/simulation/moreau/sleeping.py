"""Sleeping of bodies in time stepping: when an island of bodies is put to rest, and for which scenes."""

from dataclasses import dataclass
from math import inf
from numbers import Real

from gauss.dynamics.contact.sleepers import sleepers
from gauss.errors import SimulationError, require
from gauss.system import System

# Largest speed of bodies that are put to rest, relative to the scene's length over its time, and how long they are slower.
# MuJoCo 4.0 takes 1e-3 m/s (its option sleep_tolerance), Box2D half a second (its constant b2_timeToSleep).
REST_SPEED, REST_TIME = 1e-3, 0.5


@dataclass(frozen=True)
class Sleeping:
    """When bodies that touch each other are put to rest.

    Parameters
    ----------
    speed : float, optional
        Largest speed of any point of their shapes [m/s]; 1e-3 of the scene's length over its time when not given. Rates
        that move no shape count as those of a point one length of the scene away.
    duration : float
        How long all of them are slower [s].

    Raises
    ------
    SimulationError
        If one of them is not a number > 0.
    """

    speed: float | None = None
    duration: float = REST_TIME

    def __post_init__(self):
        for name in ("speed", "duration"):
            value = getattr(self, name)
            if value is None and name == "speed":
                continue
            if isinstance(value, bool) or not isinstance(value, Real) or not 0.0 < float(value) < inf:
                raise SimulationError(f"Sleeping: {name}: expected a number > 0, got {value!r}.")

    def speed_in(self, system: System) -> float:
        """Largest speed in a system [m/s]."""
        return REST_SPEED * system.scale.length / system.scale.time if self.speed is None else self.speed


def checked_sleeping(sleeping: "bool | Sleeping", problem) -> Sleeping | None:
    """Sleeping of a motion; None without.

    Parameters
    ----------
    sleeping : bool or Sleeping
        As given by the user.
    problem : Problem
        Initial value problem.

    Raises
    ------
    SimulationError
        If it does not apply to the scene or the method.
    """
    require(sleeping, (bool, Sleeping), "simulate: sleeping")
    if sleeping is False:
        return None
    method = problem.method
    if not getattr(method, "nonsmooth", False) or problem.step is None:
        raise SimulationError(
            f"sleeping: bodies sleep in time stepping of one step, not by {method.name!r} as asked: give "
            "integrator='time_stepping' and step= [s], or no sleeping=."
        )
    sleepers(problem.question)
    return Sleeping() if sleeping is True else sleeping
